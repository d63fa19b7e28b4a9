"""What the camera sees of a posed hand, and which of it each observed pixel belongs to (spec 4)."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from spf.kernels.compiling import allocating, index, kernel, part
from spf.kernels.cost_inputs import NORMAL, ObservationArrays
from spf.kernels.golden import beyond_wrist
from spf.kernels.kinematics import Chain, Skeleton, pose_bones
from spf.kernels.render import FAR, project_skin, rasterise
from spf.kernels.skinning import Skin, skin

__all__ = ["Sight", "keep_first", "make_sight", "match_pixels", "see", "visible_vertices"]

Array = NDArray[np.float64]
Image = NDArray[np.float32]

_GRAZING = -0.05  # cosine to the line of sight under which a vertex faces the camera
_BEHIND = 0.006  # m by which a vertex may lie behind the z-buffer, which is drawn coarsely from a coarse mesh
_DISTANCE_BITS, _COLUMN_BITS = 18, 12  # together 31: an int32 but for its sign
_FOREARM_BEGINS = 0.01  # m past the wrist's plane: nearer pixels may still be matched with the hand
_DISAGREEMENT = 0.0002  # m² by which opposite normals set a pixel and a vertex apart, times two


class Sight(NamedTuple):
    """What is seen of one pose; made once, filled for every pose.

    Attributes:
        points, normals: (V, 3) the posed skin, camera frame.
        visible: (V,) of which the first ones are the vertices seen.
        near: (6, V) float32 place and normal of the visible vertices, for the matching.
        coarse: (P, 3) float32 the projected proxy.
        depth: (h, w) float32 z-buffer.
        chosen: (V,) marks of visible vertices.
    """

    points: Array
    normals: Array
    visible: NDArray[np.int32]
    near: Image
    coarse: Image
    depth: Image
    chosen: NDArray[np.uint8]


@allocating
def make_sight(vertices: int, proxy_vertices: int, height: int, width: int) -> Sight:
    """Allocate a Sight."""
    return Sight(
        np.zeros((vertices, 3)),
        np.zeros((vertices, 3)),
        np.zeros(vertices, np.int32),
        np.zeros((6, vertices), np.float32),
        np.zeros((proxy_vertices, 3), np.float32),
        np.zeros((height, width), np.float32),
        np.zeros(vertices, np.uint8),
    )


@part
def visible_vertices(
    points: Array, normals: Array, camera: Array, depth: Image, tolerance: float, visible: NDArray[np.int32]
) -> int:
    """List the vertices that the camera sees: front-facing and nearest in the z-buffer.

    Args:
        points, normals: (V, 3) camera frame.
        camera, depth: (5,) and (h, w) of the z-buffer.
        tolerance: m by which a vertex may lie behind the z-buffer's pixel.
        visible: (V,) out.

    Returns:
        Number of visible vertices.
    """
    height, width = depth.shape
    fx, fy, cx, cy, perspective = camera[0], camera[1], camera[2], camera[3], camera[4] != 0.0
    count = 0
    for i in range(points.shape[0]):
        x, y, z = points[i, 0], points[i, 1], points[i, 2]
        facing, length = normals[i, 2], 1.0
        if perspective:
            facing = normals[i, 0] * x + normals[i, 1] * y + normals[i, 2] * z
            length = math.sqrt(x * x + y * y + z * z)
        if facing > _GRAZING * length:
            continue
        inverse = 1.0 / max(z, 1e-3) if perspective else 1.0
        u, v = math.floor(x * inverse * fx + cx + 0.5), math.floor(y * inverse * fy + cy + 0.5)
        if 0 <= u < width and 0 <= v < height and z > depth[v, u] + tolerance:
            continue
        visible[count] = i
        count += 1
    return count


@kernel
def see(
    skeleton: Skeleton, surface: Skin, proxy: Skin, proxy_faces: NDArray[np.int32], obs: ObservationArrays,
    pose: Array, reference: Array, zbuffer: bool, chain: Chain, sight: Sight,
) -> int:  # fmt: skip
    """Pose the skin and list the vertices that the camera sees in this pose; returns their number."""
    points, normals, visible, near, depth = sight.points, sight.normals, sight.visible, sight.near, sight.depth
    pose_bones(skeleton, pose, reference, chain)
    skin(surface, chain, pose, points, normals)
    if zbuffer:
        project_skin(proxy, chain, 1.0, pose, obs.grid_camera, sight.coarse)
        rasterise(sight.coarse, proxy_faces, depth)
    else:
        depth[:] = FAR
    count = visible_vertices(points, normals, obs.grid_camera, depth, _BEHIND, visible)
    for c in range(count):
        i = index(visible[c])
        near[0, c], near[1, c], near[2, c] = points[i, 0], points[i, 1], points[i, 2]
        near[3, c], near[4, c], near[5, c] = normals[i, 0], normals[i, 1], normals[i, 2]
    return count


@part
def keep_first(sight: Sight, count: int, order: NDArray[np.int32], most: int) -> int:
    """Keep of the visible vertices the first ones in an order (V,) of all vertices, at most so many; returns how many.

    The same order gives similar poses nearly the same vertices: what they are compared on is common to all particles.
    """
    visible, chosen = sight.visible, sight.chosen
    for c in range(count):
        chosen[index(visible[c])] = 1
    kept = 0
    for o in range(order.shape[0]):
        i = index(order[o])
        if chosen[i] == 1:
            chosen[i] = 0
            if kept < most:
                visible[kept] = order[o]
                kept += 1
    return kept


@kernel
def match_pixels(
    sight: Sight, count: int, obs: ObservationArrays, chain: Chain, pose: Array,
    pixels: NDArray[np.int32], radius: float, matches: NDArray[np.int32],
) -> None:  # fmt: skip
    """Match observed pixels with the nearest visible vertex; pixels of the forearm, and far ones, get -1.

    The forearm is what lies beyond the wrist's plane in a wide cone around the palm's axis. Normals that disagree make
    a vertex farther. Distances are compared in single precision.
    """
    near, bones, surface = sight.near, chain.bones, obs.surface
    wx, wy, wz = bones[0, 3] + pose[0], bones[0, 7] + pose[1], bones[0, 11] + pose[2]
    ax, ay, az = bones[0, 2], bones[0, 6], bones[0, 10]  # +z of the palm's frame points to the forearm
    for s in range(pixels.shape[0]):
        p = index(pixels[s])
        x, y, z = surface[p, 0], surface[p, 1], surface[p, 2]
        if beyond_wrist(x - wx, y - wy, z - wz, ax, ay, az, _FOREARM_BEGINS):
            matches[s] = -1
            continue
        c = _nearest(
            near, count, np.float32(radius * radius),
            x, y, z, surface[p, NORMAL], surface[p, NORMAL + 1], surface[p, NORMAL + 2],
        )  # fmt: skip
        matches[s] = sight.visible[c] if c >= 0 else -1


@part
def _nearest(
    near: Image, count: int, limit: float, x: float, y: float, z: float, nx: float, ny: float, nz: float
) -> int:
    """Column of the nearest vertex, -1 if none is within the limit (m²).

    Distance and column go into one integer, of which the compiler finds the least in vector code (it does not for
    floats, nor for the place of the least). Vertices within limit/2¹⁸ of each other, a micrometre at 5 mm, tie.
    """
    apart, one = np.float32(_DISAGREEMENT), np.float32(1.0)
    per_limit = np.float32(1 << _DISTANCE_BITS) / limit
    far = np.float32(1 << _DISTANCE_BITS)
    nearest, block = (1 << _DISTANCE_BITS) << _COLUMN_BITS, 0
    for start in range(0, count, 1 << _COLUMN_BITS):
        least = np.int32((1 << _DISTANCE_BITS) << _COLUMN_BITS)
        for c in range(index(start), index(min(count, start + (1 << _COLUMN_BITS)))):
            dx, dy, dz = near[0, c] - x, near[1, c] - y, near[2, c] - z
            agree = near[3, c] * nx + near[4, c] * ny + near[5, c] * nz
            distance = dx * dx + dy * dy + dz * dz + apart * (one - agree)
            key = (np.int32(min(distance * per_limit, far)) << np.int32(_COLUMN_BITS)) | np.int32(c - start)
            least = min(least, np.int32(key))
        if least < nearest:
            nearest, block = int(least), start
    if nearest >> _COLUMN_BITS >= 1 << _DISTANCE_BITS:
        return -1
    return block + (nearest & ((1 << _COLUMN_BITS) - 1))
