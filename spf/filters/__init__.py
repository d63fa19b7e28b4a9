"""Filters: particle sets, resampling, dynamics, kernel density estimation, and the Smart Particle Filter."""
