"""Find where in a frame a hand may be (spec 3): the nearest things of about a hand's size, tables left out."""

from __future__ import annotations

from typing import NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from spf.frame import Frame
from spf.kernels.surface import count_by_planes

__all__ = ["Region", "find_plane", "find_regions"]

Array = NDArray[np.float64]
_WIDTH = 160  # pixels that the search works at
_WINDOW = 0.28  # m of depth behind the nearest point of a region: an arm that points at the camera and its hand
_LEAST_AREA, _HAND_AREA = 0.0015, 0.008  # m² visible: the least of a hand (a small fist, edge-on), and an open palm
_FARTHEST = 2.5  # m
_LARGEST_RADIUS = 0.40  # m
_PLANE_SHARE = 0.25  # share of the readings that make a plane a table or a wall
_PLANE_TRIALS = 60
_PLANE_SPREAD = 0.12  # m, standard deviation of such a plane's readings along its narrower side, at least
_ON_PLANE, _BEHIND, _MOST_BEHIND = 0.01, 0.02, 0.02  # m from a plane, m behind it, and the most readings behind it


class Region(NamedTuple):
    """A place where a hand may be.

    Attributes:
        centre: (3,) m, its middle.
        radius: m around the centre that holds nearly all of it.
        points: (M, 3) m, a few hundred of its points.
        area: m² that the camera sees of it.
    """

    centre: Array
    radius: float
    points: Array
    area: float


def find_regions(frame: Frame, most: int = 3) -> list[Region]:
    """List places where a hand may be, nearest first, a table or wall left out.

    A component of the scene counts when it shows enough surface within a window of depth that starts at the component
    (not at the nearest pixel: a speck in front of the hand must not cut it).

    Args:
        frame: the depth image.
        most: longest list returned.
    """
    factor = max(1, round(frame.depth.shape[1] / _WIDTH))
    depth = frame.depth[::factor, ::factor]
    camera = frame.camera.subsample(factor)
    v, u = np.mgrid[: depth.shape[0], : depth.shape[1]]
    points = camera.back_project(u, v, depth)
    valid = (depth > 0.1) & (depth < _FARTHEST)
    plane = find_plane(frame)
    if plane is not None:
        valid &= points @ plane[:3] + plane[3] > 0.012
    per_pixel = depth / camera.fx if camera.model == "pinhole" else np.full(depth.shape, 1.0 / camera.fx)
    area = np.where(valid, per_pixel**2, 0.0)
    regions: list[Region] = []
    taken = np.zeros(depth.shape, bool)
    while len(regions) < most:
        found = _nearest_component(np.where(valid & ~taken, depth, 0.0), area)
        if found is None:
            break
        taken |= found
        regions.append(_region(points[found], area[found]))
    return regions


def _nearest_component(depth: Array, area: Array) -> NDArray[np.bool_] | None:
    """Mask of the nearest connected surface large enough to be a hand, or None."""
    values = np.sort(depth[depth > 0])
    if values.size == 0:
        return None
    step, start = 0.02, float(values[0])
    while start < values[-1]:
        window = ((depth >= start) & (depth < start + _WINDOW)).astype(np.uint8)
        count, labels = cv2.connectedComponents(window, connectivity=8)
        sizes = np.bincount(labels.reshape(-1), weights=area.reshape(-1), minlength=count)
        sizes[0] = 0.0
        best = int(np.argmax(sizes))
        if sizes[best] > _LEAST_AREA:
            mask = labels == best
            front = float(np.percentile(depth[mask], 2))
            if front <= start + step:  # the window starts at the component itself
                return mask
        start += step
    return None


def _region(points: Array, area: Array) -> Region:
    chosen = points[:: max(1, len(points) // 400)]
    centre = 0.5 * (np.percentile(chosen, 5, axis=0) + np.percentile(chosen, 95, axis=0))
    reach = float(np.percentile(np.linalg.norm(chosen - centre, axis=1), 98)) + 0.02
    return Region(centre, min(reach, _LARGEST_RADIUS), chosen, float(area.sum()))


def find_plane(frame: Frame) -> Array | None:
    """Find a table or a wall: the plane that holds a large share of the readings, with nothing behind it.

    Among planes through three readings each (RANSAC, Fischler and Bolles 1981, with the same draws in every frame), the one
    with the most readings, then the one closest to these.

    Returns:
        (4,) (n, d) with n·X + d = 0, n towards the camera; None when no plane dominates.
    """
    factor = max(1, round(frame.depth.shape[1] / 80))
    depth = frame.depth[::factor, ::factor]
    camera = frame.camera.subsample(factor)
    v, u = np.nonzero((depth > 0) & np.isfinite(depth))
    if len(v) < 100:
        return None
    points = camera.back_project(u, v, depth[v, u])
    a, b, c = points[np.random.default_rng(0).integers(len(points), size=(3, _PLANE_TRIALS))]
    normals = np.cross(b - a, c - a)
    lengths = np.linalg.norm(normals, axis=1)
    normals *= (np.where(normals[:, 2] > 0.0, -1.0, 1.0) / np.maximum(lengths, 1e-12))[:, None]
    planes = np.column_stack([normals, -(a * normals).sum(axis=1)])
    counts = np.empty((_PLANE_TRIALS, 2))
    count_by_planes(points, planes, _ON_PLANE, _BEHIND, counts)
    on = np.where((lengths > 1e-6) & (counts[:, 1] < _MOST_BEHIND * len(points)), counts[:, 0], 0.0)
    best = int(np.argmax(on))
    # the hand itself is flat: a plane worth removing is much larger than a hand
    if on[best] < _PLANE_SHARE * len(points):
        return None
    inside = points[np.abs(points @ planes[best, :3] + planes[best, 3]) < _ON_PLANE]
    variances, axes = np.linalg.eigh(np.cov(inside.T))
    if np.sqrt(variances[1]) < _PLANE_SPREAD:
        return None
    normal = axes[:, 0] * (-1.0 if axes[2, 0] > 0.0 else 1.0)
    return np.append(normal, -normal @ inside.mean(axis=0))
