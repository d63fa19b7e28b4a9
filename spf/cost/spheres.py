"""Spheres inside the digits, from the mesh: what the collision term pushes apart."""

from __future__ import annotations

import numpy as np

from spf.hand.model import Hand
from spf.kernels.cost import Spheres

__all__ = ["digit_spheres"]

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
            centres.append(bind[bone, :, :3] @ middle + bind[bone, :, 3])
            radii.append(_ALLOWANCE * radius)
            digits.append((bone - 1) // 3)
    pairs = [
        (a, b)
        for a in range(len(bones))
        for b in range(a + 1, len(bones))
        if (digits[b] - digits[a] == 1 and digits[a] > 0)
        or (digits[a] == 0 and digits[b] in (1, 2, 3) and bones[a] > 1)
    ]
    return Spheres(
        np.array(bones, np.int32), np.array(centres), np.array(radii), np.array(pairs, np.int32).reshape(-1, 2)
    )
