"""L-BFGS-B (Byrd, Lu, Nocedal, Zhu 1995) on the deterministic cost: a quasi-Newton method within the joint limits."""

from __future__ import annotations

import dataclasses

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import OptimizeResult, minimize

from spf.cost.problem import Problem
from spf.optimisers.rounds import FixedCost, RoundsSettings, in_rounds
from spf.optimisers.trajectory import Trajectory
from spf.settings import setting

__all__ = ["BfgsSettings", "optimise"]

Array = NDArray[np.float64]


@dataclasses.dataclass(frozen=True)
class BfgsSettings(RoundsSettings):
    """How L-BFGS-B minimises."""

    iterations: int = setting(20, "iterations between two refreshes", group="Optimiser", low=1, high=1000)
    memory: int = setting(10, "steps that the curvature is learnt from", group="Optimiser", low=1, high=100)


def optimise(
    problem: Problem,
    settings: BfgsSettings,
    rng: np.random.Generator,
    start: Array,
    *,
    prior: Array | None = None,
    precision: Array | None = None,
    effort: float = 1.0,
    record: bool = False,
) -> tuple[Array, Trajectory | None, int]:
    """Minimise the cost from a pose with L-BFGS-B, on all visible points; see :class:`.trajectory.Optimise`.

    The entries are scaled by the curvature where a round begins. Nothing is random.
    """

    def minimise(cost: FixedCost, pose: Array) -> Array:
        scale = cost.scale(pose)

        def scaled(x: Array) -> tuple[float, Array]:
            found = cost.products(x * scale)
            return found.energy, found.gradient * scale

        def note(intermediate_result: OptimizeResult) -> None:
            cost.note(intermediate_result.x * scale, float(intermediate_result.fun))

        found = minimize(
            scaled, pose / scale, jac=True, method="L-BFGS-B", bounds=problem.hand.limits / scale[:, None],
            callback=note, options={"maxiter": settings.iterations, "maxcor": settings.memory},
        )  # fmt: skip
        return problem.hand.constrain(found.x * scale)

    rounds = max(1, round(settings.rounds * effort))
    return in_rounds(problem, start, minimise, rounds=rounds, prior=prior, precision=precision, record=record)
