"""Depth by casting a ray through every pixel and meeting every triangle (Möller and Trumbore 1997)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from spf.frame import Camera


def cast_rays(vertices: NDArray[np.float64], faces: NDArray[np.int32], camera: Camera) -> NDArray[np.float64]:
    """Return the depth map (H, W) of a mesh, infinite where no ray meets it."""
    a, b, c = (vertices[faces[:, k]] for k in range(3))
    edge1, edge2 = b - a, c - a
    depth = np.full((camera.height, camera.width), np.inf)
    for v in range(camera.height):
        for u in range(camera.width):
            origin = camera.back_project(u, v, 0.0)
            ray = camera.back_project(u, v, 1.0) - origin  # one metre of depth
            p = np.cross(ray, edge2)
            determinant = np.einsum("ij,ij->i", edge1, p)
            hit = np.abs(determinant) > 1e-18
            inverse = np.divide(1.0, determinant, out=np.zeros_like(determinant), where=hit)
            s = origin - a
            alpha = np.einsum("ij,ij->i", s, p) * inverse
            q = np.cross(s, edge1)
            beta = (q @ ray) * inverse
            z = np.einsum("ij,ij->i", edge2, q) * inverse
            hit &= (alpha >= 0) & (beta >= 0) & (alpha + beta <= 1) & (z > 0)
            if hit.any():
                depth[v, u] = z[hit].min()
    return depth
