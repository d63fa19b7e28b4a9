"""The path of an optimiser through the poses: what every optimiser records when it is asked to."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

__all__ = ["Trajectory"]

Array = NDArray[np.float64]


class Trajectory(NamedTuple):
    """The trajectory of a run of I iterations.

    Attributes:
        poses: (I + 1, D).
        costs: (I + 1,) E on the sample of each iteration; the last one may repeat.
        step_sizes: (I + 1, D) a of every entry; nan for an optimiser that has none.
    """

    poses: Array
    costs: Array
    step_sizes: Array
