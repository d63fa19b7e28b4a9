"""Diagonal of the Gauss-Newton Hessian of the cost: what the first step sizes are scaled by (spec 5).

``H_dd = Σ (column d of J)ᵀ H_E (column d of J)``. A point moves with the few joints above it, so its columns are summed
up the tree, bone by bone, instead of taking D products with unit vectors.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from spf.kernels.collision_term import place_spheres, touches
from spf.kernels.compiling import index, part
from spf.kernels.cost_inputs import HAND, LABEL, NORMAL, UNKNOWN, CostWeights, ObservationArrays, Spheres, Workspace
from spf.kernels.depth_term import pixel_of
from spf.kernels.kinematics import Skeleton, pose_bones
from spf.kernels.skinning import MOST_INFLUENCES, Skin, bone_share

__all__ = ["gauss_newton_diagonal"]

Array = NDArray[np.float64]


@part
def gauss_newton_diagonal(
    skeleton: Skeleton, surface: Skin, spheres: Spheres, obs: ObservationArrays, weights: CostWeights,
    prior_precision: Array, pose: Array, reference: Array,
    sample: NDArray[np.int32], pixels: NDArray[np.int32], matches: NDArray[np.int32], diagonal: Array, work: Workspace,
) -> None:  # fmt: skip
    """Diagonal (D,) of the Hessian whose products :func:`~spf.kernels.cost.cost_products` returns."""
    pose_bones(skeleton, pose, reference, work.chain)
    turns, owners = work.turns, skeleton.revolute_bone
    turns[:] = 0
    for r in range(owners.shape[0]):
        turns[index(owners[r]) + 1] += 1
    for b in range(1, turns.shape[0]):
        turns[b] += turns[b - 1]
    for d in range(diagonal.shape[0]):
        diagonal[d] = prior_precision[d]
    if sample.shape[0] > 0:
        _of_model_points(skeleton, surface, obs, weights, pose, sample, work, diagonal)
    if weights.coverage > 0.0 and pixels.shape[0] > 0:
        _of_pixels(skeleton, surface, obs, weights, pose, pixels, matches, work, diagonal)
    if weights.collision > 0.0:
        _of_spheres(skeleton, spheres, weights, work, diagonal)


@part
def _add_columns(
    parents: NDArray[np.int32], gains: Array, dofs: NDArray[np.int32], turns: NDArray[np.int32], screws: Array,
    bone: int, px: float, py: float, pz: float, w: float, nx: float, ny: float, nz: float, columns: Array,
) -> None:  # fmt: skip
    """Add what every joint above a bone does to the bone's share (P, w) of a place and N of a normal."""
    while bone > 0:
        for r in range(turns[bone], turns[bone + 1]):
            d, gain, s = index(dofs[r]), gains[r], r + 3
            ax, ay, az = gain * screws[s, 0], gain * screws[s, 1], gain * screws[s, 2]
            columns[d, 0] += ay * pz - az * py + w * gain * screws[s, 3]
            columns[d, 1] += az * px - ax * pz + w * gain * screws[s, 4]
            columns[d, 2] += ax * py - ay * px + w * gain * screws[s, 5]
            columns[d, 3] += ay * nz - az * ny
            columns[d, 4] += az * nx - ax * nz
            columns[d, 5] += ax * ny - ay * nx
        bone = index(parents[bone])
    for d in range(3):
        columns[d, d] += w
        ax, ay, az = screws[d, 0], screws[d, 1], screws[d, 2]
        columns[3 + d, 0] += ay * pz - az * py
        columns[3 + d, 1] += az * px - ax * pz
        columns[3 + d, 2] += ax * py - ay * px
        columns[3 + d, 3] += ay * nz - az * ny
        columns[3 + d, 4] += az * nx - ax * nz
        columns[3 + d, 5] += ax * ny - ay * nx


@part
def _point_columns(
    skeleton: Skeleton, surface: Skin, i: int, work: Workspace
) -> tuple[float, float, float, float, float, float]:
    """Fill the columns (D, 6) of a vertex's place and normal m; returns both, from the palm's centre."""
    parents, gains, dofs = skeleton.parent, skeleton.revolute_gain, skeleton.revolute_dof
    movers, shares, bones, screws = surface.influence_bone, surface.shares, work.chain.bones, work.chain.screws
    columns, turns = work.columns, work.turns
    columns[:] = 0.0
    x = y = z = mx = my = mz = 0.0
    for c in range(surface.influence_count[i]):
        b, k = index(movers[i, c]), MOST_INFLUENCES * i + c
        px, py, pz, nx, ny, nz = bone_share(shares, k, bones, b)
        x, y, z, mx, my, mz = x + px, y + py, z + pz, mx + nx, my + ny, mz + nz
        _add_columns(parents, gains, dofs, turns, screws, b, px, py, pz, shares[k, 3], nx, ny, nz, columns)
    return x, y, z, mx, my, mz


@part
def _of_model_points(
    skeleton: Skeleton, surface: Skin, obs: ObservationArrays, weights: CostWeights,
    pose: Array, sample: NDArray[np.int32], work: Workspace, diagonal: Array,
) -> None:  # fmt: skip
    """Add the curvature of the depth, normal and background terms."""
    columns, seen = work.columns, obs.surface
    height, width = obs.nearest.shape
    scale = weights.points / sample.shape[0]
    per_area = scale / (weights.length * weights.length)
    behind, front, pull = weights.behind, weights.front, weights.pull
    for s in range(sample.shape[0]):
        x, y, z, mx, my, mz = _point_columns(skeleton, surface, index(sample[s]), work)
        x, y, z = x + pose[0], y + pose[1], z + pose[2]
        v, u = pixel_of(obs.camera, x, y, z, height, width)
        p = index(v * width + u)
        label = seen[p, LABEL]
        if label == HAND:
            nx, ny, nz = float(seen[p, NORMAL]), float(seen[p, NORMAL + 1]), float(seen[p, NORMAL + 2])
            r = nx * (x - seen[p, 0]) + ny * (y - seen[p, 1]) + nz * (z - seen[p, 2])
            w = 1.0 / (1.0 + r * r * (front if r > 0.0 else behind))
            w = w if r > 0.0 else w * w
            short = 1.0 / math.sqrt(mx * mx + my * my + mz * mz)
            qx, qy, qz, stiff = mx * short, my * short, mz * short, scale * weights.normal * w * short * short
            for d in range(diagonal.shape[0]):
                rate = nx * columns[d, 0] + ny * columns[d, 1] + nz * columns[d, 2]
                along = qx * columns[d, 3] + qy * columns[d, 4] + qz * columns[d, 5]
                turning = columns[d, 3] ** 2 + columns[d, 4] ** 2 + columns[d, 5] ** 2 - along * along
                diagonal[d] += per_area * w * rate * rate + stiff * turning
        elif label != UNKNOWN:
            p = index(obs.nearest[v, u])
            squared = (x - seen[p, 0]) ** 2 + (y - seen[p, 1]) ** 2 + (z - seen[p, 2]) ** 2
            _add_pull(columns, weights.background * per_area / (1.0 + squared * pull), diagonal)


@part
def _add_pull(columns: Array, stiffness: float, diagonal: Array) -> None:
    """Add the curvature of a spring between two points."""
    for d in range(diagonal.shape[0]):
        diagonal[d] += stiffness * (columns[d, 0] ** 2 + columns[d, 1] ** 2 + columns[d, 2] ** 2)


@part
def _of_pixels(
    skeleton: Skeleton, surface: Skin, obs: ObservationArrays, weights: CostWeights, pose: Array,
    pixels: NDArray[np.int32], matches: NDArray[np.int32], work: Workspace, diagonal: Array,
) -> None:  # fmt: skip
    """Add the curvature of the coverage term."""
    columns, points = work.columns, obs.surface
    gain = weights.points / pixels.shape[0] * weights.coverage / (weights.length * weights.length)
    pull = weights.pull
    for s in range(pixels.shape[0]):
        if matches[s] < 0:
            continue
        x, y, z, _, _, _ = _point_columns(skeleton, surface, index(matches[s]), work)
        p = index(pixels[s])
        x, y, z = x + pose[0] - points[p, 0], y + pose[1] - points[p, 1], z + pose[2] - points[p, 2]
        _add_pull(columns, gain / (1.0 + (x * x + y * y + z * z) * pull), diagonal)


@part
def _of_spheres(skeleton: Skeleton, spheres: Spheres, weights: CostWeights, work: Workspace, diagonal: Array) -> None:
    """Add the curvature of the collision term."""
    parents, gains, dofs = skeleton.parent, skeleton.revolute_gain, skeleton.revolute_dof
    owners, radii, partners = spheres.bone, spheres.radius, spheres.partners
    screws, places, columns, turns = work.chain.screws, work.places, work.columns, work.turns
    gain = weights.points * weights.collision / (weights.length * weights.length)
    place_spheres(owners, spheres.centre, owners.shape[0], work.chain.bones, places)
    for a in range(owners.shape[0]):
        first, last = index(partners[a, 0]), index(partners[a, 1])
        if not touches(places, radii, a, first, last):
            continue
        for b in range(first, last):
            if not touches(places, radii, a, b, b + 1):
                continue
            columns[:] = 0.0
            for end in range(2):
                sign, q = (1.0, index(a)) if end == 0 else (-1.0, index(b))
                x, y, z = sign * places[0, q], sign * places[1, q], sign * places[2, q]
                _add_columns(
                    parents, gains, dofs, turns, screws, index(owners[q]), x, y, z, sign, 0.0, 0.0, 0.0, columns
                )
            dx, dy, dz = places[0, a] - places[0, b], places[1, a] - places[1, b], places[2, a] - places[2, b]
            squared = dx * dx + dy * dy + dz * dz
            for d in range(diagonal.shape[0]):
                along = dx * columns[d, 0] + dy * columns[d, 1] + dz * columns[d, 2]
                diagonal[d] += gain * along * along / squared
