"""A hand of some shape in some pose, as a visitor places it; the factors of its shape that can be set."""

from __future__ import annotations

from functools import lru_cache
from typing import NamedTuple

import numpy as np

from spf.frame import Frame
from spf.hand import HandShape
from spf.hand.handles import Stance, handle_points
from spf.hand.model import FINGERS, Hand

__all__ = ["SHAPE_PARTS", "Placed", "hand_of", "part_of", "pixels_of", "with_part"]

_BONES_A_DIGIT = 3

#: What of a hand's shape a visitor sets, by the words of the page.
SHAPE_PARTS = {
    "Size": "scale",
    **{f"{finger.capitalize()} length": finger for finger in FINGERS},
    "Palm width": "palm_width", "Palm thickness": "palm_thickness", "Finger thickness": "finger_thickness",
}  # fmt: skip


class Placed(NamedTuple):
    """A hand of some shape in some pose."""

    shape: HandShape
    stance: Stance

    @property
    def hand(self) -> Hand:
        """The hand of that shape."""
        return hand_of(self.shape)


@lru_cache(maxsize=32)
def hand_of(shape: HandShape) -> Hand:
    """Return the hand of a shape; those made last are remembered."""
    return shape.hand()


def pixels_of(placed: Placed, frame: Frame) -> dict[str, tuple[float, float]]:
    """Return the pixels of the handles of a hand."""
    points = handle_points(placed.hand, placed.stance)
    return {name: (float(u), float(v)) for name, (u, v) in ((n, frame.camera.project(p)) for n, p in points.items())}


def part_of(shape: HandShape, part: str) -> float:
    """Return a factor of :data:`SHAPE_PARTS`; that of a finger is the geometric mean over its bones."""
    if part not in FINGERS:
        return float(getattr(shape, part))
    first = _BONES_A_DIGIT * FINGERS.index(part)
    return float(np.exp(np.log(shape.lengths[first : first + _BONES_A_DIGIT]).mean()))


def with_part(shape: HandShape, part: str, value: float) -> HandShape:
    """Return a shape with one factor of :data:`SHAPE_PARTS`.

    Raises:
        HandError: no human hand is like that.
    """
    if part in FINGERS:
        lengths, first = list(shape.lengths), _BONES_A_DIGIT * FINGERS.index(part)
        ratio = value / part_of(shape, part)
        lengths[first : first + _BONES_A_DIGIT] = [ratio * own for own in lengths[first : first + _BONES_A_DIGIT]]
        changed = shape._replace(lengths=tuple(lengths))
    else:
        changed = shape
    return HandShape.from_dict({**changed.to_dict(), **({} if part in FINGERS else {part: float(value)})}, "The hand")
