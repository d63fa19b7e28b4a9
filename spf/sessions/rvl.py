"""Depth images in RVL, as ROS's ``compressedDepth`` writes them: width and height, and then the code itself.

No package that reads this layout is kept up for Python; the code is in :mod:`spf.kernels.rvl`.
"""

from __future__ import annotations

import struct

import numpy as np
from numpy.typing import NDArray

from spf.kernels.rvl import unpack_rvl

__all__ = ["decode_rvl"]

_SIZE = struct.Struct("<II")
_MOST_PIXELS = 2**26


def decode_rvl(data: bytes) -> NDArray[np.uint16]:
    """Decode an image.

    Args:
        data: width and height as 32-bit integers, and the code.

    Returns:
        (height, width) counts.

    Raises:
        ValueError, struct.error: it is damaged.
    """
    width, height = _SIZE.unpack_from(data)
    if not 0 < width * height <= _MOST_PIXELS:
        raise ValueError(f"an image of {width}×{height}")
    count = (len(data) - _SIZE.size) // 4
    pixels = np.zeros(width * height, np.uint16)
    if not unpack_rvl(np.frombuffer(data, "<u4", count, _SIZE.size).astype(np.uint32), pixels):
        raise ValueError("a damaged image in RVL")
    return pixels.reshape(height, width)
