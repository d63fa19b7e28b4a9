"""Linear blend skinning of points and normals, and its derivative products (spec 2; eq. 1, 2, 14, 22).

A vertex is kept in the frame of every bone that moves it, times its weight there: with ``T = [R | o]`` of the bone,

    x̂ = Σ R (w l) + w o          n̂ = m/‖m‖,  m = Σ R (w n)

so that no skinning matrices are needed. A bone's share ``P = R (w l) + w o`` of the place and ``M = R (w n)`` of the
normal also carry both derivative products: ``ω × P + w ν`` and ``ω × M`` for a twist, torque ``P × u + M × g`` and
force ``w u`` for forces u on the place and g on m.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from spf.kernels.compiling import index, kernel, part
from spf.kernels.kinematics import BONE_COLUMNS, GRADIENT, PRODUCT, TWIST, Chain

__all__ = [
    "MOST_INFLUENCES",
    "SHARE_COLUMNS",
    "Skin",
    "bone_share",
    "carry",
    "push",
    "skin",
    "skin_forces",
    "skin_velocities",
]

Array = NDArray[np.float64]
Six = tuple[float, float, float, float, float, float]

MOST_INFLUENCES = 4
SHARE_COLUMNS = 8  # w l (3), w, w n (3), whether another bone follows: one cache line


class Skin(NamedTuple):
    """Points that bones move, as flat arrays: V points, at most 4 influences a point.

    Attributes:
        vertices, normals: (V, 3) bind pose, model frame.
        influence_count: (V,) number of bones that move a vertex.
        influence_bone, influence_weight: (V, 4) which, and how much, strongest first.
        shares: (4 V, SHARE_COLUMNS) row 4 i + c: vertex i and its normal in the frame of its bone c, times the weight;
            the last column is 1 where another bone follows, else 0. Loops end there rather than at a count, because
            the compiler would make slow vector code of a countable loop over one to four bones.
    """

    vertices: Array
    normals: Array
    influence_count: NDArray[np.int32]
    influence_bone: NDArray[np.int32]
    influence_weight: Array
    shares: Array


@part
def bone_share(shares: Array, k: int, bones: Array, b: int) -> Six:
    """A bone's share of a vertex: of its place P, and of its normal M before normalisation."""
    x, y, z, w = shares[k, 0], shares[k, 1], shares[k, 2], shares[k, 3]
    nx, ny, nz = shares[k, 4], shares[k, 5], shares[k, 6]
    return (
        bones[b, 0] * x + bones[b, 1] * y + bones[b, 2] * z + bones[b, 3] * w,
        bones[b, 4] * x + bones[b, 5] * y + bones[b, 6] * z + bones[b, 7] * w,
        bones[b, 8] * x + bones[b, 9] * y + bones[b, 10] * z + bones[b, 11] * w,
        bones[b, 0] * nx + bones[b, 1] * ny + bones[b, 2] * nz,
        bones[b, 4] * nx + bones[b, 5] * ny + bones[b, 6] * nz,
        bones[b, 8] * nx + bones[b, 9] * ny + bones[b, 10] * nz,
    )


@part
def carry(
    movers: NDArray[np.int32], shares: Array, bones: Array, i: int
) -> tuple[float, float, float, float, float, float, float, float, float, float, float, float]:
    """Place x, normal m (not normalised), and their velocities for the bones' twists, of vertex i.

    What the caller does not use is not computed: the compiler sees through.
    """
    x = y = z = mx = my = mz = 0.0
    dx = dy = dz = ex = ey = ez = 0.0
    c, follows = index(0), 1.0
    while follows > 0.0:
        b, k = index(movers[i, c]), MOST_INFLUENCES * i + c
        follows, c = shares[k, 7], index(c + 1)
        px, py, pz, nx, ny, nz = bone_share(shares, k, bones, b)
        w, ax, ay, az = shares[k, 3], bones[b, TWIST], bones[b, TWIST + 1], bones[b, TWIST + 2]
        x, y, z, mx, my, mz = x + px, y + py, z + pz, mx + nx, my + ny, mz + nz
        dx += ay * pz - az * py + w * bones[b, TWIST + 3]
        dy += az * px - ax * pz + w * bones[b, TWIST + 4]
        dz += ax * py - ay * px + w * bones[b, TWIST + 5]
        ex += ay * nz - az * ny
        ey += az * nx - ax * nz
        ez += ax * ny - ay * nx
    return x, y, z, mx, my, mz, dx, dy, dz, ex, ey, ez


@part
def push(
    movers: NDArray[np.int32], shares: Array, bones: Array, i: int,
    ux: float, uy: float, uz: float, gx: float, gy: float, gz: float,
    vx: float, vy: float, vz: float, hx: float, hy: float, hz: float,
) -> None:  # fmt: skip
    """Add forces on vertex i to both wrenches of its bones: (u, v) on the place, (g, h) on the normal m."""
    c, follows = index(0), 1.0
    while follows > 0.0:
        b, k = index(movers[i, c]), MOST_INFLUENCES * i + c
        follows, c = shares[k, 7], index(c + 1)
        px, py, pz, nx, ny, nz = bone_share(shares, k, bones, b)
        w = shares[k, 3]
        bones[b, GRADIENT] += py * uz - pz * uy + ny * gz - nz * gy
        bones[b, GRADIENT + 1] += pz * ux - px * uz + nz * gx - nx * gz
        bones[b, GRADIENT + 2] += px * uy - py * ux + nx * gy - ny * gx
        bones[b, GRADIENT + 3] += w * ux
        bones[b, GRADIENT + 4] += w * uy
        bones[b, GRADIENT + 5] += w * uz
        bones[b, PRODUCT] += py * vz - pz * vy + ny * hz - nz * hy
        bones[b, PRODUCT + 1] += pz * vx - px * vz + nz * hx - nx * hz
        bones[b, PRODUCT + 2] += px * vy - py * vx + nx * hy - ny * hx
        bones[b, PRODUCT + 3] += w * vx
        bones[b, PRODUCT + 4] += w * vy
        bones[b, PRODUCT + 5] += w * vz


@part
def skin(surface: Skin, chain: Chain, translation: Array, points: Array, normals: Array) -> None:
    """Pose all vertices and unit normals (1, 2): (V, 3) each, camera frame."""
    movers, shares, bones = surface.influence_bone, surface.shares, chain.bones
    for i in range(movers.shape[0]):
        x, y, z, mx, my, mz = carry(movers, shares, bones, i)[:6]
        scale = 1.0 / math.sqrt(mx * mx + my * my + mz * mz)
        points[i, 0], points[i, 1], points[i, 2] = x + translation[0], y + translation[1], z + translation[2]
        normals[i, 0], normals[i, 1], normals[i, 2] = mx * scale, my * scale, mz * scale


@kernel
def skin_velocities(surface: Skin, chain: Chain, translation: Array, point_rates: Array, normal_rates: Array) -> None:
    """Velocities (V, 3) of all places and unit normals, for the bones' twists and the palm's translation."""
    movers, shares, bones = surface.influence_bone, surface.shares, chain.bones
    for i in range(movers.shape[0]):
        _, _, _, mx, my, mz, dx, dy, dz, ex, ey, ez = carry(movers, shares, bones, i)
        short = 1.0 / math.sqrt(mx * mx + my * my + mz * mz)
        along = (mx * ex + my * ey + mz * ez) * short * short
        point_rates[i, 0], point_rates[i, 1], point_rates[i, 2] = (
            dx + translation[0], dy + translation[1], dz + translation[2],
        )  # fmt: skip
        normal_rates[i, 0] = (ex - along * mx) * short
        normal_rates[i, 1] = (ey - along * my) * short
        normal_rates[i, 2] = (ez - along * mz) * short


@kernel
def skin_forces(surface: Skin, chain: Chain, point_forces: Array, normal_forces: Array) -> None:
    """Gather forces (V, 3) on all places and unit normals into the bones' first wrench; both are cleared before."""
    movers, shares, bones = surface.influence_bone, surface.shares, chain.bones
    for b in range(bones.shape[0]):
        for i in range(GRADIENT, BONE_COLUMNS):
            bones[b, i] = 0.0
    for i in range(movers.shape[0]):
        mx, my, mz = carry(movers, shares, bones, i)[3:6]
        short = 1.0 / math.sqrt(mx * mx + my * my + mz * mz)
        gx, gy, gz = normal_forces[i, 0], normal_forces[i, 1], normal_forces[i, 2]
        along = (mx * gx + my * gy + mz * gz) * short * short
        push(
            movers, shares, bones, i,
            point_forces[i, 0], point_forces[i, 1], point_forces[i, 2],
            (gx - along * mx) * short, (gy - along * my) * short, (gz - along * mz) * short,
            0.0, 0.0, 0.0, 0.0, 0.0, 0.0,
        )  # fmt: skip
