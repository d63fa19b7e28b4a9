"""The joint orders of the data sets, brought into the project's order."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from spf.frame import JOINT_NAMES

__all__ = ["WRIST_THEN_INDEX_TO_THUMB", "arrange_joints"]

#: CVAR and MSRA15: wrist, then index, middle, ring, little and thumb, each from its base to its tip.
WRIST_THEN_INDEX_TO_THUMB: tuple[str, ...] = (JOINT_NAMES[0], *JOINT_NAMES[5:], *JOINT_NAMES[1:5])


def arrange_joints(points: NDArray[np.float64], names: Sequence[str | None]) -> NDArray[np.float64]:
    """Arrange a data set's joints as :data:`spf.frame.JOINT_NAMES`.

    Args:
        points: (..., J, 3) points in the data set's order.
        names: the project's name of each of the J points, None for one that the project has no name for.

    Returns:
        (..., 21, 3) points, NaN for the joints that the data set does not have.
    """
    arranged = np.full((*points.shape[:-2], len(JOINT_NAMES), 3), np.nan)
    for position, name in enumerate(names):
        if name is not None:
            arranged[..., JOINT_NAMES.index(name), :] = points[..., position, :]
    return arranged
