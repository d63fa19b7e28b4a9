"""Depth, normal and background terms: model points against the surface that the camera saw (spec 4; eq. 3, 5, 12, 13).

    depth      Σ_S ½ ρ(n·(x̂ − X₀))/ℓ² + ½ k w ‖n̂ − n‖²          model point → tangent plane of its pixel
    background Σ_S ½ b ρ(‖x̂ − X_nearest‖)/ℓ²                      model point beside the hand

ρ is Geman-McClure behind the observed surface, where a model point may merely be hidden, and Cauchy in front of it,
where it stands in free space. w is the depth's weight ρ', held fixed like the tangent plane.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from spf.kernels.compiling import index, part
from spf.kernels.cost_inputs import HAND, LABEL, NORMAL, UNKNOWN, CostWeights, ObservationArrays
from spf.kernels.robust import cauchy_sum, multiply
from spf.kernels.skinning import Skin, carry, push

__all__ = ["depth_term"]

Array = NDArray[np.float64]


@part
def pixel_of(camera: Array, x: float, y: float, z: float, height: int, width: int) -> tuple[int, int]:
    """Row and column of the pixel that a point projects to, the nearest one for a point outside the image."""
    inverse = 1.0 / max(z, 1e-3) if camera[4] != 0.0 else 1.0
    u = min(max(int(x * inverse * camera[0] + camera[2] + 0.5), 0), width - 1)
    v = min(max(int(y * inverse * camera[1] + camera[3] + 0.5), 0), height - 1)
    return index(v), index(u)


@part
def depth_term(
    surface: Skin, obs: ObservationArrays, weights: CostWeights,
    pose: Array, direction: Array, sample: NDArray[np.int32], bones: Array,
) -> float:  # fmt: skip
    """Energy of the sampled model points; adds their wrenches to those of the bones."""
    movers, shares = surface.influence_bone, surface.shares
    camera, seen, nearest = obs.camera, obs.surface, obs.nearest
    height, width = nearest.shape
    scale = weights.points / max(sample.shape[0], 1)
    per_area, stiffness = scale / (weights.length * weights.length), scale * weights.normal
    behind, front, pull = weights.behind, weights.front, weights.pull
    loss = losses = bends = pulls = logarithm = pull_logarithm = 0.0
    product = pull_product = 1.0
    tx, ty, tz, sx, sy, sz = pose[0], pose[1], pose[2], direction[0], direction[1], direction[2]
    for s in range(sample.shape[0]):
        i = index(sample[s])
        x, y, z, mx, my, mz, dx, dy, dz, ex, ey, ez = carry(movers, shares, bones, i)
        x, y, z, dx, dy, dz = x + tx, y + ty, z + tz, dx + sx, dy + sy, dz + sz
        v, u = pixel_of(camera, x, y, z, height, width)
        p = index(v * width + u)
        label = seen[p, LABEL]
        if label == HAND:
            nx, ny, nz = float(seen[p, NORMAL]), float(seen[p, NORMAL + 1]), float(seen[p, NORMAL + 2])
            r = nx * (x - seen[p, 0]) + ny * (y - seen[p, 1]) + nz * (z - seen[p, 2])
            # n points to the camera: r > 0 is in front of the surface
            before, squared = r > 0.0, r * r
            factor = 1.0 + squared * (front if before else behind)
            w = 1.0 / factor
            losses += squared if before else 0.0
            loss += 0.0 if before else squared * w
            product, logarithm = multiply(factor if before else 1.0, product, logarithm)
            w = w if before else w * w
            f, h = per_area * w * r, per_area * w * (nx * dx + ny * dy + nz * dz)
            # the normal: q = m/‖m‖, and its derivative (I − q qᵀ)/‖m‖
            short = 1.0 / math.sqrt(mx * mx + my * my + mz * mz)
            qx, qy, qz = mx * short, my * short, mz * short
            stiff = stiffness * w
            ax, ay, az = qx - nx, qy - ny, qz - nz
            bends += stiff * (ax * ax + ay * ay + az * az)
            along, turning = qx * ax + qy * ay + qz * az, qx * ex + qy * ey + qz * ez
            gain, turn = stiff * short, stiff * short * short
            push(
                movers, shares, bones, i,
                f * nx, f * ny, f * nz, gain * (ax - along * qx), gain * (ay - along * qy), gain * (az - along * qz),
                h * nx, h * ny, h * nz,
                turn * (ex - turning * qx), turn * (ey - turning * qy), turn * (ez - turning * qz),
            )  # fmt: skip
        elif label != UNKNOWN:
            p = index(nearest[v, u])
            ax, ay, az = x - seen[p, 0], y - seen[p, 1], z - seen[p, 2]
            squared = ax * ax + ay * ay + az * az
            factor = 1.0 + squared * pull
            pulls += squared
            pull_product, pull_logarithm = multiply(factor, pull_product, pull_logarithm)
            f = weights.background * per_area / factor
            push(
                movers, shares, bones, i,
                f * ax, f * ay, f * az, 0.0, 0.0, 0.0, f * dx, f * dy, f * dz, 0.0, 0.0, 0.0,
            )  # fmt: skip
    loss += cauchy_sum(front, product, logarithm, losses)
    pulls = cauchy_sum(pull, pull_product, pull_logarithm, pulls)
    return 0.5 * (per_area * (loss + weights.background * pulls) + bends)
