"""Distance of points from the surface of a posed hand."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.spatial import cKDTree

__all__ = ["distances_to_surface"]

Array = NDArray[np.float64]
_NEAREST = 16  # triangles, by their centres, among which the nearest is looked for


def distances_to_surface(points: ArrayLike, vertices: ArrayLike, faces: ArrayLike) -> Array:
    """Distance in metres of points from a mesh, exact among the triangles whose centres are nearest.

    Args:
        points: (M, 3) metres.
        vertices: (V, 3) metres.
        faces: (F, 3) vertex indices of triangles of about the same size.

    Returns:
        (M,) distances, without a sign.
    """
    at = np.asarray(points, dtype=np.float64).reshape(-1, 3)
    if not len(at):
        return np.zeros(0)
    corners = np.asarray(vertices, dtype=np.float64)[np.asarray(faces)]
    count = min(_NEAREST, len(corners))
    _, near = cKDTree(corners.mean(axis=1)).query(at, k=[*range(1, count + 1)])
    a, b, c = np.moveaxis(corners[near], 2, 0)
    squared = np.min(
        [_inside(at[:, None], a, b, c), *(_edge(at[:, None], p, q) for p, q in ((a, b), (b, c), (c, a)))], 0
    )
    return np.asarray(np.sqrt(squared.min(axis=1)))


def _edge(point: Array, start: Array, end: Array) -> Array:
    """Squared distance from segments."""
    along = end - start
    length = np.maximum((along * along).sum(-1), 1e-18)
    share = np.clip(((point - start) * along).sum(-1) / length, 0.0, 1.0)
    away = point - start - share[..., None] * along
    return np.asarray((away * away).sum(-1))


def _inside(point: Array, a: Array, b: Array, c: Array) -> Array:
    """Squared distance from the planes of triangles for points above their insides; infinite elsewhere."""
    normal = np.cross(b - a, c - a)
    area = np.maximum((normal * normal).sum(-1), 1e-30)
    away = point - a
    inside = np.ones(area.shape, bool)
    for start, end in ((a, b), (b, c), (c, a)):
        inside &= (np.cross(end - start, point - start) * normal).sum(-1) >= 0
    return np.where(inside, (away * normal).sum(-1) ** 2 / area, np.inf)
