"""Spheres inside the digits, from the mesh: what the collision term pushes apart."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from spf.hand.model import Hand
from spf.kernels.cost import Spheres

__all__ = ["digit_spheres", "scaled_spheres"]

_PER_BONE = 3
_ALLOWANCE = 0.85  # skin is soft: spheres are a little smaller than the digit


def digit_spheres(hand: Hand) -> Spheres:
    """Place three spheres along each digit bone with the median radius of its skin.

    The pairs are those of neighbouring digits, and of the thumb with index, middle and ring.
    """
    bind, skin = hand.skeleton.bind, hand.skin
    bones, centres, radii, digits = [], [], [], []
    for bone in range(1, len(bind)):
        own = skin.vertices[skin.influence_bone[:, 0] == bone]
        local = (own - bind[bone, :, 3]) @ bind[bone, :, :3]
        axis = local[:, 2]  # the bone points along -z
        for step in range(_PER_BONE):
            place = (step + 0.5) / _PER_BONE * min(axis.min(), -0.01)
            near = np.abs(axis - place) < 0.006
            ring = local[near] if near.sum() >= 4 else local
            middle = np.array([*(0.5 * (ring[:, :2].min(axis=0) + ring[:, :2].max(axis=0))), place])
            radius = float(np.median(np.linalg.norm(ring[:, :2] - middle[:2], axis=1)))
            bones.append(bone)
            centres.append(middle)
            radii.append(_ALLOWANCE * radius)
            digits.append((bone - 1) // 3)
    digit = np.array(digits)
    partners = [_partners(digit, own, metacarpal=bone == 1) for own, bone in zip(digits, bones, strict=True)]
    return Spheres(np.array(bones, np.int32), np.array(centres), np.array(radii), np.array(partners, np.int32))


def scaled_spheres(spheres: Spheres, factor: float) -> Spheres:
    """Return the spheres of a hand enlarged by a factor."""
    return spheres._replace(centre=spheres.centre * factor, radius=spheres.radius * factor)


def _partners(digit: NDArray[np.int_], own: int, *, metacarpal: bool) -> tuple[int, int]:
    """Range of the spheres that one of digit ``own`` can meet; the thumb's metacarpal is part of the palm."""
    if metacarpal or own == digit.max():
        return 0, 0
    met = np.flatnonzero((digit >= 1) & (digit <= 3) if own == 0 else digit == own + 1)
    return int(met[0]), int(met[-1]) + 1
