"""What every optimiser takes and gives, and the path through the poses that it records when it is asked to."""

from __future__ import annotations

from typing import Any, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from spf.cost.problem import Problem

__all__ = ["Optimise", "Trajectory"]

Array = NDArray[np.float64]


class Trajectory(NamedTuple):
    """The trajectory of a run of I iterations.

    Attributes:
        poses: (I + 1, D).
        costs: (I + 1,) E on the sample of each iteration; the last one may repeat.
        step_sizes: (I + 1, D) a of every entry; nan for an optimiser that has none.
    """

    poses: NDArray[np.floating[Any]]
    costs: NDArray[np.floating[Any]]
    step_sizes: NDArray[np.floating[Any]]


class Optimise(Protocol):
    """Minimise the cost of a frame from a pose."""

    def __call__(
        self,
        problem: Problem,
        settings: Any,
        rng: np.random.Generator,
        start: Array,
        *,
        prior: Array | None = None,
        precision: Array | None = None,
        effort: float = 1.0,
        record: bool = False,
    ) -> tuple[Array, Trajectory | None, int]:
        """Return the pose found (D,), the trajectory or None, and how often the cost was evaluated.

        Args:
            problem: cost and observation.
            settings: of the optimiser.
            rng: all randomness.
            start: (D,) pose relative to ``problem.reference``, within the joint limits.
            prior, precision: (D,) pull ½ π (p − p̄)²; none when None.
            effort: factor on the number of rounds.
            record: whether to return the trajectory.
        """
        ...
