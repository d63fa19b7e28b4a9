"""Where a picture is seen from: an orbit around a point, starting at the sensor's own point of view."""

from __future__ import annotations

import math
from typing import NamedTuple, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

__all__ = ["Placement", "ViewCamera"]


class Placement(NamedTuple):
    """Position and focal point (3,) in metres, up (3,) a unit vector, vertical view angle in radians; camera frame."""

    position: NDArray[np.float64]
    focal_point: NDArray[np.float64]
    up: NDArray[np.float64]
    view_angle: float


class ViewCamera(NamedTuple):
    """An orbit around ``focal_point``; at azimuth 0 and elevation 0 the eye is on the sensor's side, on its ray.

    Attributes:
        focal_point: what the eye looks at, metres, camera frame (x right, y down, z forward).
        distance: from the eye to the focal point, metres; ``|focal_point|`` puts the eye into the sensor.
        extent: height of what is seen at the focal point at zoom 1, metres.
        azimuth: radians; positive moves the eye to the right of the picture.
        elevation: radians; positive moves the eye up. Any angle is allowed: nothing flips at the poles.
        zoom: magnification, > 0.
        pan: metres that eye and focal point are moved to the right and up in the picture.
    """

    focal_point: tuple[float, float, float] = (0.0, 0.0, 0.5)
    distance: float = 0.5
    extent: float = 0.25
    azimuth: float = 0.0
    elevation: float = 0.0
    zoom: float = 1.0
    pan: tuple[float, float] = (0.0, 0.0)

    @classmethod
    def from_sensor(cls, points: ArrayLike) -> Self:
        """Return the sensor's own point of view on some points, which just fit in.

        Args:
            points: (..., 3) metres, at least one: an observed hand, or the vertices of a model.

        Raises:
            ValueError: there is no point, or one that is not finite.
        """
        xyz = np.asarray(points, dtype=np.float64).reshape(-1, 3)
        if not len(xyz) or not np.isfinite(xyz).all():
            raise ValueError("a view needs at least one point, all of them finite")
        low, high = np.percentile(xyz, [1, 99], axis=0)
        centre = (low + high) / 2
        # Round, so that a hand that only bends a finger does not make the picture breathe.
        extent = max(0.1, math.ceil(float(np.linalg.norm(high - low)) / 0.02) * 0.02)
        x, y, z = (float(value) for value in centre)
        return cls((x, y, z), max(float(np.linalg.norm(centre)), 0.05), extent)

    def axes(self) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
        """Return right, down and forward, unit vectors (3,), of an eye at azimuth 0 and elevation 0."""
        return _ray_frame(np.asarray(self.focal_point, dtype=np.float64))

    def placement(self) -> Placement:
        """Return where the eye is.

        Raises:
            ValueError: a number is not finite, or distance, extent or zoom is not positive.
        """
        numbers = (*self.focal_point, *self[1:-1], *self.pan)
        if not all(map(math.isfinite, numbers)) or min(self.distance, self.extent, self.zoom) <= 0:
            raise ValueError(f"{self} is no view: numbers must be finite; distance, extent and zoom positive")
        focal = np.asarray(self.focal_point, dtype=np.float64)
        right, down, forward = self.axes()
        (sa, ca), (se, ce) = ((math.sin(t), math.cos(t)) for t in (self.azimuth, self.elevation))
        outward = sa * ce * right - se * down - ca * ce * forward
        up = -sa * se * right - ce * down + ca * se * forward  # ∂outward/∂elevation, so it never degenerates
        angle = 2 * math.atan(self.extent / (2 * self.distance * self.zoom))
        beside = self.pan[0] * np.cross(up, outward) + self.pan[1] * up
        return Placement(focal + beside + self.distance * outward, focal + beside, up, angle)


def _ray_frame(focal: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Return right, down and forward of an eye at the sensor that looks at ``focal``."""
    length = float(np.linalg.norm(focal))
    forward = focal / length if length > 1e-9 else np.array([0.0, 0.0, 1.0])
    right = np.cross([0.0, 1.0, 0.0], forward)
    if np.linalg.norm(right) < 1e-6:  # straight above or below the sensor
        right = np.array([1.0, 0.0, 0.0])
    right /= np.linalg.norm(right)
    return right, np.cross(forward, right), forward
