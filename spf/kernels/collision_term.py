"""Collision term: spheres of different digits that overlap push each other apart (spec 4).

collision  Σ_pairs ½ q |S| (r_i + r_j − ‖x_i − x_j‖)₊²/ℓ²
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from spf.kernels.compiling import index, part
from spf.kernels.cost_inputs import CostWeights, Spheres
from spf.kernels.kinematics import GRADIENT, PRODUCT, TWIST

__all__ = ["collision_term", "place_spheres", "touches"]

Array = NDArray[np.float64]
_SAME_PLACE = 1e-10  # m²: no direction to push in


@part
def place_spheres(owners: NDArray[np.int32], centres: Array, size: int, bones: Array, places: Array) -> None:
    """Set the places (3, Q) of the first ``size`` spheres, from the palm's centre."""
    for q in range(size):
        b, x, y, z = index(owners[q]), centres[q, 0], centres[q, 1], centres[q, 2]
        places[0, q] = bones[b, 0] * x + bones[b, 1] * y + bones[b, 2] * z + bones[b, 3]
        places[1, q] = bones[b, 4] * x + bones[b, 5] * y + bones[b, 6] * z + bones[b, 7]
        places[2, q] = bones[b, 8] * x + bones[b, 9] * y + bones[b, 10] * z + bones[b, 11]


@part
def touches(places: Array, radii: Array, a: int, first: int, last: int) -> bool:
    """Whether a sphere overlaps any of a range of others; a loop that the compiler vectorises."""
    x, y, z, r = places[0, a], places[1, a], places[2, a], radii[a]
    hits = 0
    for b in range(first, last):
        dx, dy, dz, reach = x - places[0, b], y - places[1, b], z - places[2, b], r + radii[b]
        hits += dx * dx + dy * dy + dz * dz < reach * reach
    return hits > 0


@part
def collision_term(spheres: Spheres, weights: CostWeights, bones: Array, places: Array) -> float:
    """Energy of all overlaps; adds their wrenches to those of the bones."""
    owners, radii, partners = spheres.bone, spheres.radius, spheres.partners
    gain = weights.points * weights.collision / (weights.length * weights.length)
    size = owners.shape[0] if weights.collision > 0.0 else 0
    place_spheres(owners, spheres.centre, size, bones, places)
    energy = 0.0
    for a in range(size):
        first, last = index(partners[a, 0]), index(partners[a, 1])
        if not touches(places, radii, a, first, last):
            continue
        for b in range(first, last):
            dx, dy, dz = places[0, a] - places[0, b], places[1, a] - places[1, b], places[2, a] - places[2, b]
            squared, reach = dx * dx + dy * dy + dz * dz, radii[a] + radii[b]
            if squared >= reach * reach or squared < _SAME_PLACE:
                continue
            distance = math.sqrt(squared)
            dx, dy, dz, overlap = dx / distance, dy / distance, dz / distance, reach - distance
            energy += overlap * overlap
            bone_a, bone_b = index(owners[a]), index(owners[b])
            rate = _approach(bones, bone_a, places, a, dx, dy, dz) - _approach(bones, bone_b, places, b, dx, dy, dz)
            _push_along(bones, bone_a, places, a, dx, dy, dz, -gain * overlap, gain * rate)
            _push_along(bones, bone_b, places, b, dx, dy, dz, gain * overlap, -gain * rate)
    return 0.5 * gain * energy


@part
def _approach(bones: Array, b: int, places: Array, q: int, dx: float, dy: float, dz: float) -> float:
    """Velocity of a sphere along a direction."""
    x, y, z = places[0, q], places[1, q], places[2, q]
    ax, ay, az = bones[b, TWIST], bones[b, TWIST + 1], bones[b, TWIST + 2]
    vx = ay * z - az * y + bones[b, TWIST + 3]
    vy = az * x - ax * z + bones[b, TWIST + 4]
    vz = ax * y - ay * x + bones[b, TWIST + 5]
    return dx * vx + dy * vy + dz * vz


@part
def _push_along(
    bones: Array, b: int, places: Array, q: int, dx: float, dy: float, dz: float, force: float, product: float
) -> None:
    """Add forces along a direction at a sphere's centre to both wrenches of its bone."""
    x, y, z = places[0, q], places[1, q], places[2, q]
    wrench = (y * dz - z * dy, z * dx - x * dz, x * dy - y * dx, dx, dy, dz)
    for i in range(6):
        bones[b, GRADIENT + i] += force * wrench[i]
        bones[b, PRODUCT + i] += product * wrench[i]
