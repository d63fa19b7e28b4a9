"""3-D points and normals of a depth map (spec 3; Fig. 2, 3)."""

from __future__ import annotations

import math

from spf.kernels.compiling import strict_kernel

__all__ = ["depth_in_sphere", "surface_points"]


@strict_kernel
def depth_in_sphere(depth, camera, centre, radius, mask):
    """Mark in ``mask`` (H, W) uint8 the pixels whose 3-D point lies in a sphere; camera as five numbers."""
    fx, fy, cx, cy, perspective = camera[0], camera[1], camera[2], camera[3], camera[4] != 0.0
    for v in range(depth.shape[0]):
        for u in range(depth.shape[1]):
            z = depth[v, u]
            mask[v, u] = 0
            if z > 0.0:
                reach = z if perspective else 1.0
                x, y = (u - cx) * reach / fx - centre[0], (v - cy) * reach / fy - centre[1]
                if x * x + y * y + (z - centre[2]) ** 2 < radius * radius:
                    mask[v, u] = 1


@strict_kernel
def surface_points(depth, camera, points, normals):
    """Back-project every pixel and take its unit normal from 3×3 Sobel differences, turned towards the camera.

    With the differences ``X_u``, ``X_v`` of the back-projected points, ``n ∝ X_v × X_u``: for an orthographic camera
    this is ``n ∝ (∂Z/∂x, ∂Z/∂y, −1)``.

    Args:
        depth: (H, W) float32 m, without gaps: pixels beside the hand hold the depth of the nearest hand pixel.
        points, normals: (H·W, 3) out.
    """
    height, width = depth.shape
    fx, fy, cx, cy, perspective = camera[0], camera[1], camera[2], camera[3], camera[4] != 0.0
    for v in range(height):
        up, down = max(v - 1, 0), min(v + 1, height - 1)
        for u in range(width):
            left, right = max(u - 1, 0), min(u + 1, width - 1)
            z = float(depth[v, u])
            zu = (
                (depth[up, right] - depth[up, left])
                + 2.0 * (depth[v, right] - depth[v, left])
                + (depth[down, right] - depth[down, left])
            ) / 8.0
            zv = (
                (depth[down, left] - depth[up, left])
                + 2.0 * (depth[down, u] - depth[up, u])
                + (depth[down, right] - depth[up, right])
            ) / 8.0
            p = v * width + u
            a, b = (u - cx) / fx, (v - cy) / fy
            if perspective:
                points[p, 0], points[p, 1], points[p, 2] = a * z, b * z, z
                ux, uy, uz = z / fx + a * zu, b * zu, zu
                vx, vy, vz = a * zv, z / fy + b * zv, zv
            else:
                points[p, 0], points[p, 1], points[p, 2] = a, b, z
                ux, uy, uz = 1.0 / fx, 0.0, zu
                vx, vy, vz = 0.0, 1.0 / fy, zv
            nx, ny, nz = vy * uz - vz * uy, vz * ux - vx * uz, vx * uy - vy * ux
            length = math.sqrt(nx * nx + ny * ny + nz * nz)
            if length > 0.0:
                normals[p, 0], normals[p, 1], normals[p, 2] = nx / length, ny / length, nz / length
            else:
                normals[p, 0], normals[p, 1], normals[p, 2] = 0.0, 0.0, -1.0
