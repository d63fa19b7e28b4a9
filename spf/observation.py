"""Frame → Observation (spec 3): the foreground around a place, its points and normals, and a coarse copy to render against."""

from __future__ import annotations

from typing import NamedTuple

import cv2
import numpy as np
from numpy.typing import ArrayLike, NDArray

from spf.frame import Camera, Frame
from spf.kernels.cost import ObservationArrays
from spf.kernels.surface import depth_in_sphere, surface_points

__all__ = ["Observation", "camera_numbers", "observe"]

GRID_CELLS = 80 * 60
OUTSIDE_RAMP = 0.005  # m beside the hand at which covering a cell costs its full 1
_LEAST_COMPONENT = 0.0002  # m²: specks smaller than 2 cm² are no part of a hand
_OCCLUDER_GAP = 0.03  # m in front of the hand's nearest pixel from which a surface hides it
_MARGIN = 10  # pixels around the foreground


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
    """

    arrays: ObservationArrays
    camera: Camera
    left: int
    top: int
    depth: NDArray[np.float32]
    time: float
    index: int  # type: ignore[assignment]  # a frame has an index; a tuple's method of that name is not missed

    @property
    def is_empty(self) -> bool:
        """Whether nothing of the scene lies around the place that was looked at."""
        return len(self.arrays.pixels) == 0

    @property
    def hand_points(self) -> NDArray[np.float64]:
        """The observed points (M, 3), m."""
        return self.arrays.points[self.arrays.pixels]


def camera_numbers(camera: Camera) -> NDArray[np.float64]:
    """Return a camera as the five numbers that kernels take."""
    return np.array([camera.fx, camera.fy, camera.cx, camera.cy, float(camera.model == "pinhole")])


def observe(frame: Frame, centre: ArrayLike, radius: float, plane: ArrayLike | None = None) -> Observation:
    """Cut out and measure the surface within a sphere, as it is seen by the camera.

    Args:
        frame: the depth image.
        centre: (3,) m, where the hand's palm is expected.
        radius: m, reach of a hand around it.
        plane: (4,) (n, d) with n·X + d = 0 of a table or wall to leave out, n towards the camera; or None.

    Returns:
        The observation; :attr:`Observation.is_empty` when nothing is there.
    """
    c = np.asarray(centre, dtype=np.float64)
    left, top, depth = _crop(frame, c, radius)
    camera = frame.camera.crop(left, top, depth.shape[1], depth.shape[0])
    mask = _foreground(depth, camera, c, radius, plane)
    rows, columns = np.flatnonzero(mask.any(axis=1)), np.flatnonzero(mask.any(axis=0))
    if rows.size:  # tighten the crop around what was found
        y0, y1 = max(rows[0] - _MARGIN, 0), min(rows[-1] + _MARGIN + 1, mask.shape[0])
        x0, x1 = max(columns[0] - _MARGIN, 0), min(columns[-1] + _MARGIN + 1, mask.shape[1])
        depth, mask = np.ascontiguousarray(depth[y0:y1, x0:x1]), np.ascontiguousarray(mask[y0:y1, x0:x1])
        left, top = left + int(x0), top + int(y0)
        camera = frame.camera.crop(left, top, depth.shape[1], depth.shape[0])
    return _measure(frame, camera, left, top, depth, mask)


def _crop(frame: Frame, centre: NDArray[np.float64], radius: float) -> tuple[int, int, NDArray[np.float32]]:
    """Cut the sphere's bounding box out of the image."""
    camera = frame.camera
    nearest = max(centre[2] - radius, 0.1) if camera.model == "pinhole" else 1.0
    u, v = camera.project(np.array([centre[0], centre[1], max(centre[2], 0.1)]))
    half_u, half_v = camera.fx * radius / nearest, camera.fy * radius / nearest
    height, width = frame.depth.shape
    x0, x1 = (int(np.clip(x, 0, width)) for x in (u - half_u, u + half_u + 1))
    y0, y1 = (int(np.clip(y, 0, height)) for y in (v - half_v, v + half_v + 1))
    if x1 - x0 < 2 or y1 - y0 < 2:
        return 0, 0, np.zeros((2, 2), np.float32)
    return x0, y0, np.ascontiguousarray(frame.depth[y0:y1, x0:x1])


def _foreground(
    depth: NDArray[np.float32], camera: Camera, centre: NDArray[np.float64], radius: float, plane: ArrayLike | None
) -> NDArray[np.uint8]:
    """Mask of the surface within the sphere, off the plane, without specks."""
    mask = np.empty(depth.shape, np.uint8)
    depth_in_sphere(depth, camera_numbers(camera), centre, radius, mask)
    if plane is not None:
        mask[_near_plane(depth, camera, np.asarray(plane, dtype=np.float64))] = 0
    count, labels, stats, _ = cv2.connectedComponentsWithStats(mask, connectivity=8)
    pixel_area = (float(centre[2]) / camera.fx) ** 2 if camera.model == "pinhole" else 1.0 / camera.fx**2
    keep = stats[:, cv2.CC_STAT_AREA] * pixel_area > _LEAST_COMPONENT
    keep[0] = False
    return keep.astype(np.uint8)[labels] if count > 1 else mask


def _near_plane(depth: NDArray[np.float32], camera: Camera, plane: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Pixels within 1.2 cm of a plane, or behind it."""
    v, u = np.mgrid[: depth.shape[0], : depth.shape[1]]
    height = camera.back_project(u, v, depth) @ plane[:3] + plane[3]
    return height < 0.012


def _measure(
    frame: Frame, camera: Camera, left: int, top: int, depth: NDArray[np.float32], mask: NDArray[np.uint8]
) -> Observation:
    depth, mask = _fill_holes(depth, mask)
    height, width = depth.shape
    if not mask.any():
        return _empty(frame, camera, left, top)
    distance, region = cv2.distanceTransformWithLabels(1 - mask, cv2.DIST_L2, 5, labelType=cv2.DIST_LABEL_PIXEL)
    pixels = np.flatnonzero(mask).astype(np.int32)
    place = np.zeros(int(region.max()) + 1, np.int32)
    place[region.reshape(-1)[pixels]] = pixels
    nearest = place[region]
    filled = depth.reshape(-1)[nearest]
    smooth = np.asarray(cv2.bilateralFilter(filled, 5, 0.008, 2.0), dtype=np.float32)
    numbers = camera_numbers(camera)
    points, normals = np.empty((height * width, 3)), np.empty((height * width, 3))
    surface_points(smooth, numbers, points, normals)
    labels = mask.copy()
    labels[(mask == 0) & (depth > 0) & (depth < filled - _OCCLUDER_GAP)] = 2
    grid = _grid(camera, smooth, labels, np.asarray(distance, dtype=np.float32))
    arrays = ObservationArrays(numbers, points, normals, labels, nearest, pixels, *grid)
    return Observation(arrays, camera, left, top, np.where(mask, smooth, np.float32(0)), frame.time, frame.index)


def _fill_holes(depth: NDArray[np.float32], mask: NDArray[np.uint8]) -> tuple[NDArray[np.float32], NDArray[np.uint8]]:
    """Fill pinholes of missing readings from a 3×3 median of what surrounds them."""
    closed = cv2.morphologyEx(mask, cv2.MORPH_CLOSE, np.ones((3, 3), np.uint8))
    holes = (closed > 0) & (mask == 0) & (depth <= 0)
    if not holes.any():
        return depth, mask
    median = cv2.medianBlur(np.where(mask, depth, np.float32(0)), 3)
    holes &= median > 0
    return np.where(holes, median, depth), np.where(holes, np.uint8(1), mask)


def _grid(
    camera: Camera, depth: NDArray[np.float32], labels: NDArray[np.uint8], distance: NDArray[np.float32]
) -> tuple[NDArray[np.float64], NDArray[np.float32], NDArray[np.uint8], NDArray[np.float32], int]:
    """Sample the crop to at most GRID_CELLS cells: camera, depth, labels, cost of covering a cell, number of hand cells."""
    height, width = depth.shape
    pitch = max(1.0, float(np.sqrt(height * width / GRID_CELLS)))
    rows = np.minimum(np.rint(np.arange(0, height - 0.5, pitch)).astype(np.intp), height - 1)
    columns = np.minimum(np.rint(np.arange(0, width - 0.5, pitch)).astype(np.intp), width - 1)
    at = np.ix_(rows, columns)
    scaled = camera._replace(fx=camera.fx / pitch, fy=camera.fy / pitch, cx=camera.cx / pitch, cy=camera.cy / pitch)
    metres = distance[at] / np.float32(camera.fx)
    if camera.model == "pinhole":
        metres = metres * depth[at]
    coarse_labels = labels[at]
    outside = np.where(coarse_labels == 0, np.minimum(metres / np.float32(OUTSIDE_RAMP), 1), 0).astype(np.float32)
    return camera_numbers(scaled), depth[at], coarse_labels, outside, int((coarse_labels == 1).sum())


def _empty(frame: Frame, camera: Camera, left: int, top: int) -> Observation:
    nothing = np.zeros((2, 2), np.float32)
    points, normals = np.zeros((4, 3)), np.tile([0.0, 0.0, -1.0], (4, 1))
    numbers = camera_numbers(camera)
    labels, nearest = np.zeros((2, 2), np.uint8), np.zeros((2, 2), np.int32)
    none = np.empty(0, np.int32)
    arrays = ObservationArrays(
        numbers, points, normals, labels, nearest, none, numbers, nothing, labels, np.ones((2, 2), np.float32), 0
    )
    return Observation(arrays, camera, left, top, nothing, frame.time, frame.index)
