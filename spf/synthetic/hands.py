"""Hand shapes for synthetic sessions: a table by name, and ``random``, drawn from a seed."""

from __future__ import annotations

import numpy as np

from spf.hand.model import Side
from spf.hand.shape import HandShape, lengths_of_digits

__all__ = ["SHAPES", "hand_shape"]

#: Keyword arguments of :class:`~spf.hand.shape.HandShape` by name; the standard hand measures 19 cm.
SHAPES: dict[str, dict[str, float | tuple[float, ...]]] = {
    "standard": {},
    "child": {"scale": 0.7, "palm_width": 1.03, "finger_thickness": 1.08},
    "small": {"scale": 0.86},
    "large": {"scale": 1.12, "palm_width": 1.03},
    "long_fingers": {"lengths": lengths_of_digits((1.06, 1.12, 1.12, 1.12, 1.12)), "finger_thickness": 0.95},
    "short_fingers": {"lengths": lengths_of_digits((0.95, 0.9, 0.9, 0.9, 0.88)), "finger_thickness": 1.05},
    "thick": {"palm_width": 1.1, "palm_thickness": 1.15, "finger_thickness": 1.2},
    "slim": {"palm_width": 0.93, "palm_thickness": 0.9, "finger_thickness": 0.88},
}


def hand_shape(name: str, side: Side, rng: np.random.Generator) -> HandShape:
    """Return a shape of the table, or one drawn at random.

    Args:
        name: a key of :data:`SHAPES`, or ``"random"``.
        side: which hand.
        rng: draws the random shape; unused by the others.
    """
    if name != "random":
        return HandShape(side, **SHAPES[name])  # type: ignore[arg-type]
    digits = rng.normal(1.0, 0.05, 5).clip(0.88, 1.14)
    return HandShape(
        side,
        scale=_drawn(rng, 0.97, 0.1, 0.68, 1.2),
        lengths=tuple(float(x) for x in np.repeat(digits, 3) * rng.normal(1.0, 0.02, 15).clip(0.95, 1.05)),
        palm_width=_drawn(rng, 1.0, 0.05, 0.88, 1.12),
        palm_thickness=_drawn(rng, 1.0, 0.06, 0.85, 1.15),
        finger_thickness=_drawn(rng, 1.0, 0.07, 0.85, 1.2),
    )


def _drawn(rng: np.random.Generator, mean: float, spread: float, low: float, high: float) -> float:
    return float(np.clip(rng.normal(mean, spread), low, high))
