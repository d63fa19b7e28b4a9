"""The cost E(p) with its gradient and Gauss-Newton product, all terms in one pass (spec 4; eq. 3-14, 22).

Everything is evaluated at one pose for a sample of model points and a sample of observed pixels, with correspondences
and tangent planes held fixed, as the paper does (eq. 7-11). ``ρ`` is Geman-McClure behind the observed surface, where a
model point may merely be hidden, and Cauchy in front of it, where it stands in free space.

    depth      Σ_S ½ ρ(n·(x̂ − X₀))/ℓ² + ½ k w ‖n̂ − n‖²          model point → tangent plane of its pixel (3, 5)
    background Σ_S ½ b ρ(‖x̂ − X_nearest‖)/ℓ²                      model point beside the hand
    coverage   Σ_D ½ c ρ(‖x̂_match − X‖)/ℓ²                        observed pixel → nearest visible model point
    collision  Σ_pairs ½ q (r_i + r_j − ‖x_i − x_j‖)₊²/ℓ²         spheres inside the digits
    prior      ½ (p − p̄)ᵀ diag(π) (p − p̄)                        pull to the prediction
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from spf.kernels.kinematics import bone_twists, joint_gradient, pose_bones, skinning_matrices, skinning_velocities

__all__ = ["CostWeights", "ObservationArrays", "Spheres", "Workspace", "allocate", "cost_products", "place"]

Array = NDArray[np.float64]
_HAND, _UNKNOWN = 1, 2


class ObservationArrays(NamedTuple):
    """An observation as flat arrays: a crop of H×W pixels and a coarse grid of h×w cells.

    Attributes:
        camera: (5,) fx, fy, cx, cy, perspective flag of the crop.
        points, normals: (H·W, 3) m and unit, camera frame; meaningful where the label is HAND.
        labels: (H, W) uint8 EMPTY, HAND or UNKNOWN.
        nearest: (H, W) int32 flat index of the nearest HAND pixel.
        pixels: (M,) int32 flat indices of the HAND pixels.
        grid_camera: (5,) camera of the coarse grid.
        grid_depth: (h, w) float32 m.
        grid_labels: (h, w) uint8.
        grid_outside: (h, w) float32 cost of covering a cell beside the hand.
        grid_count: number of HAND cells.
    """

    camera: Array
    points: Array
    normals: Array
    labels: NDArray[np.uint8]
    nearest: NDArray[np.int32]
    pixels: NDArray[np.int32]
    grid_camera: Array
    grid_depth: NDArray[np.float32]
    grid_labels: NDArray[np.uint8]
    grid_outside: NDArray[np.float32]
    grid_count: int


class CostWeights(NamedTuple):
    """Weights of the terms; lengths in metres.

    Attributes:
        points: nominal number of sample points |S|: sums are scaled to it whatever the sample.
        length: ℓ, which makes E dimensionless.
        normal: k.
        behind, front, pull: robust scales of a point behind, in front of, and beside the surface; inf switches it off.
        background: b.
        coverage: c, relative to the depth term.
        collision: q.
    """

    points: float
    length: float
    normal: float
    behind: float
    front: float
    pull: float
    background: float
    coverage: float
    collision: float


class Spheres(NamedTuple):
    """Spheres inside the digits, for the collision term.

    Attributes:
        bone: (Q,) bone that carries the sphere.
        centre: (Q, 3) m, bind pose, model frame.
        radius: (Q,) m.
        pairs: (P, 2) spheres of different digits that can meet.
    """

    bone: NDArray[np.int32]
    centre: Array
    radius: Array
    pairs: NDArray[np.int32]


class Workspace(NamedTuple):
    """Scratch of one evaluation; one per thread."""

    frames: Array
    axes: Array
    matrices: Array
    twists: Array
    rates: Array
    both: Array
    blend: Array
    outer: Array
    gathered: Array
    gathered_gradient: Array
    gathered_product: Array
    wrenches: Array
    sphere_places: Array
    sphere_rates: Array


@njit(cache=True, nogil=True)
def allocate(bones, revolutes, spheres):
    """Allocate a Workspace."""
    return Workspace(
        np.empty((bones, 3, 4)),
        np.empty((3 + revolutes, 3)),
        np.empty((bones, 3, 4)),
        np.empty((bones, 6)),
        np.empty((bones, 3, 4)),
        np.empty((bones, 24)),
        np.empty(24),
        np.empty(24),
        np.empty((bones, 24)),
        np.empty((bones, 3, 4)),
        np.empty((bones, 3, 4)),
        np.empty((bones, 6)),
        np.empty((spheres, 3)),
        np.empty((spheres, 3)),
    )


@njit(cache=True, nogil=True, fastmath=True, inline="always")
def _geman_mcclure(squared, scale):
    """ρ and ρ'/r of ρ(r) = r²/(1 + r²/s²)."""
    w = 1.0 / (1.0 + squared / (scale * scale))
    return squared * w, w * w


@njit(cache=True, nogil=True, fastmath=True, inline="always")
def _cauchy(squared, scale):
    """ρ and ρ'/r of ρ(r) = s² ln(1 + r²/s²)."""
    if scale > 1e6:
        return squared, 1.0
    ratio = squared / (scale * scale)
    return scale * scale * math.log(1.0 + ratio), 1.0 / (1.0 + ratio)


@njit(cache=True, nogil=True, fastmath=True)
def place(skeleton, pose, reference, direction, work):
    """Set the skeleton to a pose and to a velocity of the pose: the tree part of every term."""
    pose_bones(skeleton, pose, reference, work.frames, work.axes)
    skinning_matrices(skeleton, work.frames, work.matrices)
    bone_twists(skeleton, work.frames, work.axes, direction, work.twists)
    skinning_velocities(work.matrices, work.twists, work.rates)
    for bone in range(work.matrices.shape[0]):
        for i in range(3):
            for j in range(4):
                work.both[bone, 4 * i + j] = work.matrices[bone, i, j]
                work.both[bone, 12 + 4 * i + j] = work.rates[bone, i, j]
    work.gathered[:] = 0.0


@njit(cache=True, nogil=True, fastmath=True, inline="always")
def _blend(surface, i, work):
    """Blend [S | Ṡ] at point i."""
    blend, both = work.blend, work.both
    w, bone = surface.influence_weight[i, 0], surface.influence_bone[i, 0]
    for j in range(24):
        blend[j] = w * both[bone, j]
    for c in range(1, surface.influence_count[i]):
        w, bone = surface.influence_weight[i, c], surface.influence_bone[i, c]
        for j in range(24):
            blend[j] += w * both[bone, j]


@njit(cache=True, nogil=True, fastmath=True, inline="always")
def _scatter(surface, i, work):
    """Gather [∂E/∂S | product] of point i into its bones."""
    outer, gathered = work.outer, work.gathered
    for c in range(surface.influence_count[i]):
        w, bone = surface.influence_weight[i, c], surface.influence_bone[i, c]
        for j in range(24):
            gathered[bone, j] += w * outer[j]


@njit(cache=True, nogil=True, fastmath=True)
def _depth_term(surface, obs, weights, translation, shift, sample, scale, work):
    """Depth, normal and background terms of the sampled model points; returns their energy."""
    blend, outer = work.blend, work.outer
    height, width = obs.labels.shape
    fx, fy, cx, cy, perspective = obs.camera[0], obs.camera[1], obs.camera[2], obs.camera[3], obs.camera[4] != 0.0
    per_area = scale / (weights.length * weights.length)
    tx, ty, tz = translation[0], translation[1], translation[2]
    energy = 0.0
    for s in range(sample.shape[0]):
        i = sample[s]
        _blend(surface, i, work)
        vx, vy, vz = surface.vertices[i, 0], surface.vertices[i, 1], surface.vertices[i, 2]
        x = blend[0] * vx + blend[1] * vy + blend[2] * vz + blend[3] + tx
        y = blend[4] * vx + blend[5] * vy + blend[6] * vz + blend[7] + ty
        z = blend[8] * vx + blend[9] * vy + blend[10] * vz + blend[11] + tz
        inverse = 1.0 / max(z, 1e-3) if perspective else 1.0
        u = min(max(int(x * inverse * fx + cx + 0.5), 0), width - 1)
        v = min(max(int(y * inverse * fy + cy + 0.5), 0), height - 1)
        label = obs.labels[v, u]
        if label == _UNKNOWN:
            continue
        dx = blend[12] * vx + blend[13] * vy + blend[14] * vz + blend[15] + shift[0]
        dy = blend[16] * vx + blend[17] * vy + blend[18] * vz + blend[19] + shift[1]
        dz = blend[20] * vx + blend[21] * vy + blend[22] * vz + blend[23] + shift[2]
        if label == _HAND:
            pixel = v * width + u
            nx, ny, nz = obs.normals[pixel, 0], obs.normals[pixel, 1], obs.normals[pixel, 2]
            r = nx * (x - obs.points[pixel, 0]) + ny * (y - obs.points[pixel, 1]) + nz * (z - obs.points[pixel, 2])
            # n points to the camera: r > 0 is in front of the surface
            loss, w = _cauchy(r * r, weights.front) if r > 0.0 else _geman_mcclure(r * r, weights.behind)
            energy += 0.5 * per_area * loss
            f = per_area * w * r
            h = per_area * w * (nx * dx + ny * dy + nz * dz)
            fx_, fy_, fz_ = f * nx, f * ny, f * nz
            hx, hy, hz = h * nx, h * ny, h * nz
            # normals
            bx, by, bz = surface.normals[i, 0], surface.normals[i, 1], surface.normals[i, 2]
            qx = blend[0] * bx + blend[1] * by + blend[2] * bz
            qy = blend[4] * bx + blend[5] * by + blend[6] * bz
            qz = blend[8] * bx + blend[9] * by + blend[10] * bz
            short = 1.0 / math.sqrt(qx * qx + qy * qy + qz * qz)
            qx, qy, qz = qx * short, qy * short, qz * short
            ex, ey, ez = qx - nx, qy - ny, qz - nz
            stiff = scale * weights.normal * w
            energy += 0.5 * stiff * (ex * ex + ey * ey + ez * ez)
            rx = (blend[12] * bx + blend[13] * by + blend[14] * bz) * short
            ry = (blend[16] * bx + blend[17] * by + blend[18] * bz) * short
            rz = (blend[20] * bx + blend[21] * by + blend[22] * bz) * short
            along = qx * rx + qy * ry + qz * rz
            rx, ry, rz = rx - along * qx, ry - along * qy, rz - along * qz
            along = qx * ex + qy * ey + qz * ez
            gain = stiff * short
            gx, gy, gz = gain * (ex - along * qx), gain * (ey - along * qy), gain * (ez - along * qz)
            px, py, pz = gain * rx, gain * ry, gain * rz
            outer[0], outer[1], outer[2], outer[3] = fx_ * vx + gx * bx, fx_ * vy + gx * by, fx_ * vz + gx * bz, fx_
            outer[4], outer[5], outer[6], outer[7] = fy_ * vx + gy * bx, fy_ * vy + gy * by, fy_ * vz + gy * bz, fy_
            outer[8], outer[9], outer[10], outer[11] = fz_ * vx + gz * bx, fz_ * vy + gz * by, fz_ * vz + gz * bz, fz_
            outer[12], outer[13], outer[14], outer[15] = hx * vx + px * bx, hx * vy + px * by, hx * vz + px * bz, hx
            outer[16], outer[17], outer[18], outer[19] = hy * vx + py * bx, hy * vy + py * by, hy * vz + py * bz, hy
            outer[20], outer[21], outer[22], outer[23] = hz * vx + pz * bx, hz * vy + pz * by, hz * vz + pz * bz, hz
        else:
            pixel = obs.nearest[v, u]
            ex, ey, ez = x - obs.points[pixel, 0], y - obs.points[pixel, 1], z - obs.points[pixel, 2]
            loss, w = _cauchy(ex * ex + ey * ey + ez * ez, weights.pull)
            energy += 0.5 * weights.background * per_area * loss
            f = weights.background * per_area * w
            _point_outer(outer, f * ex, f * ey, f * ez, f * dx, f * dy, f * dz, vx, vy, vz)
        _scatter(surface, i, work)
    return energy


@njit(cache=True, nogil=True, fastmath=True, inline="always")
def _point_outer(outer, fx, fy, fz, hx, hy, hz, vx, vy, vz):
    """[f [v; 1]ᵀ | h [v; 1]ᵀ]."""
    outer[0], outer[1], outer[2], outer[3] = fx * vx, fx * vy, fx * vz, fx
    outer[4], outer[5], outer[6], outer[7] = fy * vx, fy * vy, fy * vz, fy
    outer[8], outer[9], outer[10], outer[11] = fz * vx, fz * vy, fz * vz, fz
    outer[12], outer[13], outer[14], outer[15] = hx * vx, hx * vy, hx * vz, hx
    outer[16], outer[17], outer[18], outer[19] = hy * vx, hy * vy, hy * vz, hy
    outer[20], outer[21], outer[22], outer[23] = hz * vx, hz * vy, hz * vz, hz


@njit(cache=True, nogil=True, fastmath=True)
def _coverage_term(surface, obs, weights, translation, shift, pixels, matches, scale, work):
    """Observed pixels to their matched model points; a match of -1 (forearm, nothing visible) counts nothing."""
    blend, outer = work.blend, work.outer
    gain = scale * weights.coverage / (weights.length * weights.length)
    energy = 0.0
    for s in range(pixels.shape[0]):
        i = matches[s]
        if i < 0:
            continue
        pixel = pixels[s]
        _blend(surface, i, work)
        vx, vy, vz = surface.vertices[i, 0], surface.vertices[i, 1], surface.vertices[i, 2]
        ex = blend[0] * vx + blend[1] * vy + blend[2] * vz + blend[3] + translation[0] - obs.points[pixel, 0]
        ey = blend[4] * vx + blend[5] * vy + blend[6] * vz + blend[7] + translation[1] - obs.points[pixel, 1]
        ez = blend[8] * vx + blend[9] * vy + blend[10] * vz + blend[11] + translation[2] - obs.points[pixel, 2]
        dx = blend[12] * vx + blend[13] * vy + blend[14] * vz + blend[15] + shift[0]
        dy = blend[16] * vx + blend[17] * vy + blend[18] * vz + blend[19] + shift[1]
        dz = blend[20] * vx + blend[21] * vy + blend[22] * vz + blend[23] + shift[2]
        loss, w = _cauchy(ex * ex + ey * ey + ez * ez, weights.pull)
        energy += 0.5 * gain * loss
        f = gain * w
        _point_outer(outer, f * ex, f * ey, f * ez, f * dx, f * dy, f * dz, vx, vy, vz)
        _scatter(surface, i, work)
    return energy


@njit(cache=True, nogil=True, fastmath=True)
def _collision_term(spheres, weights, work):
    """Spheres of different digits that overlap push each other apart."""
    both, gathered = work.both, work.gathered
    places, rates = work.sphere_places, work.sphere_rates
    for q in range(spheres.bone.shape[0]):
        bone = spheres.bone[q]
        vx, vy, vz = spheres.centre[q, 0], spheres.centre[q, 1], spheres.centre[q, 2]
        for i in range(3):
            places[q, i] = (
                both[bone, 4 * i] * vx + both[bone, 4 * i + 1] * vy + both[bone, 4 * i + 2] * vz + both[bone, 4 * i + 3]
            )
            rates[q, i] = (
                both[bone, 12 + 4 * i] * vx
                + both[bone, 13 + 4 * i] * vy
                + both[bone, 14 + 4 * i] * vz
                + both[bone, 15 + 4 * i]
            )
    gain = weights.points * weights.collision / (weights.length * weights.length)
    energy = 0.0
    for pair in range(spheres.pairs.shape[0]):
        a, b = spheres.pairs[pair, 0], spheres.pairs[pair, 1]
        reach = spheres.radius[a] + spheres.radius[b]
        dx, dy, dz = places[a, 0] - places[b, 0], places[a, 1] - places[b, 1], places[a, 2] - places[b, 2]
        squared = dx * dx + dy * dy + dz * dz
        if squared >= reach * reach or squared < 1e-10:
            continue
        distance = math.sqrt(squared)
        dx, dy, dz = dx / distance, dy / distance, dz / distance
        overlap = reach - distance
        energy += 0.5 * gain * overlap * overlap
        rate = dx * (rates[a, 0] - rates[b, 0]) + dy * (rates[a, 1] - rates[b, 1]) + dz * (rates[a, 2] - rates[b, 2])
        for end in range(2):
            q = a if end == 0 else b
            sign = 1.0 if end == 0 else -1.0
            f, h = -sign * gain * overlap, sign * gain * rate
            vx, vy, vz = spheres.centre[q, 0], spheres.centre[q, 1], spheres.centre[q, 2]
            _point_outer(work.outer, f * dx, f * dy, f * dz, h * dx, h * dy, h * dz, vx, vy, vz)
            for j in range(24):
                gathered[spheres.bone[q], j] += work.outer[j]
    return energy


@njit(cache=True, nogil=True, fastmath=True)
def cost_products(
    skeleton, surface, spheres, obs, weights, prior, prior_precision,
    pose, reference, sample, pixels, matches, direction, gradient, product, work,
):  # fmt: skip
    """E(p), its gradient (14) and its Gauss-Newton product with a direction (22).

    Args:
        sample: (m,) int32 model points, visible ones.
        pixels, matches: (n,) int32 observed pixels and their model points.
        prior, prior_precision: (D,) p̄ and π.
        direction: (D,) v.
        gradient, product: (D,) out.

    Returns:
        E.
    """
    gradient[:] = 0.0
    product[:] = 0.0
    place(skeleton, pose, reference, direction, work)
    energy = 0.0
    if sample.shape[0] > 0:
        scale = weights.points / sample.shape[0]
        energy += _depth_term(surface, obs, weights, pose[:3], direction[:3], sample, scale, work)
    if weights.coverage > 0.0 and pixels.shape[0] > 0:
        scale = weights.points / pixels.shape[0]
        energy += _coverage_term(surface, obs, weights, pose[:3], direction[:3], pixels, matches, scale, work)
    if weights.collision > 0.0:
        energy += _collision_term(spheres, weights, work)
    for bone in range(work.gathered.shape[0]):
        for i in range(3):
            for j in range(4):
                work.gathered_gradient[bone, i, j] = work.gathered[bone, 4 * i + j]
                work.gathered_product[bone, i, j] = work.gathered[bone, 12 + 4 * i + j]
    joint_gradient(skeleton, work.frames, work.axes, work.matrices, work.gathered_gradient, work.wrenches, gradient)
    joint_gradient(skeleton, work.frames, work.axes, work.matrices, work.gathered_product, work.wrenches, product)
    for d in range(pose.shape[0]):
        away = pose[d] - prior[d]
        energy += 0.5 * prior_precision[d] * away * away
        gradient[d] += prior_precision[d] * away
        product[d] += prior_precision[d] * direction[d]
    return energy
