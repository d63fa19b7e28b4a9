"""A deterministic cost for optimisers that cannot handle noise, and the rounds in which they minimise it.

SMD draws a fresh sample of points in every iteration. BFGS, Powell and Levenberg-Marquardt compare values of the cost
with each other and would follow the noise, so they get all the points that the camera sees, and all pixels of the pool.
What is seen and matched is refreshed between rounds, as SMD does; within a round the cost is a fixed function.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from spf.cost.problem import Problem, scratch_of
from spf.cost.products import Products, Sample, curvature, products, see
from spf.optimisers.trajectory import Trajectory
from spf.settings import Settings, setting

__all__ = ["FixedCost", "RoundsSettings", "in_rounds"]

Array = NDArray[np.float64]


@dataclasses.dataclass(frozen=True)
class RoundsSettings(Settings):
    """How often a deterministic optimiser begins anew."""

    rounds: int = setting(5, "times that visibility and matches are refreshed", group="Optimiser", low=1, high=100)


class FixedCost:
    """E of one round as a function of the pose; counts its evaluations and keeps the path that it is told.

    Args:
        problem: cost and observation.
        sample: what is compared.
        prior, precision: (D,) pull ½ π (p − p̄)²; none when None.

    Attributes:
        evaluations: passes over the sample until now.
        path: (pose, E) of every iteration that was noted.
    """

    def __init__(self, problem: Problem, sample: Sample, prior: Array | None, precision: Array | None) -> None:
        self.problem, self.sample, self.prior, self.precision = problem, sample, prior, precision
        self.evaluations = 0
        self.path: list[tuple[Array, float]] = []
        self._work = scratch_of(problem).work
        self._still = np.zeros(problem.hand.dofs)

    def products(self, pose: Array, direction: Array | None = None) -> Products:
        """E, its gradient, and its Gauss-Newton product with a direction (D,)."""
        self.evaluations += 1
        return products(
            self.problem, pose, self._still if direction is None else direction, self.sample,
            prior=self.prior, precision=self.precision, work=self._work,
        )  # fmt: skip

    def hessian(self, pose: Array) -> Array:
        """Gauss-Newton Hessian (D, D), one product a column."""
        return np.stack([self.products(pose, column).product for column in np.eye(len(pose))])

    def scale(self, pose: Array) -> Array:
        """Length (D,) of each entry that costs about as much as that of any other, from the curvature."""
        diagonal = curvature(self.problem, pose, self.sample, precision=self.precision)
        return np.asarray(1.0 / np.sqrt(diagonal + self.problem.curvature_floor))

    def note(self, pose: Array, energy: float) -> None:
        """Add an iteration to the path."""
        self.path.append((pose.copy(), energy))


def in_rounds(
    problem: Problem,
    start: Array,
    minimise: Callable[[FixedCost, Array], Array],
    *,
    rounds: int,
    prior: Array | None,
    precision: Array | None,
    record: bool,
) -> tuple[Array, Trajectory | None, int]:
    """Minimise from a pose in rounds; between two, what is seen of the hand and matched with the pixels is refreshed.

    Args:
        problem: cost and observation.
        start: (D,).
        minimise: (cost of the round, pose) → pose within the joint limits; it notes the pose that each iteration ends in.
        rounds: number of them; fewer when nothing of the hand can be seen.
        prior, precision: (D,) pull ½ π (p − p̄)²; none when None.
        record: whether to return the trajectory.

    Returns:
        (pose (D,), trajectory or None, number of evaluations).
    """
    pose, evaluations = np.asarray(start, dtype=np.float64).copy(), 0
    path: list[tuple[Array, float]] = []
    for _ in range(rounds):
        sample = see(problem, pose)
        if not len(sample.points):
            break
        cost = FixedCost(problem, sample, start if prior is None else prior, precision)
        cost.note(pose, cost.products(pose).energy)
        pose = minimise(cost, pose)
        evaluations += cost.evaluations
        path += cost.path
    return pose, _trajectory(start, pose, path) if record else None, evaluations


def _trajectory(start: Array, end: Array, path: list[tuple[Array, float]]) -> Trajectory:
    """The path, closed by its end, which repeats the last cost."""
    noted = path or [(start, np.nan)]
    poses = np.stack([*(pose for pose, _ in noted), end])
    costs = np.array([energy for _, energy in [*noted, noted[-1]]])
    return Trajectory(poses, costs, np.full_like(poses, np.nan))
