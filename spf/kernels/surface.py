"""3-D points and normals of a depth map (spec 3; Fig. 2, 3)."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from spf.kernels.compiling import index, kernel, part, strict_kernel
from spf.kernels.cost_inputs import EMPTY, HAND, LABEL, NORMAL

__all__ = ["coarse_grid", "count_by_planes", "fill_holes", "foreground", "nearest_pixels", "surface_points"]

Array = NDArray[np.float64]
Image = NDArray[np.float32]
Mask = NDArray[np.uint8]
Indices = NDArray[np.int32]

_OFF_PLANE = 0.012  # m from a table or wall from which a surface is not it


@strict_kernel
def count_by_planes(points: Array, planes: Array, on: float, behind: float, counts: Array) -> None:
    """Count the points on each of some planes, and behind it.

    Args:
        points: (N, 3) m.
        planes: (T, 4) (n, d), n·X + d > 0 in front.
        on: m from the plane, either way, within which a point is on it.
        behind: m behind the plane from which a point is behind it.
        counts: (T, 2) out: points on it, points behind it.
    """
    for t in range(planes.shape[0]):
        a, b, c, d = planes[t, 0], planes[t, 1], planes[t, 2], planes[t, 3]
        near, far = 0, 0
        for i in range(points.shape[0]):
            height = a * points[i, 0] + b * points[i, 1] + c * points[i, 2] + d
            near += abs(height) < on
            far += height < -behind
        counts[t, 0], counts[t, 1] = near, far


@strict_kernel
def foreground(
    depth: Image, camera: Array, centre: Array, radius: float, plane: Array, mask: Mask
) -> tuple[int, int, int, int]:
    """Mark in ``mask`` (H, W) the pixels whose 3-D point lies in a sphere and in front of a plane.

    Args:
        depth: (H, W) m; 0 or NaN without a reading.
        camera: (5,) numbers.
        centre, radius: of the sphere, m.
        plane: (4,) (n, d), n·X + d > 0 in front of it.
        mask: (H, W) out, 0 or 1.

    Returns:
        First and last row and first and last column that are marked; the first is greater than the last if none is.
    """
    fx, fy, cx, cy, perspective = camera[0], camera[1], camera[2], camera[3], camera[4] != 0.0
    top, bottom, left, right = depth.shape[0], -1, depth.shape[1], -1
    for v in range(depth.shape[0]):
        first, last = depth.shape[1], -1
        for u in range(depth.shape[1]):
            mask[v, u] = 0
            z = float(depth[v, u])
            away = z - centre[2]
            if not (z > 0.0 and abs(away) < radius):
                continue
            reach = z if perspective else 1.0
            x, y = (u - cx) / fx * reach, (v - cy) / fy * reach
            inside = (x - centre[0]) ** 2 + (y - centre[1]) ** 2 + away * away < radius * radius
            if inside and plane[0] * x + plane[1] * y + plane[2] * z + plane[3] >= _OFF_PLANE:
                mask[v, u] = 1
                first, last = min(first, u), u
        if last >= 0:
            top, bottom = min(top, v), v
            left, right = min(left, first), max(right, last)
    return top, bottom, left, right


@strict_kernel
def fill_holes(depth: Image, mask: Mask, closed: Mask) -> None:
    """Fill pixels without a reading inside a closed mask from the median of the marked pixels around them, in place.

    A hole is filled where most of its 3×3 neighbourhood is marked.
    """
    height, width = depth.shape
    for v in range(1, height - 1):
        for u in range(1, width - 1):
            if closed[v, u] == 0 or mask[v, u] != 0 or depth[v, u] > 0.0:
                continue
            around = (
                _marked(depth, mask, v - 1, u - 1), _marked(depth, mask, v - 1, u), _marked(depth, mask, v - 1, u + 1),
                _marked(depth, mask, v, u - 1), 0.0, _marked(depth, mask, v, u + 1),
                _marked(depth, mask, v + 1, u - 1), _marked(depth, mask, v + 1, u), _marked(depth, mask, v + 1, u + 1),
            )  # fmt: skip
            median = 0.0
            for a in around:
                below = equal = 0
                for b in around:
                    below += b < a
                    equal += b == a
                if below <= 4 < below + equal:
                    median = a
            if median > 0.0:
                depth[v, u] = median
                mask[v, u] = 2  # marked, but no reading that other holes may be filled from
    for v in range(height):
        for u in range(width):
            mask[v, u] = mask[v, u] != 0


@part
def _marked(depth: Image, mask: Mask, v: int, u: int) -> float:
    """Depth of a pixel that was marked before holes were filled, else 0."""
    return float(depth[v, u]) if mask[v, u] == 1 else 0.0


@strict_kernel
def nearest_pixels(mask: Mask, region: Indices, place: Indices, pixels: Indices, nearest: Indices) -> int:
    """List the marked pixels, and for every pixel the nearest marked one.

    Args:
        mask, region: (H, W), and the label of the nearest marked pixel of every pixel (of a distance transform).
        place: (labels,) scratch.
        pixels: (H·W,) out: flat indices of the marked pixels.
        nearest: (H, W) out: flat index of the nearest marked pixel.

    Returns:
        Number of marked pixels.
    """
    height, width = mask.shape
    count = 0
    for v in range(height):
        for u in range(width):
            if mask[v, u] != 0:
                place[index(region[v, u])] = v * width + u
                pixels[count] = v * width + u
                count += 1
    for v in range(height):
        for u in range(width):
            nearest[v, u] = place[index(region[v, u])]
    return count


@strict_kernel
def coarse_grid(
    depth: Image, labels: Mask, distance: Image, camera: Array, pitch: float, ramp: float,
    grid_depth: Image, grid_labels: Mask, grid_outside: Image,
) -> int:  # fmt: skip
    """Sample depth (H, W), labels and the cost of covering a cell beside the hand to a grid (h, w).

    The cost rises from 0 to 1 over ``ramp`` metres beside the hand, measured by ``distance`` in pixels at the depth there.

    Returns:
        Number of HAND cells.
    """
    height, width = depth.shape
    count = 0
    for j in range(grid_depth.shape[0]):
        v = index(min(round(j * pitch), height - 1))
        for i in range(grid_depth.shape[1]):
            u = index(min(round(i * pitch), width - 1))
            label = labels[v, u]
            metres = distance[v, u] / camera[0] * (depth[v, u] if camera[4] != 0.0 else 1.0)
            grid_depth[j, i], grid_labels[j, i] = depth[v, u], label
            grid_outside[j, i] = min(metres / ramp, 1.0) if label == EMPTY else 0.0
            count += label == HAND
    return count


@kernel
def surface_points(depth: Image, camera: Array, labels: NDArray[np.uint8], surface: Image) -> None:
    """Back-project every pixel and take its unit normal from 3×3 Sobel differences, turned towards the camera.

    With the differences ``X_u``, ``X_v`` of the back-projected points, ``n ∝ X_v × X_u``: for an orthographic camera
    this is ``n ∝ (∂Z/∂x, ∂Z/∂y, −1)``.

    Args:
        depth: (H, W) m, without gaps: pixels beside the hand hold the depth of the nearest hand pixel.
        camera: (5,) numbers.
        labels: (H, W).
        surface: (H·W, SURFACE_COLUMNS) out: place, normal and label of every pixel.
    """
    height, width = depth.shape
    fx, fy, cx, cy, perspective = camera[0], camera[1], camera[2], camera[3], camera[4] != 0.0
    for v in range(height):
        up, down = index(max(v - 1, 0)), index(min(v + 1, height - 1))
        for u in range(width):
            left, right = index(max(u - 1, 0)), index(min(u + 1, width - 1))
            z = float(depth[v, u])
            zu = depth[up, right] - depth[up, left] + depth[down, right] - depth[down, left]
            zu = (zu + 2.0 * (depth[v, right] - depth[v, left])) / 8.0
            zv = depth[down, left] - depth[up, left] + depth[down, right] - depth[up, right]
            zv = (zv + 2.0 * (depth[down, u] - depth[up, u])) / 8.0
            a, b = (u - cx) / fx, (v - cy) / fy
            if perspective:
                x, y = a * z, b * z
                ux, uy, vx, vy = z / fx + a * zu, b * zu, a * zv, z / fy + b * zv
            else:
                x, y = a, b
                ux, uy, vx, vy = 1.0 / fx, 0.0, 0.0, 1.0 / fy
            nx, ny, nz = vy * zu - zv * uy, zv * ux - vx * zu, vx * uy - vy * ux
            short = 1.0 / math.sqrt(nx * nx + ny * ny + nz * nz)
            p = index(v * width + u)
            surface[p, 0], surface[p, 1], surface[p, 2] = x, y, z
            surface[p, NORMAL], surface[p, NORMAL + 1], surface[p, NORMAL + 2] = nx * short, ny * short, nz * short
            surface[p, LABEL] = labels[v, u]
