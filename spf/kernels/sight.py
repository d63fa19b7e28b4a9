"""What the camera sees of a posed hand, and which of it each observed pixel belongs to (spec 4)."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from spf.kernels.compiling import allocating, index, part
from spf.kernels.cost_inputs import NORMAL, ObservationArrays
from spf.kernels.golden import beyond_wrist
from spf.kernels.kinematics import Chain, Skeleton, pose_bones
from spf.kernels.render import FAR, project_skin, rasterise
from spf.kernels.skinning import Skin, carry

__all__ = ["Sight", "keep_first", "make_sight", "match_pixels", "see", "visible_vertices"]

Array = NDArray[np.float64]
Image = NDArray[np.float32]

_GRAZING = -0.05  # cosine to the line of sight under which a vertex faces the camera
_BEHIND = 0.006  # m by which a vertex may lie behind the z-buffer, which is drawn coarsely from a coarse mesh
_NEAR_ROWS = 7
_DISTANCE_BITS, _COLUMN_BITS = 18, 12  # together 31: an int32 but for its sign
_FOREARM_BEGINS = 0.01  # m past the wrist's plane: nearer pixels may still be matched with the hand
_DISAGREEMENT = 0.0002  # m² by which opposite normals set a pixel and a vertex apart, times two


class Sight(NamedTuple):
    """What is seen of one pose; made once, filled for every pose.

    Attributes:
        visible: (V,) of which the first ones are the vertices seen.
        near: (7, V) float32 of each vertex seen, for the matching: its place x from the palm's centre, its unit
            normal, and ‖x‖².
        coarse: (P, 3) float32 the projected proxy.
        depth: (h, w) float32 z-buffer.
        chosen: (V,) marks of visible vertices.
    """

    visible: NDArray[np.int32]
    near: Image
    coarse: Image
    depth: Image
    chosen: NDArray[np.uint8]


@allocating
def make_sight(vertices: int, proxy_vertices: int, height: int, width: int) -> Sight:
    """Allocate a Sight."""
    return Sight(
        np.zeros(vertices, np.int32),
        np.zeros((_NEAR_ROWS, vertices), np.float32),
        np.zeros((proxy_vertices, 3), np.float32),
        np.zeros((height, width), np.float32),
        np.zeros(vertices, np.uint8),
    )


@part
def visible_vertices(
    surface: Skin, bones: Array, translation: Array, camera: Array, depth: Image, tolerance: float,
    visible: NDArray[np.int32], near: Image,
) -> int:  # fmt: skip
    """Pose the skin, and list the vertices that the camera sees: front-facing and nearest in the z-buffer.

    Args:
        surface, bones, translation: the skin, its posed bones, the palm's place.
        camera, depth: (5,) and (h, w) of the z-buffer.
        tolerance: m by which a vertex may lie behind the z-buffer's pixel.
        visible, near: out, as of a :class:`Sight`.

    Returns:
        Number of visible vertices.
    """
    movers, shares = surface.influence_bone, surface.shares
    height, width = depth.shape
    fx, fy, cx, cy, perspective = camera[0], camera[1], camera[2], camera[3], camera[4] != 0.0
    tx, ty, tz = translation[0], translation[1], translation[2]
    count = index(0)
    for i in range(movers.shape[0]):
        px, py, pz, mx, my, mz = carry(movers, shares, bones, i)[:6]
        x, y, z = px + tx, py + ty, pz + tz
        facing, squared = mz, mx * mx + my * my + mz * mz
        long = squared
        if perspective:
            facing, long = mx * x + my * y + mz * z, squared * (x * x + y * y + z * z)
        if facing > 0.0 or facing * facing < _GRAZING * _GRAZING * long:
            continue
        inverse = 1.0 / max(z, 1e-3) if perspective else 1.0
        u, v = math.floor(x * inverse * fx + cx + 0.5), math.floor(y * inverse * fy + cy + 0.5)
        if 0 <= u < width and 0 <= v < height and z > depth[v, u] + tolerance:
            continue
        short = 1.0 / math.sqrt(squared)
        visible[count] = i
        near[0, count], near[1, count], near[2, count] = px, py, pz
        near[3, count], near[4, count], near[5, count] = mx * short, my * short, mz * short
        near[6, count] = px * px + py * py + pz * pz
        count = index(count + 1)
    return count


@part
def see(
    skeleton: Skeleton, surface: Skin, proxy: Skin, proxy_faces: NDArray[np.int32], obs: ObservationArrays,
    pose: Array, reference: Array, zbuffer: bool, chain: Chain, sight: Sight,
) -> int:  # fmt: skip
    """Pose the hand and list the vertices that the camera sees in this pose; returns their number."""
    depth = sight.depth
    pose_bones(skeleton, pose, reference, chain)
    if zbuffer:
        project_skin(proxy, chain, 1.0, pose, obs.grid_camera, sight.coarse)
        rasterise(sight.coarse, proxy_faces, depth)
    else:
        depth[:] = FAR
    return visible_vertices(surface, chain.bones, pose, obs.grid_camera, depth, _BEHIND, sight.visible, sight.near)


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


@part
def match_pixels(
    sight: Sight, count: int, obs: ObservationArrays, chain: Chain, pose: Array,
    pixels: NDArray[np.int32], radius: float, matches: NDArray[np.int32],
) -> None:  # fmt: skip
    """Match observed pixels with the nearest visible vertex; pixels of the forearm, and far ones, get -1.

    The forearm is what lies beyond the wrist's plane in a wide cone around the palm's axis. Normals that disagree make
    a vertex farther. Distances are compared in single precision.
    """
    near, bones, surface = sight.near, chain.bones, obs.surface
    wx, wy, wz = bones[0, 3], bones[0, 7], bones[0, 11]
    ax, ay, az = bones[0, 2], bones[0, 6], bones[0, 10]  # +z of the palm's frame points to the forearm
    for s in range(pixels.shape[0]):
        p = index(pixels[s])
        x, y, z = surface[p, 0] - pose[0], surface[p, 1] - pose[1], surface[p, 2] - pose[2]
        if beyond_wrist(x - wx, y - wy, z - wz, ax, ay, az, _FOREARM_BEGINS):
            matches[s] = -1
            continue
        c = _nearest(
            near, count, radius * radius, x, y, z, surface[p, NORMAL], surface[p, NORMAL + 1], surface[p, NORMAL + 2]
        )
        matches[s] = sight.visible[c] if c >= 0 else -1


@part
def _nearest(
    near: Image, count: int, limit: float, x: float, y: float, z: float, nx: float, ny: float, nz: float
) -> int:
    """Column of the vertex nearest to a pixel's place, from the palm's centre, and normal; -1 if none is within the limit.

    The distance, m², is ``‖a − x‖² + δ (1 − m·n)``, multiplied out so that all that belongs to the pixel alone is
    computed once. Distance and column go into one integer, of which the compiler finds the least in vector code (it does
    not for floats, nor for the place of the least). Vertices within limit/2¹⁸ of each other, a micrometre at 5 mm, tie;
    rounding is a tenth of that, and may make the distance of a vertex right on the pixel negative, which does no harm.
    """
    per_limit = (1 << _DISTANCE_BITS) / limit
    whole, per_square = np.float32(per_limit * (x * x + y * y + z * z + _DISAGREEMENT)), np.float32(per_limit)
    ax, ay, az = np.float32(-2.0 * per_limit * x), np.float32(-2.0 * per_limit * y), np.float32(-2.0 * per_limit * z)
    turn = -per_limit * _DISAGREEMENT
    bx, by, bz = np.float32(turn * nx), np.float32(turn * ny), np.float32(turn * nz)
    far = np.float32(1 << _DISTANCE_BITS)
    nearest, block = (1 << _DISTANCE_BITS) << _COLUMN_BITS, 0
    for start in range(0, count, 1 << _COLUMN_BITS):
        least = np.int32((1 << _DISTANCE_BITS) << _COLUMN_BITS)
        for c in range(index(start), index(min(count, start + (1 << _COLUMN_BITS)))):
            distance = whole + per_square * near[6, c] + ax * near[0, c] + ay * near[1, c] + az * near[2, c]
            distance += bx * near[3, c] + by * near[4, c] + bz * near[5, c]
            key = (np.int32(min(distance, far)) << np.int32(_COLUMN_BITS)) | np.int32(c - start)
            least = min(least, np.int32(key))
        if least < nearest:
            nearest, block = int(least), start
    if nearest >> _COLUMN_BITS >= 1 << _DISTANCE_BITS:
        return -1
    return block + (nearest & ((1 << _COLUMN_BITS) - 1))
