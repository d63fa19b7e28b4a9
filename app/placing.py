"""One joint being marked: at a pixel of the depth, behind the surface that is seen there."""

from __future__ import annotations

import math
from functools import cache
from typing import NamedTuple

import numpy as np

from spf.frame import JOINT_NAMES, Frame
from spf.hand import load_hand
from spf.hand.distance import distances_to_surface
from spf.hand.kinematics import joints_of
from spf.sessions import Mark

__all__ = ["Placing", "depth_beneath", "followed", "mark_at", "skin_offsets"]

_AROUND = 2  # pixels beside a mark among which its depth is looked for
_SAME_SURFACE = 0.04  # m that a surface may have moved from one frame to the next and still be a joint's


class Placing(NamedTuple):
    """A joint in the making.

    Attributes:
        mark: as it is kept.
        suggested: whether it was only taken over from another frame: nobody has looked at it here, and it is not kept.
    """

    mark: Mark
    suggested: bool = False


@cache
def skin_offsets() -> dict[str, float]:
    """Return how far the joints of the bundled hand lie under its skin, m: what a mark is put behind the surface seen."""
    hand = load_hand("right")
    away = distances_to_surface(joints_of(hand, hand.neutral_pose()), hand.skin.vertices, hand.faces)
    return {name: round(float(distance), 4) for name, distance in zip(JOINT_NAMES, away, strict=True)}


def depth_beneath(frame: Frame, u: float, v: float) -> float:
    """Return the depth in metres of the surface seen at a pixel, the middle of its neighbours' where it has none; else 0."""
    column, row = round(u), round(v)
    height, width = frame.depth.shape
    if not (0 <= row < height and 0 <= column < width):
        return 0.0
    if frame.depth[row, column] > 0:
        return float(frame.depth[row, column])
    part = frame.depth[max(row - _AROUND, 0) : row + _AROUND + 1, max(column - _AROUND, 0) : column + _AROUND + 1]
    return float(np.median(part[part > 0])) if (part > 0).any() else 0.0


def mark_at(frame: Frame, u: float, v: float, depth: float, offset: float) -> Mark:
    """Return a mark at a pixel.

    Args:
        frame: whose camera sees it.
        u, v: pixels.
        depth: m.
        offset: by which that is behind the surface seen, m; NaN where it is not known.
    """
    x, y, z = (round(float(number), 6) for number in frame.camera.back_project(u, v, depth))
    return Mark((x, y, z), offset)


def followed(frame: Frame, mark: Mark) -> Mark:
    """Return a mark of the frame before, put on the surface under it in this one if that is near."""
    if mark.point is None or math.isnan(mark.offset):
        return mark
    u, v = (float(number) for number in frame.camera.project(mark.point))
    depth = depth_beneath(frame, u, v) + mark.offset
    return mark_at(frame, u, v, depth, mark.offset) if abs(depth - mark.point[2]) < _SAME_SURFACE else mark
