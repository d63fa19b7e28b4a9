"""Powell's method (1964) on the deterministic cost: line searches along conjugate directions, without derivatives."""

from __future__ import annotations

import dataclasses

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import OptimizeResult, minimize

from spf.cost.problem import Problem
from spf.optimisers.rounds import FixedCost, RoundsSettings, in_rounds
from spf.optimisers.trajectory import Trajectory
from spf.settings import setting

__all__ = ["PowellSettings", "optimise"]

Array = NDArray[np.float64]
# Farthest that an entry of the palm is looked for in a round, m and rad: SciPy's line search wants an interval.
_REACH_TRANSLATION, _REACH_ROTATION = 0.06, 0.8
_TOLERANCE = 1e-3  # of E, relative: a sweep that gains less is the last one of its round


@dataclasses.dataclass(frozen=True)
class PowellSettings(RoundsSettings):
    """How Powell's method minimises."""

    rounds: int = setting(2, "times that visibility and matches are refreshed", group="Optimiser", low=1, high=100)
    evaluations: int = setting(
        500, "most cost evaluations between two refreshes", group="Optimiser", low=20, high=100000
    )


def optimise(
    problem: Problem,
    settings: PowellSettings,
    rng: np.random.Generator,
    start: Array,
    *,
    prior: Array | None = None,
    precision: Array | None = None,
    effort: float = 1.0,
    record: bool = False,
) -> tuple[Array, Trajectory | None, int]:
    """Minimise the cost from a pose with Powell's method, on all visible points; see :class:`.trajectory.Optimise`.

    The entries are scaled by the curvature where a round begins. Nothing is random.
    """

    def minimise(cost: FixedCost, pose: Array) -> Array:
        scale = cost.scale(pose)

        def note(intermediate_result: OptimizeResult) -> None:
            cost.note(intermediate_result.x * scale, float(intermediate_result.fun))

        found = minimize(
            lambda x: cost.products(x * scale).energy, pose / scale, method="Powell",
            bounds=_box(problem.hand.limits, pose) / scale[:, None], callback=note,
            options={"maxfev": settings.evaluations, "ftol": _TOLERANCE},
        )  # fmt: skip
        cost.note(found.x * scale, float(found.fun))  # the limit on evaluations ends it within an iteration
        return problem.hand.constrain(found.x * scale)

    rounds = max(1, round(settings.rounds * effort))
    return in_rounds(problem, start, minimise, rounds=rounds, prior=prior, precision=precision, record=record)


def _box(limits: Array, pose: Array) -> Array:
    """Where a round looks, (D, 2): the joint limits, and for the palm a box around the pose."""
    box = limits.copy()
    reach = np.array([_REACH_TRANSLATION] * 3 + [_REACH_ROTATION] * 3)
    box[:6] = np.stack([pose[:6] - reach, pose[:6] + reach], axis=1)
    return box
