"""Depth rendering of the posed mesh: projection and a z-buffer.

A core primitive: the same z-buffer screens proposals, tells which vertices the camera sees, weighs particles and makes
synthetic sessions. Cameras are passed as five numbers ``(fx, fy, cx, cy, perspective)``; pixel centres are integers.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from spf.kernels.compiling import index, part
from spf.kernels.kinematics import Chain
from spf.kernels.skinning import Skin, carry

__all__ = ["FAR", "project_skin", "project_vertices", "rasterise"]

Array = NDArray[np.float64]
Image = NDArray[np.float32]

FAR = np.float32(1e9)  # depth of a pixel that nothing covers

_ZERO, _ONE = np.float32(0.0), np.float32(1.0)
_EDGE = np.float32(1e-4)  # by which triangles overlap, of their size: no pixel between two is left out


@part
def project_vertices(points: Array, camera: Array, projected: Image) -> None:
    """Project (V, 3) points to (V, 3) float32 (u, v, z)."""
    fx, fy, cx, cy, perspective = camera[0], camera[1], camera[2], camera[3], camera[4] != 0.0
    for i in range(points.shape[0]):
        z = points[i, 2]
        scale = 1.0 / max(z, 1e-3) if perspective else 1.0
        projected[i, 0] = points[i, 0] * scale * fx + cx
        projected[i, 1] = points[i, 1] * scale * fy + cy
        projected[i, 2] = z


@part
def project_skin(
    surface: Skin, chain: Chain, scale: float, translation: Array, camera: Array, projected: Image
) -> None:
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
def rasterise(projected: Image, faces: NDArray[np.int32], depth: Image) -> None:
    """Draw the front faces of a closed mesh into a z-buffer (H, W) float32, which is cleared to FAR first.

    Depth is interpolated linearly over a triangle (in the image), which for triangles of a few millimetres differs from
    perspective interpolation by micrometres. All pixels of a triangle's bounding box are written, without branches: in
    triangles of a few pixels a wrong guess of the processor costs more.
    """
    height, width = depth.shape
    depth[:] = FAR
    for f in range(faces.shape[0]):
        a, b, c = index(faces[f, 0]), index(faces[f, 1]), index(faces[f, 2])
        ua, va, za = projected[a, 0], projected[a, 1], projected[a, 2]
        ub, vb, zb = projected[b, 0], projected[b, 1], projected[b, 2]
        uc, vc, zc = projected[c, 0], projected[c, 1], projected[c, 2]
        area = (ub - ua) * (vc - va) - (vb - va) * (uc - ua)
        if area >= 0.0:  # y points down: the outward side of a front face turns the other way
            continue
        top, bottom = max(min(va, vb, vc), _ZERO), min(max(va, vb, vc), np.float32(height - 1))
        left, right = max(min(ua, ub, uc), _ZERO), min(max(ua, ub, uc), np.float32(width - 1))
        if top > bottom or left > right or min(za, zb, zc) <= 0.0:
            continue
        # barycentric coordinates of b and c, and depth, are linear in (u, v): slopes along u and v
        inverse = _ONE / area
        bu, bv = (vc - va) * inverse, (ua - uc) * inverse
        cu, cv = (va - vb) * inverse, (ub - ua) * inverse
        zu, zv = bu * (zb - za) + cu * (zc - za), bv * (zb - za) + cv * (zc - za)
        first, last = index(_ceil(left)), index(right)
        for v in range(index(_ceil(top)), index(bottom) + 1):
            along, down = np.float32(first) - ua, np.float32(v) - va
            wb, wc, z = bu * along + bv * down, cu * along + cv * down, za + zu * along + zv * down
            for u in range(first, last + 1):
                inside = (min(wb, wc) >= -_EDGE) & (wb + wc <= _ONE + _EDGE)
                depth[v, u] = min(depth[v, u], z if inside else FAR)
                wb, wc, z = wb + bu, wc + cu, z + zu


@part
def _ceil(x: float) -> int:
    """Least integer that is not less, for x ≥ 0; numba's own is a call."""
    i = int(x)
    return i + int(i < x)
