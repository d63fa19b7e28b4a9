"""Postures: the 20 articulated entries of a pose in an open hand, a fist, a pinch; angles from the bind pose."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from spf.hand.kinematics import pose_hand
from spf.hand.model import FINGERS, Hand

__all__ = ["CURLED", "FIST", "FLAT", "GRASP", "OPEN", "POINT", "RELAXED", "count", "posture", "touch"]

Array = NDArray[np.float64]
Finger = tuple[float, float, float]

_PALM = 6  # entries of a pose before the articulated ones
_PAD_DEPTH = 0.0065  # metres from a tip joint to the skin of its pad
_GAP_UNIT = 0.004  # metres of gap that weigh as much as one radian from the natural start

_STRAIGHT: Finger = (0.0, 2.0, 3.0)
_BENT: Finger = (0.0, 82.0, 100.0)


def posture(thumb: tuple[float, float, float, float], *fingers: Finger) -> Array:
    """Return the articulated entries (20,) of a pose, radians.

    Args:
        thumb: TM abduction, TM flexion, MP flexion, IP flexion, degrees.
        fingers: MP abduction, MP flexion, PIP flexion of index, middle, ring and little finger, degrees.
    """
    entries = [*thumb]
    for abduction, mp, pip in fingers:
        entries += [abduction, mp, 0.0, pip]
    return np.radians(np.array(entries))


OPEN = posture((0, 0, 0, 0), _STRAIGHT, _STRAIGHT, _STRAIGHT, _STRAIGHT)
FLAT = posture((-15, 20, 0, 0), (-5, 2, 3), (-1, 2, 3), (3, 2, 3), (8, 2, 3))
RELAXED = posture((10, 12, 12, 15), (0, 22, 28), (0, 27, 33), (0, 30, 36), (0, 33, 36))
CURLED = posture((20, 25, 25, 30), (-3, 50, 60), (0, 55, 62), (2, 56, 62), (4, 55, 60))
FIST = posture((30, 42, 42, 50), (-5, 80, 102), (-1, 82, 102), (3, 83, 102), (8, 83, 100))
POINT = posture((28, 42, 45, 45), (0, 4, 6), (-1, 80, 102), (2, 82, 102), (6, 82, 100))
GRASP = posture((45, 20, 18, 25), (3, 42, 48), (1, 44, 48), (-1, 46, 46), (-4, 48, 44))

_TUCKED_THUMB = (32.0, 44.0, 48.0, 45.0)


def count(number: int) -> Array:
    """Return the posture (20,) that shows 0 to 5 fingers, index first and the thumb last."""
    if number == 5:
        return posture((0, 0, 0, 0), (4, 2, 3), (0, 2, 3), (-3, 2, 3), (-6, 2, 3))
    shown = [(4.0 - 3.0 * finger, 3.0, 4.0) if finger < number else _BENT for finger in range(4)]
    return posture(_TUCKED_THUMB, *shown) if number else FIST


#: Where the search for a touch starts: thumb, then the finger that it meets.
_TOUCH_START = {
    "index": ((30.0, 40.0, 12.0, 12.0), (0.0, 55.0, 40.0)),
    "middle": ((35.0, 45.0, 15.0, 15.0), (0.0, 60.0, 42.0)),
    "ring": ((35.0, 45.0, 35.0, 30.0), (2.0, 65.0, 50.0)),
    "little": ((35.0, 48.0, 50.0, 35.0), (0.0, 70.0, 55.0)),
}


def touch(hand: Hand, finger: str, others: Array) -> Array:
    """Return the posture in which the thumb's pad meets a finger's pad, on this very hand.

    Minimises the gap between the pads and the angle between them, near a natural start and inside the joint limits.

    Args:
        hand: the hand, of any shape.
        finger: ``"index"`` … ``"little"``.
        others: (20,) the posture of the fingers that stay out of it.

    Returns:
        (20,) radians.
    """
    digit = FINGERS.index(finger)
    thumb, bent = _TOUCH_START[finger]
    entries = np.array([0, 1, 2, 3, 4 * digit, 4 * digit + 1, 4 * digit + 3])
    start = np.radians(np.array([*thumb, *bent]))
    pose = hand.neutral_pose()
    pose[_PALM : _PALM + len(others)] = others

    def residuals(angles: Array) -> Array:
        pose[_PALM + entries] = angles
        posed = pose_hand(hand, pose)
        pads = []
        for tip, bone in ((4, 3), (4 * (digit + 1), 3 + 3 * digit)):
            inward = -posed.frames[bone][:, 1]  # a bone's +y is dorsal
            pads.append((posed.joints[tip] + _PAD_DEPTH * inward, inward))
        (thumb_pad, thumb_normal), (finger_pad, finger_normal) = pads
        gap = (thumb_pad - finger_pad) / _GAP_UNIT
        return np.concatenate([gap, 0.7 * (thumb_normal + finger_normal), 1.2 * (angles - start)])

    low, high = hand.limits[_PALM + entries].T
    found = least_squares(residuals, np.clip(start, low + 1e-3, high - 1e-3), bounds=(low, high), max_nfev=25)
    result = others.copy()
    result[entries] = found.x
    return result
