"""Camera and Frame: what a depth sensor delivers, in SI units.

Camera frame: x right, y down, z forward (spec 1). Pixel centres have integer coordinates.
"""

from __future__ import annotations

from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

__all__ = ["JOINT_NAMES", "Camera", "Frame", "Truth"]

#: The 21 joints that poses, truths and tracks are written in.
JOINT_NAMES: tuple[str, ...] = (
    "wrist",
    *(f"thumb_{joint}" for joint in ("tm", "mp", "ip", "tip")),
    *(
        f"{finger}_{joint}"
        for finger in ("index", "middle", "ring", "little")
        for joint in ("mcp", "pip", "dip", "tip")
    ),
)


class Camera(NamedTuple):
    """Pinhole or orthographic camera without distortion.

    Attributes:
        width, height: image size in pixels.
        fx, fy: focal lengths in pixels (pinhole) or pixels per metre (orthographic).
        cx, cy: principal point in pixels.
        model: ``"pinhole"`` or ``"orthographic"`` (the paper's structured-light sensor).
    """

    width: int
    height: int
    fx: float
    fy: float
    cx: float
    cy: float
    model: Literal["pinhole", "orthographic"] = "pinhole"

    def project(self, points: ArrayLike) -> NDArray[np.float64]:
        """Project 3-D points to pixels.

        Args:
            points: (..., 3) in metres, camera frame; z > 0 for a pinhole camera.

        Returns:
            (..., 2) pixel coordinates (u, v).
        """
        xyz = np.asarray(points, dtype=np.float64)
        depth = xyz[..., 2] if self.model == "pinhole" else 1.0
        u = self.fx * xyz[..., 0] / depth + self.cx
        v = self.fy * xyz[..., 1] / depth + self.cy
        return np.stack([u, v], axis=-1)

    def back_project(self, u: ArrayLike, v: ArrayLike, z: ArrayLike) -> NDArray[np.float64]:
        """Back-project pixels with known depth, the inverse of :meth:`project`.

        Args:
            u, v: pixel coordinates, any broadcastable shape.
            z: depth along the optical axis in metres, same shape.

        Returns:
            (..., 3) points in metres.
        """
        u_, v_, z_ = np.broadcast_arrays(*(np.asarray(a, dtype=np.float64) for a in (u, v, z)))
        depth = z_ if self.model == "pinhole" else 1.0
        return np.stack([(u_ - self.cx) * depth / self.fx, (v_ - self.cy) * depth / self.fy, z_], axis=-1)

    def crop(self, left: int, top: int, width: int, height: int) -> Camera:
        """Return the camera of a sub-image whose pixel (0, 0) is pixel (left, top) of this one."""
        return self._replace(width=width, height=height, cx=self.cx - left, cy=self.cy - top)

    def subsample(self, factor: int) -> Camera:
        """Return the camera of ``depth[::factor, ::factor]``."""
        return self._replace(
            width=-(-self.width // factor),
            height=-(-self.height // factor),
            fx=self.fx / factor,
            fy=self.fy / factor,
            cx=self.cx / factor,
            cy=self.cy / factor,
        )


class Truth(NamedTuple):
    """Ground truth of a frame.

    Attributes:
        joints: (21, 3) in metres, camera frame, ordered as :data:`JOINT_NAMES`; NaN where the data set has no such
            joint.
        pose: (D,) exact pose of the project's own hand model (synthetic sessions), or None.
        orientation: (3, 3) exact reference orientation that ``pose`` is relative to, or None.
    """

    joints: NDArray[np.float64]
    pose: NDArray[np.float64] | None = None
    orientation: NDArray[np.float64] | None = None


class Frame(NamedTuple):
    """One depth image.

    Attributes:
        index: position in its session.
        time: seconds since the session's first frame.
        depth: (H, W) float32 metres along the optical axis; 0 where the sensor has no reading.
        camera: the camera that took it.
        colour: (H, W, 3) uint8 RGB registered to the depth, or None.
        truth: ground truth, or None.
    """

    index: int  # type: ignore[assignment]  # hides tuple.index, which nobody needs here
    time: float
    depth: NDArray[np.float32]
    camera: Camera
    colour: NDArray[np.uint8] | None = None
    truth: Truth | None = None
