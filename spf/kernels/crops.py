"""Square crops of depth maps: what a virtual camera sees of a cube around a point, whatever the sensor.

The virtual camera stands where the sensor stands and looks along the ray through the cube's centre. A rotation of a
pinhole camera about its centre moves no surface in front of another, so the resampling is exact: crop pixel (i, j)
has the ray ``r = R (x, y, 1)`` in the sensor's frame, reads depth z at its projection, and lies ``z / r_z`` deep along
the crop's own axis.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from spf.kernels.compiling import index, kernel, part

__all__ = ["BACKGROUND", "crop_depth", "crop_depths"]

Array = NDArray[np.float64]
Image = NDArray[np.float32]

BACKGROUND = np.float32(1.0)  # of a crop: nothing in the cube
_MOST_PROBES = 4  # along each side of a crop's pixel


@part
def crop_depth(depth: Image, camera: Array, turn: Array, centre: Array, extent: float, crop: Image) -> None:
    """Fill a crop (S, S) with depth in the cube, -1 (front) to 1 (back), BACKGROUND where there is nothing.

    A pixel of the crop takes the mean of the readings inside the cube at 4 to 16 places spread over it, when they are
    half of the places or more.

    Args:
        depth: (H, W) float32 m, 0 where there is no reading.
        camera: (5,) of the depth map.
        turn: (3, 3) R_camera_crop; the identity for an orthographic camera.
        centre: (3,) m, of the cube, camera frame.
        extent: m, side of the cube.
        crop: (S, S) float32, written.
    """
    height, width = depth.shape
    size = crop.shape[0]
    perspective = camera[4] != 0.0
    away = centre[2]
    if perspective:
        away = (centre[0] ** 2 + centre[1] ** 2 + centre[2] ** 2) ** 0.5
    pitch = extent / size
    per_probe = pitch * camera[0] / (away if perspective else 1.0)
    probes = min(max(int(per_probe + 0.5), 2), _MOST_PROBES)
    half, enough = 0.5 * extent, 0.5 * probes * probes
    for i in range(size):
        for j in range(size):
            total, count = 0.0, 0
            for a in range(probes):
                y = (i + (a + 0.5) / probes) * pitch - half
                for b in range(probes):
                    x = (j + (b + 0.5) / probes) * pitch - half
                    if perspective:
                        rz = turn[2, 0] * x + turn[2, 1] * y + turn[2, 2] * away
                        scale = 1.0 / max(rz, 1e-9)
                        u = (turn[0, 0] * x + turn[0, 1] * y + turn[0, 2] * away) * scale * camera[0] + camera[2]
                        v = (turn[1, 0] * x + turn[1, 1] * y + turn[1, 2] * away) * scale * camera[1] + camera[3]
                        deepen = away * scale
                    else:
                        u, v = (centre[0] + x) * camera[0] + camera[2], (centre[1] + y) * camera[1] + camera[3]
                        deepen = 1.0
                    if u < -0.5 or v < -0.5 or u >= width - 0.5 or v >= height - 0.5:
                        continue
                    z = depth[index(v + 0.5), index(u + 0.5)] * deepen - away
                    if -half < z < half:
                        total += z
                        count += 1
            crop[i, j] = total / (count * half) if count >= enough else BACKGROUND


@kernel
def crop_depths(depth: Image, camera: Array, turns: Array, centres: Array, extents: Array, crops: Image) -> None:
    """Fill crops (N, S, S) of one depth map, for turns (N, 3, 3), centres (N, 3) and extents (N,)."""
    for n in range(crops.shape[0]):
        crop_depth(depth, camera, turns[n], centres[n], extents[n], crops[n])
