"""Depth rendering of the posed mesh, visibility of its vertices, and the comparison with an observed depth map.

A core primitive: the same z-buffer screens proposals, tells which vertices the camera sees, weighs particles and makes
synthetic sessions. Cameras are passed as five numbers ``(fx, fy, cx, cy, perspective)``; pixel centres are integers.
"""

from __future__ import annotations

import math

import numpy as np

from spf.kernels.compiling import allocating, part
from spf.kernels.cost_inputs import EMPTY, HAND, UNKNOWN
from spf.kernels.kinematics import make_chain, pose_bones
from spf.kernels.skinning import carry

__all__ = [
    "EMPTY",
    "FAR",
    "HAND",
    "UNKNOWN",
    "beyond_wrist",
    "compare_depth",
    "golden_energies",
    "project_skin",
    "project_vertices",
    "rasterise",
    "visible_vertices",
]

FAR = np.float32(1e9)  # depth of a pixel that nothing covers

FOREARM_RADIUS, FOREARM_TAPER = 0.032, 0.09  # m, of an adult's arm at the wrist, and its growth per metre up the arm
FOREARM_COST = 0.15


@part
def project_vertices(points, camera, projected):
    """Project (V, 3) points to (V, 3) float32 (u, v, z)."""
    fx, fy, cx, cy, perspective = camera[0], camera[1], camera[2], camera[3], camera[4] != 0.0
    for i in range(points.shape[0]):
        z = points[i, 2]
        scale = 1.0 / max(z, 1e-3) if perspective else 1.0
        projected[i, 0] = points[i, 0] * scale * fx + cx
        projected[i, 1] = points[i, 1] * scale * fy + cy
        projected[i, 2] = z


@part
def project_skin(surface, chain, scale, translation, camera, projected):
    """Pose, enlarge and project a skin's vertices in one go, to (V, 3) float32 (u, v, z)."""
    movers, shares, bones = surface.influence_bone, surface.shares, chain.bones
    fx, fy, cx, cy, perspective = camera[0], camera[1], camera[2], camera[3], camera[4] != 0.0
    for i in range(movers.shape[0]):
        x, y, z = carry(movers, shares, bones, i)[:3]
        x, y, z = scale * x + translation[0], scale * y + translation[1], scale * z + translation[2]
        inverse = 1.0 / max(z, 1e-3) if perspective else 1.0
        projected[i, 0] = x * inverse * fx + cx
        projected[i, 1] = y * inverse * fy + cy
        projected[i, 2] = z


@part
def rasterise(projected, faces, depth):
    """Draw the front faces of a closed mesh into a z-buffer (H, W) float32, which is cleared to FAR first.

    Depth is interpolated linearly over a triangle (in the image), which for triangles of a few millimetres differs from
    perspective interpolation by micrometres.
    """
    height, width = depth.shape
    depth[:] = FAR
    for f in range(faces.shape[0]):
        a, b, c = faces[f, 0], faces[f, 1], faces[f, 2]
        ua, va = projected[a, 0], projected[a, 1]
        ub, vb = projected[b, 0], projected[b, 1]
        uc, vc = projected[c, 0], projected[c, 1]
        area = (ub - ua) * (vc - va) - (vb - va) * (uc - ua)
        if area >= 0.0:  # y points down: the outward side of a front face turns the other way
            continue
        left = max(0, math.ceil(min(ua, ub, uc)))
        right = min(width - 1, math.floor(max(ua, ub, uc)))
        if left > right:
            continue
        top = max(0, math.ceil(min(va, vb, vc)))
        bottom = min(height - 1, math.floor(max(va, vb, vc)))
        if top > bottom:
            continue
        inverse = np.float32(1.0) / area
        za, zb, zc = projected[a, 2], projected[b, 2], projected[c, 2]
        for v in range(top, bottom + 1):
            for u in range(left, right + 1):
                wb = ((u - ua) * (vc - va) - (v - va) * (uc - ua)) * inverse
                wc = ((ub - ua) * (v - va) - (vb - va) * (u - ua)) * inverse
                if wb >= 0.0 and wc >= 0.0 and wb + wc <= 1.0:
                    z = za + wb * (zb - za) + wc * (zc - za)
                    if z < depth[v, u] and z > 0.0:
                        depth[v, u] = z


@part
def visible_vertices(points, normals, projected, depth, tolerance, perspective, visible):
    """List the vertices that the camera sees: front-facing and nearest in the z-buffer.

    Args:
        tolerance: m by which a vertex may lie behind the z-buffer's pixel.
        visible: (V,) int32 out.

    Returns:
        Number of visible vertices.
    """
    height, width = depth.shape
    count = 0
    for i in range(points.shape[0]):
        if perspective:
            facing = normals[i, 0] * points[i, 0] + normals[i, 1] * points[i, 1] + normals[i, 2] * points[i, 2]
            facing /= math.sqrt(points[i, 0] ** 2 + points[i, 1] ** 2 + points[i, 2] ** 2)
        else:
            facing = normals[i, 2]
        if facing > -0.05:
            continue
        u, v = round(projected[i, 0]), round(projected[i, 1])
        if 0 <= u < width and 0 <= v < height and projected[i, 2] > depth[v, u] + tolerance:
            continue
        visible[count] = i
        count += 1
    return count


@part
def beyond_wrist(dx, dy, dz, ax, ay, az):
    """Whether a point at (dx, dy, dz) from the wrist is forearm: past the wrist's plane, in a wide cone around the arm.

    (ax, ay, az) is the palm's axis towards the arm. The cone leaves room for a bent wrist.
    """
    along = dx * ax + dy * ay + dz * az
    if along < -0.004:
        return False
    across = math.sqrt(max(dx * dx + dy * dy + dz * dz - along * along, 0.0))
    return across < 0.045 + 1.2 * along


@part
def _forearm_axis(rendered, observed, labels, camera, wrist, axis):
    """Number of uncovered hand pixels beyond the wrist, and the direction to the middle of them."""
    fx, fy, cx, cy, perspective = camera[0], camera[1], camera[2], camera[3], camera[4] != 0.0
    count, sx, sy, sz = 0, 0.0, 0.0, 0.0
    for v in range(rendered.shape[0]):
        for u in range(rendered.shape[1]):
            if labels[v, u] == HAND and rendered[v, u] > 1e8:
                z = observed[v, u]
                reach = z if perspective else 1.0
                dx, dy, dz = (u - cx) / fx * reach - wrist[0], (v - cy) / fy * reach - wrist[1], z - wrist[2]
                if beyond_wrist(dx, dy, dz, axis[0], axis[1], axis[2]):
                    count += 1
                    sx += dx
                    sy += dy
                    sz += dz
    length = max(math.sqrt(sx * sx + sy * sy + sz * sz), 1e-12)
    return count, sx / length, sy / length, sz / length


@part
def compare_depth(rendered, observed, labels, outside, camera, wrist, axis, scale, truncation):
    """Golden energy: how differently a rendered depth map explains an observed one, 0 (same) to 1.

    Over the overlap ``min(d², T²)/T²``; 1 for every hand pixel that the model leaves uncovered; ``outside`` (0-1) for every
    pixel that the model covers beside the hand; divided by the number of pixels of the union. Pixels labelled UNKNOWN
    count nothing. Uncovered pixels beyond the wrist that lie in one cone as wide as an arm are the forearm and count
    FOREARM_COST each: a spread hand is no forearm.

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
    fx, fy, cx, cy, perspective = camera[0], camera[1], camera[2], camera[3], camera[4] != 0.0
    forearm, ax, ay, az = _forearm_axis(rendered, observed, labels, camera, wrist, axis)
    inverse = 1.0 / (truncation * truncation)
    total, union, both = 0.0, 0, 0
    for v in range(rendered.shape[0]):
        for u in range(rendered.shape[1]):
            z, label = rendered[v, u], labels[v, u]
            if label == HAND:
                seen = observed[v, u]
                if z < 1e8:
                    d = z - seen
                    total += min(d * d * inverse, 1.0)
                    both += 1
                    union += 1
                else:
                    if forearm > 0:
                        reach = seen if perspective else 1.0
                        dx, dy, dz = (u - cx) / fx * reach - wrist[0], (v - cy) / fy * reach - wrist[1], seen - wrist[2]
                        if beyond_wrist(dx, dy, dz, axis[0], axis[1], axis[2]):
                            along = dx * ax + dy * ay + dz * az
                            radius = FOREARM_RADIUS * scale + FOREARM_TAPER * max(along, 0.0)
                            if dx * dx + dy * dy + dz * dz - along * along < radius * radius:
                                total += FOREARM_COST
                                continue
                    total += 1.0
                    union += 1
            elif label == EMPTY and z < 1e8:
                total += outside[v, u]
                union += 1
    return total / max(union, 1), both / max(union, 1)


@allocating
def golden_energies(skeleton, proxy, faces, obs, poses, scales, reference, truncation, energies, overlaps):
    """Golden energy and silhouette overlap of many poses (N, D) of the hand enlarged by scales (N,), into (N,) arrays.

    The part of the model that falls outside the grid adds its share of the vertices.
    """
    chain = make_chain(skeleton.parent.shape[0], skeleton.revolute_bone.shape[0])
    wrist, axis = np.empty(3), np.empty(3)
    projected = np.empty((proxy.vertices.shape[0], 3), np.float32)
    height, width = obs.grid_depth.shape
    depth = np.empty((height, width), np.float32)
    for n in range(poses.shape[0]):
        pose_bones(skeleton, poses[n], reference, chain)
        project_skin(proxy, chain, scales[n], poses[n], obs.grid_camera, projected)
        rasterise(projected, faces, depth)
        lost = 0
        for i in range(projected.shape[0]):
            if not (0.0 <= projected[i, 0] < width and 0.0 <= projected[i, 1] < height):
                lost += 1
        for i in range(3):
            wrist[i], axis[i] = scales[n] * chain.bones[0, 4 * i + 3] + poses[n, i], chain.bones[0, 4 * i + 2]
        golden, overlap = compare_depth(
            depth, obs.grid_depth, obs.grid_labels, obs.grid_outside, obs.grid_camera,
            wrist, axis, scales[n], truncation,
        )  # fmt: skip
        energies[n] = golden + lost / projected.shape[0]
        overlaps[n] = overlap
