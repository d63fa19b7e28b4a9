"""JPEG images, which the colour of some recordings is stored as."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from spf.errors import SessionError

__all__ = ["read_jpeg"]

_START, _END = b"\xff\xd8", b"\xff\xd9"
_LARGEST = 2**26  # bytes of a file


def read_jpeg(path: Path) -> NDArray[np.uint8]:
    """Read a colour JPEG.

    Returns:
        (H, W, 3) RGB.

    Raises:
        SessionError: the file is missing, torn, or no JPEG.
    """
    try:
        with path.open("rb") as file:
            data = file.read(_LARGEST)
    except OSError as error:
        raise SessionError(f"The image {path} cannot be read: {error.strerror}.") from error
    image = None
    if data.startswith(_START) and data.rstrip(b"\0").endswith(_END):
        try:
            image = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_COLOR)
        except cv2.error:
            image = None  # an image larger than OpenCV takes
    if image is None:
        raise SessionError(f"The image {path} is torn or no JPEG: copy it again, or take it out of the folder.")
    return np.ascontiguousarray(image[..., ::-1], dtype=np.uint8)
