"""Frame → Observation (spec 3): the foreground around a place, its points and normals, and a coarse copy to render against.

A table or a wall within reach is no part of it.
"""

from __future__ import annotations

from typing import NamedTuple

import cv2
import numpy as np
from numpy.typing import ArrayLike, NDArray

from spf.frame import Camera, Frame
from spf.kernels.cost_inputs import NORMAL, SURFACE_COLUMNS, UNKNOWN, ObservationArrays
from spf.kernels.surface import coarse_grid, fill_holes, foreground, nearest_pixels, surface_points
from spf.segmentation import find_plane

__all__ = ["Observation", "Suggestion", "camera_numbers", "observe"]

Mask = NDArray[np.uint8]

GRID_CELLS = 80 * 60
OUTSIDE_RAMP = 0.005  # m beside the hand at which covering a cell costs its full 1
_LEAST_COMPONENT = 0.0002  # m²: specks smaller than 2 cm² are no part of a hand
_OCCLUDER_GAP = 0.03  # m in front of the hand's nearest pixel from which a surface hides it
_MARGIN = 10  # pixels around the foreground


class Suggestion(NamedTuple):
    """A pose that something else than the tracker suggests for a frame.

    Attributes:
        pose: (26,) relative to ``reference``.
        reference: (3, 3).
    """

    pose: NDArray[np.float64]
    reference: NDArray[np.float64]


class Observation(NamedTuple):
    """What the tracker knows of a frame.

    Attributes:
        arrays: what the kernels read.
        camera: camera of the crop.
        left, top: the crop's corner in the frame, pixels.
        size: (H, W) of the crop.
        depth: (H, W) float32 m, cleaned; 0 where the label is not HAND.
        time: s.
        index: of the frame.
        suggestions: poses that may be tried as further particles, see :mod:`spf.learned`.
    """

    arrays: ObservationArrays
    camera: Camera
    left: int
    top: int
    depth: NDArray[np.float32]
    time: float
    index: int  # type: ignore[assignment]  # a frame has an index; a tuple's method of that name is not missed
    suggestions: tuple[Suggestion, ...] = ()

    @property
    def is_empty(self) -> bool:
        """Whether nothing of the scene lies around the place that was looked at."""
        return len(self.arrays.pixels) == 0

    @property
    def hand_points(self) -> NDArray[np.float64]:
        """The observed points (M, 3), m."""
        return self.arrays.points[self.arrays.pixels].astype(np.float64)


def camera_numbers(camera: Camera) -> NDArray[np.float64]:
    """Return a camera as the five numbers that kernels take."""
    return np.array([camera.fx, camera.fy, camera.cx, camera.cy, float(camera.model == "pinhole")])


def observe(frame: Frame, centre: ArrayLike, radius: float) -> Observation:
    """Cut out and measure the surface within a sphere, as it is seen by the camera, a table or wall left out.

    Args:
        frame: the depth image.
        centre: (3,) m, where the hand's palm is expected.
        radius: m, reach of a hand around it.

    Returns:
        The observation; :attr:`Observation.is_empty` when nothing is there.
    """
    c = np.asarray(centre, dtype=np.float64)
    plane = find_plane(frame)
    front = np.array([0.0, 0.0, 0.0, 1.0]) if plane is None else plane
    window = _crop(frame, c, radius)
    mask = np.empty(window.depth.shape, np.uint8)
    top, bottom, left, right = foreground(
        window.depth, camera_numbers(_camera_of(frame, window)), c, radius, front, mask
    )
    window, mask = _cut(window, mask, top, bottom, left, right)
    camera = frame.camera
    pixel_area = (float(c[2]) / camera.fx) ** 2 if camera.model == "pinhole" else 1.0 / camera.fx**2
    kept = _without_specks(mask, pixel_area)
    if kept is not mask:
        rows, columns = np.flatnonzero(kept.any(axis=1)), np.flatnonzero(kept.any(axis=0))
        bounds = (rows[0], rows[-1], columns[0], columns[-1]) if len(rows) else (0, -1, 0, -1)
        window, kept = _cut(window, kept, *(int(bound) for bound in bounds))
    return _measure(frame, window, kept)


class _Window(NamedTuple):
    """Part of an image: its corner, and its depth (H, W)."""

    left: int
    top: int
    depth: NDArray[np.float32]


def _crop(frame: Frame, centre: NDArray[np.float64], radius: float) -> _Window:
    """Cut the sphere's bounding box out of the image."""
    camera = frame.camera
    nearest = max(centre[2] - radius, 0.1) if camera.model == "pinhole" else 1.0
    u, v = camera.project(np.array([centre[0], centre[1], max(centre[2], 0.1)]))
    half_u, half_v = camera.fx * radius / nearest, camera.fy * radius / nearest
    height, width = frame.depth.shape
    x0, x1 = (int(np.clip(x, 0, width)) for x in (u - half_u, u + half_u + 1))
    y0, y1 = (int(np.clip(y, 0, height)) for y in (v - half_v, v + half_v + 1))
    if x1 - x0 < 2 or y1 - y0 < 2:
        return _Window(0, 0, np.zeros((2, 2), np.float32))
    return _Window(x0, y0, np.ascontiguousarray(frame.depth[y0:y1, x0:x1]))


def _camera_of(frame: Frame, window: _Window) -> Camera:
    height, width = window.depth.shape
    return frame.camera.crop(window.left, window.top, width, height)


def _cut(window: _Window, mask: Mask, top: int, bottom: int, left: int, right: int) -> tuple[_Window, Mask]:
    """Tighten a window to some rows and columns, with a margin; to nothing when they are empty."""
    if top > bottom:
        return _Window(window.left, window.top, np.zeros((2, 2), np.float32)), np.zeros((2, 2), np.uint8)
    y, x = max(top - _MARGIN, 0), max(left - _MARGIN, 0)
    part = slice(y, bottom + _MARGIN + 1), slice(x, right + _MARGIN + 1)
    return _Window(window.left + x, window.top + y, window.depth[part].copy()), mask[part].copy()


def _without_specks(mask: Mask, pixel_area: float) -> Mask:
    """Drop components that are too small to be part of a hand."""
    count, labels, stats, _ = cv2.connectedComponentsWithStats(mask, connectivity=8)
    keep = stats[:, cv2.CC_STAT_AREA] * pixel_area > _LEAST_COMPONENT
    keep[0] = False
    if keep.sum() == count - 1:
        return mask
    return keep.astype(np.uint8)[labels]


def _measure(frame: Frame, window: _Window, mask: Mask) -> Observation:
    """Clean the surface under a mask and measure its points and normals."""
    if not mask.any():
        return _empty(frame, window)
    depth, camera = window.depth, _camera_of(frame, window)
    height, width = depth.shape
    numbers = camera_numbers(camera)
    closed = cv2.morphologyEx(mask, cv2.MORPH_CLOSE, np.ones((3, 3), np.uint8))
    fill_holes(depth, mask, closed)
    distance, region = cv2.distanceTransformWithLabels(1 - mask, cv2.DIST_L2, 5, labelType=cv2.DIST_LABEL_PIXEL)
    pixels, nearest = np.empty(height * width, np.int32), np.empty((height, width), np.int32)
    count = nearest_pixels(mask, region, np.zeros(height * width + 1, np.int32), pixels, nearest)
    filled = depth.reshape(-1)[nearest]
    smooth = np.asarray(cv2.bilateralFilter(filled, 5, 0.008, 2.0), dtype=np.float32)
    labels = np.where((mask == 0) & (depth > 0) & (depth < filled - _OCCLUDER_GAP), np.uint8(UNKNOWN), mask)
    surface = np.empty((height * width, SURFACE_COLUMNS), np.float32)
    surface_points(smooth, numbers, labels, surface)
    grid = _grid(camera, smooth, labels, np.asarray(distance, dtype=np.float32))
    arrays = ObservationArrays(numbers, surface, labels, nearest, pixels[:count].copy(), *grid)
    shown = np.where(mask, smooth, np.float32(0))
    return Observation(arrays, camera, window.left, window.top, shown, frame.time, frame.index)


def _grid(
    camera: Camera, depth: NDArray[np.float32], labels: Mask, distance: NDArray[np.float32]
) -> tuple[NDArray[np.float64], NDArray[np.float32], Mask, NDArray[np.float32], int]:
    """Sample the crop to about GRID_CELLS cells: camera, depth, labels, cost of covering a cell, number of hand cells."""
    height, width = depth.shape
    pitch = max(1.0, float(np.sqrt(height * width / GRID_CELLS)))
    size = int(np.ceil((height - 0.5) / pitch)), int(np.ceil((width - 0.5) / pitch))
    scaled = camera._replace(fx=camera.fx / pitch, fy=camera.fy / pitch, cx=camera.cx / pitch, cy=camera.cy / pitch)
    grid_depth, grid_labels, outside = np.empty(size, np.float32), np.empty(size, np.uint8), np.empty(size, np.float32)
    count = coarse_grid(
        depth, labels, distance, camera_numbers(camera), pitch, OUTSIDE_RAMP, grid_depth, grid_labels, outside
    )
    return camera_numbers(scaled), grid_depth, grid_labels, outside, int(count)


def _empty(frame: Frame, window: _Window) -> Observation:
    camera = _camera_of(frame, window)
    nothing = np.zeros((2, 2), np.float32)
    surface = np.zeros((4, SURFACE_COLUMNS), np.float32)
    surface[:, NORMAL + 2] = -1.0
    numbers = camera_numbers(camera)
    labels, nearest = np.zeros((2, 2), np.uint8), np.zeros((2, 2), np.int32)
    none = np.empty(0, np.int32)
    arrays = ObservationArrays(
        numbers, surface, labels, nearest, none, numbers, nothing, labels, np.ones((2, 2), np.float32), 0
    )
    return Observation(arrays, camera, window.left, window.top, nothing, frame.time, frame.index)
