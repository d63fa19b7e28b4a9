"""The rendered comparison: how well a drawn depth map of the hand explains the observed one ("golden energy").

It looks at every cell of a coarse grid, so it sees what the sampled cost does not: fingers that explain no surface, and
surface that no finger explains.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from spf.kernels.compiling import allocating, index, kernel, part
from spf.kernels.cost_inputs import EMPTY, HAND, ObservationArrays
from spf.kernels.kinematics import Chain, Skeleton, make_chain, pose_bones
from spf.kernels.render import project_skin, rasterise
from spf.kernels.skinning import Skin

__all__ = ["FOREARM_COST", "FOREARM_RADIUS", "beyond_wrist", "compare_depth", "golden_energies", "make_canvas"]

Array = NDArray[np.float64]
Image = NDArray[np.float32]

FOREARM_RADIUS, FOREARM_TAPER = 0.032, 0.09  # m, of an adult's arm at the wrist, and its growth per metre up the arm
FOREARM_COST = 0.15
_FOREARM_BEGINS = -0.004  # m past the wrist's plane; the proxy ends at the plane
_ZERO = np.float32(0.0)
_DRAWN = np.float32(1e8)  # a depth under it is drawn, not FAR


@part
def beyond_wrist(dx: float, dy: float, dz: float, ax: float, ay: float, az: float, least: float) -> bool:
    """Whether a point at (dx, dy, dz) from the wrist is forearm: past the wrist's plane, in a wide cone.

    (ax, ay, az) is the palm's axis towards the arm, ``least`` how far past the plane the forearm begins, m. The cone
    leaves room for a bent wrist.
    """
    along = dx * ax + dy * ay + dz * az
    if along < least:
        return False
    across = math.sqrt(max(dx * dx + dy * dy + dz * dz - along * along, 0.0))
    return across < 0.045 + 1.2 * along


@part
def compare_depth(
    rendered: Image, observed: Image, labels: NDArray[np.uint8], outside: Image, camera: Array,
    wrist: Array, axis: Array, scale: float, truncation: float,
) -> tuple[float, float]:  # fmt: skip
    """Golden energy: how differently a rendered depth map explains an observed one, 0 (same) to 1.

    Over the overlap ``min(d², T²)/T²``; 1 for every hand pixel that the model leaves uncovered; ``outside`` (0-1) for
    every pixel that the model covers beside the hand; divided by the number of pixels of the union. Pixels labelled
    UNKNOWN count nothing. Uncovered pixels beyond the wrist that lie in one cone as wide as an arm are the forearm and
    count FOREARM_COST each: a spread hand is no forearm.

    Args:
        rendered, observed: (H, W) float32 depths, m.
        labels: (H, W) uint8 EMPTY, HAND or UNKNOWN.
        outside: (H, W) float32 cost of covering a pixel beside the hand.
        camera: (5,) of the depth maps.
        wrist, axis: (3,) the wrist, m, and the palm's axis towards the arm.
        scale: of the hand, for the width of the arm.
        truncation: T, m.

    Returns:
        (golden energy, intersection over union of the silhouettes).
    """
    inverse, one = np.float32(1.0 / (truncation * truncation)), np.float32(1.0)
    total, both, beside, missed = 0.0, 0, 0, 0
    first, last = rendered.shape[0], 0  # rows with missed cells
    for v in range(rendered.shape[0]):
        # no branches and no doubles, so that the compiler makes vector code of the row
        row, row_both, row_beside, row_missed = _ZERO, np.int32(0), np.int32(0), np.int32(0)
        for u in range(rendered.shape[1]):
            z, d = rendered[v, u], rendered[v, u] - observed[v, u]
            drawn, hand, empty = z < _DRAWN, labels[v, u] == HAND, labels[v, u] == EMPTY
            apart, outer = min(d * d * inverse, one), outside[v, u]
            row += (apart if hand else (outer if empty else _ZERO)) if drawn else _ZERO
            row_both += np.int32(drawn & hand)
            row_beside += np.int32(drawn & empty)
            row_missed += np.int32(hand & (not drawn))
        total, both, beside, missed = (
            total + float(row),
            both + int(row_both),
            beside + int(row_beside),
            missed + int(row_missed),
        )
        if row_missed > 0:
            first, last = min(first, v), v + 1
    forearm = _forearm_cells(rendered, observed, labels, camera, wrist, axis, FOREARM_RADIUS * scale, first, last)
    missed -= forearm
    total += missed + FOREARM_COST * forearm
    union = both + beside + missed
    return total / max(union, 1), both / max(union, 1)


@part
def _forearm_cells(
    rendered: Image, observed: Image, labels: NDArray[np.uint8], camera: Array,
    wrist: Array, axis: Array, radius: float, first: int, last: int,
) -> int:  # fmt: skip
    """Number of uncovered hand cells beyond the wrist that lie in an arm's cone about the direction to their middle."""
    sx = sy = sz = 0.0
    count = 0
    for turn in range(2):
        length = max(math.sqrt(sx * sx + sy * sy + sz * sz), 1e-12)
        ax, ay, az = sx / length, sy / length, sz / length
        for v in range(index(first), index(last)):
            for u in range(rendered.shape[1]):
                if labels[v, u] != HAND or rendered[v, u] < _DRAWN:
                    continue
                z = observed[v, u]
                reach = z if camera[4] != 0.0 else 1.0
                dx = (u - camera[2]) / camera[0] * reach - wrist[0]
                dy = (v - camera[3]) / camera[1] * reach - wrist[1]
                dz = z - wrist[2]
                if not beyond_wrist(dx, dy, dz, axis[0], axis[1], axis[2], _FOREARM_BEGINS):
                    continue
                if turn == 0:
                    sx, sy, sz = sx + dx, sy + dy, sz + dz
                else:
                    along = dx * ax + dy * ay + dz * az
                    wide = radius + FOREARM_TAPER * max(along, 0.0)
                    count += dx * dx + dy * dy + dz * dz - along * along < wide * wide
        if sx == 0.0 and sy == 0.0 and sz == 0.0:
            break
    return count


class Canvas(NamedTuple):
    """What a hand is drawn on; made once, filled for every pose.

    Attributes:
        chain: the posed bones.
        projected: (P, 3) float32 the projected proxy.
        depth: (h, w) float32 z-buffer.
        wrist, axis: (3,) the wrist, m, and the palm's axis towards the arm.
    """

    chain: Chain
    projected: Image
    depth: Image
    wrist: Array
    axis: Array


@allocating
def make_canvas(bones: int, revolutes: int, vertices: int, height: int, width: int) -> Canvas:
    """Allocate a Canvas."""
    return Canvas(
        make_chain(bones, revolutes),
        np.zeros((vertices, 3), np.float32),
        np.zeros((height, width), np.float32),
        np.zeros(3),
        np.zeros(3),
    )


@kernel
def golden_energies(
    skeleton: Skeleton, proxy: Skin, faces: NDArray[np.int32], obs: ObservationArrays, poses: Array, scales: Array,
    reference: Array, truncation: float, canvas: Canvas, energies: Array, overlaps: Array,
) -> None:  # fmt: skip
    """Golden energy and silhouette overlap of many poses (N, D) of the hand enlarged by scales (N,), into (N,) arrays.

    The part of the model that falls outside the grid adds its share of the vertices.
    """
    chain, projected, depth, wrist, axis = canvas.chain, canvas.projected, canvas.depth, canvas.wrist, canvas.axis
    height, width = depth.shape
    for n in range(poses.shape[0]):
        pose_bones(skeleton, poses[n], reference, chain)
        project_skin(proxy, chain, scales[n], poses[n], obs.grid_camera, projected)
        rasterise(projected, faces, depth)
        lost = 0
        for i in range(projected.shape[0]):
            inside = 0.0 <= projected[i, 0] < width and 0.0 <= projected[i, 1] < height
            lost += 0 if inside else 1
        for i in range(3):
            wrist[i], axis[i] = scales[n] * chain.bones[0, 4 * i + 3] + poses[n, i], chain.bones[0, 4 * i + 2]
        golden, overlap = compare_depth(
            depth, obs.grid_depth, obs.grid_labels, obs.grid_outside, obs.grid_camera,
            wrist, axis, scales[n], truncation,
        )  # fmt: skip
        energies[n] = golden + lost / projected.shape[0]
        overlaps[n] = overlap
