"""Smart Particle Filter: Stochastic Meta-Descent inside a particle filter, tracking a hand in depth sessions."""

__version__ = "0.1.0"
