"""Stochastic Meta-Descent (spec 5; eq. 14-24; Bray et al. 2007): settings, one run, its trajectory."""

from __future__ import annotations

import dataclasses

import numpy as np
from numpy.typing import NDArray

from spf.cost.problem import Problem, scratch_of
from spf.kernels.smd import SmdParameters, smd_run
from spf.optimisers.trajectory import Trajectory
from spf.settings import Settings, setting

__all__ = ["DescentSettings", "SmdSettings", "optimise"]

Array = NDArray[np.float64]
_SMD, _DESCENT = "Stochastic meta-descent", "Descent"
# Longest step of an entry in one iteration, and least curvature that its a₀ is computed with.
_BOUND_TRANSLATION, _BOUND_PALM, _BOUND_DIGIT = 0.006, 0.1, 0.2


@dataclasses.dataclass(frozen=True)
class DescentSettings(Settings):
    """How far and how often a descent on stochastic samples steps."""

    initial_step: float = setting(
        0.4,
        "first step size, relative to the inverse Gauss-Newton curvature",
        group=_DESCENT,
        low=1e-4,
        high=2.0,
        symbol="a₀",
    )
    rounds: int = setting(8, "times that visibility and matches are refreshed", group=_DESCENT, low=1, high=100)
    iterations: int = setting(10, "iterations between two refreshes", group=_DESCENT, low=1, high=200)
    anneal: bool = setting(True, "bound a/a₀ by a falling factor over the second half", group=_DESCENT)
    tolerance: float = setting(
        0.0, "relative change of E between rounds under which a run ends", group=_DESCENT, low=0.0, high=1.0
    )


@dataclasses.dataclass(frozen=True)
class SmdSettings(DescentSettings):
    """How the step sizes of a particle's descent adapt."""

    mu: float = setting(0.02, "meta-step size of the step-size adaptation", group=_SMD, low=0.0, high=1.0, symbol="μ")
    decay: float = setting(0.9, "decay of the gradient trace", group=_SMD, low=0.0, high=1.0, symbol="λ")
    least_step: float = setting(0.1, "lower bound of a/a₀", group=_SMD, low=1e-4, high=1.0)
    most_step: float = setting(5.0, "upper bound of a/a₀", group=_SMD, low=1.0, high=100.0)


def optimise(
    problem: Problem,
    settings: SmdSettings,
    rng: np.random.Generator,
    start: Array,
    *,
    prior: Array | None = None,
    precision: Array | None = None,
    effort: float = 1.0,
    record: bool = False,
) -> tuple[Array, Trajectory | None, int]:
    """Minimise the cost from a pose with SMD.

    Args:
        problem: cost and observation.
        settings: of SMD.
        rng: draws the samples.
        start: (D,) pose relative to ``problem.reference``.
        prior, precision: (D,) pull ½ π (p − p̄)²; none when None.
        effort: factor on the number of rounds.
        record: whether to return the trajectory.

    Returns:
        (pose (D,), trajectory or None, number of iterations).
    """
    parameters = smd_parameters(problem, settings, effort)
    dofs = len(start)
    pool = problem.data_pool
    draws = rng.integers(
        0,
        2**32,
        size=(parameters.rounds * parameters.iterations, parameters.points + parameters.data_points),
        dtype=np.uint32,
    )
    size = len(draws) + 1 if record else 0
    trace = Trajectory(np.empty((size, dofs)), np.empty(size), np.empty((size, dofs)))
    result = np.empty(dofs)
    hand = problem.hand
    done = smd_run(
        hand.skeleton, hand.skin, hand.proxy, hand.proxy_faces, problem.spheres, hand.limits,
        problem.observation.arrays, problem.weights, parameters,
        np.ascontiguousarray(start), problem.reference,
        start if prior is None else prior, np.zeros(dofs) if precision is None else precision,
        step_bounds(dofs), problem.curvature_floor, draws, pool,
        scratch_of(problem), result, *trace,
    )  # fmt: skip
    cut = Trajectory(*(part[: done + 1] for part in trace)) if record else None
    return result, cut, int(done)


def smd_parameters(problem: Problem, settings: SmdSettings, effort: float = 1.0) -> SmdParameters:
    """Return the numbers that the kernel takes."""
    return SmdParameters(
        meta_step=float(settings.mu),
        decay=float(settings.decay),
        initial_step=float(settings.initial_step),
        least=float(settings.least_step),
        most=float(settings.most_step),
        rounds=max(1, round(settings.rounds * effort)),
        iterations=int(settings.iterations),
        points=int(problem.settings.points),
        data_points=int(problem.settings.data_points) if problem.settings.coverage > 0 else 0,
        anneal=bool(settings.anneal),
        tolerance=float(settings.tolerance),
        match_radius=problem.match_radius,
        zbuffer=bool(problem.settings.zbuffer),
    )


def step_bounds(dofs: int) -> Array:
    """Longest step (D,) of each entry in one iteration, m and rad."""
    return np.array([_BOUND_TRANSLATION] * 3 + [_BOUND_PALM] * 3 + [_BOUND_DIGIT] * (dofs - 6))
