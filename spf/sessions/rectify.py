"""Depth images without lens distortion: the trackers' camera has none, so what is recorded with one is rectified.

Every pixel of the rectified image takes the count of the nearest recorded pixel: counts are never mixed, because the
mean of a hand and its background is neither.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from spf.errors import SessionError
from spf.frame import Camera

__all__ = ["Lens", "Rectify", "rectification"]

Rectify = Callable[[NDArray[np.uint16]], NDArray[np.uint16]]

#: Models of ROS and how many coefficients they take; OpenCV has the same order for all of them.
_MODELS = {
    "": (0, 4, 5, 8),
    "plumb_bob": (4, 5),
    "rational_polynomial": (8, 12, 14),
    "equidistant": (4,),
    "fisheye": (4,),
}


class Lens(NamedTuple):
    """A camera with its lens.

    Attributes:
        width, height: image size in pixels.
        fx, fy, cx, cy: in pixels.
        model: of the distortion, as ROS names it; "" for none.
        distortion: its coefficients.
    """

    width: int
    height: int
    fx: float
    fy: float
    cx: float
    cy: float
    model: str = ""
    distortion: tuple[float, ...] = ()

    @property
    def camera(self) -> Camera:
        """The camera of the rectified image."""
        return Camera(self.width, self.height, self.fx, self.fy, self.cx, self.cy)

    @property
    def is_distorted(self) -> bool:
        """Whether there is any distortion."""
        return any(self.distortion)

    @property
    def is_calibrated(self) -> bool:
        """Whether its numbers are those of a camera."""
        numbers = (self.fx, self.fy, self.cx, self.cy, *self.distortion)
        return all(map(math.isfinite, numbers)) and self.fx > 0 and self.fy > 0


def rectification(lens: Lens, source: str) -> Rectify | None:
    """Return what takes the distortion out of a depth image, None when there is none.

    Args:
        lens: of the recorded images.
        source: the recording, for messages.

    Raises:
        SessionError: the model is unknown.
    """
    if not lens.is_distorted:
        return None
    if len(lens.distortion) not in _MODELS.get(lens.model, ()):
        raise SessionError(
            f"{source} has lens distortion of an unknown model ({lens.model or 'unnamed'}, {len(lens.distortion)} "
            "coefficients): give the camera of rectified images with --camera."
        )
    matrix = np.array([[lens.fx, 0, lens.cx], [0, lens.fy, lens.cy], [0, 0, 1]])
    size, coefficients = (lens.width, lens.height), np.array(lens.distortion)
    if lens.model in ("equidistant", "fisheye"):
        u, v = cv2.fisheye.initUndistortRectifyMap(matrix, coefficients, np.eye(3), matrix, size, cv2.CV_32FC1)
    else:
        u, v = cv2.initUndistortRectifyMap(matrix, coefficients, np.eye(3), matrix, size, cv2.CV_32FC1)

    def rectify(raw: NDArray[np.uint16]) -> NDArray[np.uint16]:
        return np.asarray(cv2.remap(raw, u, v, cv2.INTER_NEAREST), dtype=np.uint16)

    return rectify
