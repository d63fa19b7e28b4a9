"""Levenberg-Marquardt (Marquardt 1963) on the deterministic cost: what trackers by articulated ICP do (spec 7)."""

from __future__ import annotations

import dataclasses

import numpy as np
from numpy.typing import NDArray

from spf.cost.problem import Problem
from spf.optimisers.rounds import FixedCost, RoundsSettings, in_rounds
from spf.optimisers.smd import step_bounds
from spf.optimisers.trajectory import Trajectory
from spf.settings import setting

__all__ = ["LmSettings", "damped_step", "optimise"]

Array = NDArray[np.float64]
_EASE, _TIGHTEN = 1.0 / 3.0, 4.0  # factors on the damping after a step that was taken, and one that was refused
_STEPS = 3.0  # bound of a step, in the longest steps of a descent
_LEAST_DAMPING, _MOST_DAMPING = 1e-6, 1e6


@dataclasses.dataclass(frozen=True)
class LmSettings(RoundsSettings):
    """How Levenberg-Marquardt minimises."""

    iterations: int = setting(3, "steps tried between two refreshes", group="Optimiser", low=1, high=100)
    damping: float = setting(
        0.1,
        "first damping of a round, relative to the diagonal of the Gauss-Newton Hessian",
        group="Optimiser",
        low=1e-6,
        high=1e6,
    )


def optimise(
    problem: Problem,
    settings: LmSettings,
    rng: np.random.Generator,
    start: Array,
    *,
    prior: Array | None = None,
    precision: Array | None = None,
    effort: float = 1.0,
    record: bool = False,
) -> tuple[Array, Trajectory | None, int]:
    """Minimise the cost from a pose, on all visible points; see :class:`.trajectory.Optimise`.

    Nothing is random. The Hessian takes D products, each counted as an evaluation.
    """

    bound = _STEPS * step_bounds(len(start))

    def minimise(cost: FixedCost, pose: Array) -> Array:
        damping, now, hessian = settings.damping, cost.products(pose), cost.hessian(pose)
        for _ in range(settings.iterations):
            step = damped_step(hessian, now.gradient, damping, pose, problem.hand.limits)
            tried = problem.hand.constrain(pose + np.clip(step, -bound, bound))
            there = cost.products(tried)
            if there.energy < now.energy:
                pose, now, hessian = tried, there, cost.hessian(tried)
                damping = max(damping * _EASE, _LEAST_DAMPING)
                cost.note(pose, now.energy)
            else:
                damping = min(damping * _TIGHTEN, _MOST_DAMPING)
        return pose

    rounds = max(1, round(settings.rounds * effort))
    return in_rounds(problem, start, minimise, rounds=rounds, prior=prior, precision=precision, record=record)


def damped_step(hessian: Array, gradient: Array, damping: float, pose: Array, limits: Array) -> Array:
    """Solve ``(H + damping · diag H) δ = −g`` for the entries that may move.

    An entry at its limit whose gradient pushes it further out stays there.

    Args:
        hessian, gradient: (D, D) and (D,) at the pose.
        damping: relative to the diagonal.
        pose: (D,) within its limits.
        limits: (D, 2).

    Returns:
        (D,) δ.
    """
    stuck = ((pose <= limits[:, 0]) & (gradient > 0)) | ((pose >= limits[:, 1]) & (gradient < 0))
    free = np.flatnonzero(~stuck)
    damped = hessian[np.ix_(free, free)]
    diagonal = np.diagonal(damped)
    # entries that nothing is seen of have no curvature: the floor keeps them where they are
    damped = damped + np.diag(damping * diagonal + 1e-6 * max(diagonal.max(initial=0.0), 1e-12))
    step = np.zeros(len(pose))
    step[free] = np.linalg.solve(damped, -gradient[free])
    return step
