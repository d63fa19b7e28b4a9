"""Crops of a frame's depth for the network: a cube of space seen by a camera that looks straight at its centre."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from spf.frame import Camera
from spf.kernels.crops import crop_depths
from spf.learned.layout import CROP_SIZE

__all__ = ["make_crops", "turn_towards"]

Array = NDArray[np.float64]


def turn_towards(centre: ArrayLike) -> Array:
    """Return R_camera_crop (3, 3): the least rotation that takes the optical axis z to the ray through a point (3,)."""
    x, y, z = np.asarray(centre, dtype=np.float64) / np.linalg.norm(centre)
    # Rodrigues about (-y, x, 0) with cos = z; 1/(1 + z) is (1 - cos)/sin²
    share = 1.0 / (1.0 + z)
    return np.array([[1.0 - x * x * share, -x * y * share, x], [-x * y * share, 1.0 - y * y * share, y], [-x, -y, z]])


def make_crops(
    depth: NDArray[np.float32], camera: Camera, centres: ArrayLike, extents: ArrayLike
) -> tuple[NDArray[np.float32], Array]:
    """Cut cubes out of a depth map.

    Args:
        depth: (H, W) m, 0 where there is no reading.
        camera: of the depth map.
        centres: (N, 3) m, of the cubes, in front of the camera.
        extents: (N,) m, sides of the cubes.

    Returns:
        crops (N, S, S), -1 at a cube's front to 1 at its back and where there is nothing, and R_camera_crop (N, 3, 3).
    """
    centres = np.ascontiguousarray(centres, dtype=np.float64).reshape(-1, 3)
    sides = np.ascontiguousarray(extents, dtype=np.float64).reshape(-1)
    straight = camera.model == "orthographic"
    turns = np.array([np.eye(3) if straight else turn_towards(centre) for centre in centres]).reshape(-1, 3, 3)
    numbers = np.array([camera.fx, camera.fy, camera.cx, camera.cy, float(not straight)])
    crops = np.empty((len(centres), CROP_SIZE, CROP_SIZE), np.float32)
    crop_depths(np.ascontiguousarray(depth, dtype=np.float32), numbers, turns, centres, sides, crops)
    return crops, turns
