"""Plain gradient descent: Stochastic Meta-Descent with μ = 0 and λ = 0 (spec 5), on the same stochastic samples.

The step sizes stay what they begin with, a₀ over the Gauss-Newton curvature of each entry, but for the annealing that
SMD has too.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from spf.cost.problem import Problem
from spf.optimisers import smd
from spf.optimisers.smd import DescentSettings, SmdSettings
from spf.optimisers.trajectory import Trajectory

__all__ = ["as_smd", "optimise"]

Array = NDArray[np.float64]


def as_smd(settings: DescentSettings) -> SmdSettings:
    """Return the settings of SMD that make it gradient descent."""
    shared = {info.name: getattr(settings, info.name) for info in DescentSettings.describe()}
    return SmdSettings(**shared, mu=0.0, decay=0.0, least_step=1.0, most_step=1.0)


def optimise(
    problem: Problem,
    settings: DescentSettings,
    rng: np.random.Generator,
    start: Array,
    *,
    prior: Array | None = None,
    precision: Array | None = None,
    effort: float = 1.0,
    record: bool = False,
) -> tuple[Array, Trajectory | None, int]:
    """Minimise the cost from a pose with gradient descent; see :class:`spf.optimisers.trajectory.Optimise`."""
    return smd.optimise(
        problem, as_smd(settings), rng, start, prior=prior, precision=precision, effort=effort, record=record
    )
