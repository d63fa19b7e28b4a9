"""PNG images, whole or refused: OpenCV shows the readable part of a torn file without a word, a tracker must not."""

from __future__ import annotations

import struct
import zlib
from pathlib import Path
from typing import Any, NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from spf.errors import SessionError

__all__ = ["PngHeader", "decode_depth_png", "png_header", "read_colour_png", "read_depth_png", "read_packed_depth_png"]

_SIGNATURE = b"\x89PNG\r\n\x1a\n"
_GREY, _RGB = 0, 2
_MOST_PIXELS = 2**26  # of an image; a header that says more is damaged, and OpenCV would take the memory for it
_KINDS = {0: "grey", 2: "colour", 3: "palette", 4: "grey with alpha", 6: "colour with alpha"}


class PngHeader(NamedTuple):
    """What a PNG says of itself before its pixels.

    Attributes:
        width, height: in pixels.
        bits: per channel.
        kind: the PNG colour type.
    """

    width: int
    height: int
    bits: int
    kind: int

    def __str__(self) -> str:
        return f"{self.width}×{self.height} {self.bits}-bit {_KINDS.get(self.kind, 'unknown')} PNG"


def png_header(path: Path) -> PngHeader:
    """Read the header of a PNG without its pixels.

    Raises:
        SessionError: the file is missing, empty or no PNG.
    """
    return _header(_read(path, 33), path)


def read_depth_png(path: Path) -> NDArray[np.uint16]:
    """Read a 16-bit grey PNG.

    Returns:
        (H, W) raw counts.

    Raises:
        SessionError: the file is missing, empty, torn, or no 16-bit grey PNG.
    """
    raw: NDArray[np.uint16] = _decode(
        path, bits=16, kind=_GREY, wanted="a 16-bit grey PNG: store depth as uint16 counts"
    )
    return raw


def decode_depth_png(data: bytes, name: str) -> NDArray[np.uint16]:
    """Decode the bytes of a 16-bit grey PNG.

    Args:
        data: of the image.
        name: of the image, for messages.

    Returns:
        (H, W) raw counts.

    Raises:
        SessionError: it is torn, or no 16-bit grey PNG.
    """
    raw: NDArray[np.uint16] = _decode_bytes(data, name, bits=16, kind=_GREY, wanted="a 16-bit grey PNG")
    return raw


def read_packed_depth_png(path: Path) -> NDArray[np.uint16]:
    """Read depth packed in an 8-bit colour PNG: high byte in green, low byte in blue (NYU).

    Returns:
        (H, W) raw counts.

    Raises:
        SessionError: the file is missing, empty, torn, or no 8-bit colour PNG.
    """
    image = _decode(path, bits=8, kind=_RGB, wanted="an 8-bit colour PNG with depth in green and blue")
    blue, green = image[..., 0].astype(np.uint16), image[..., 1].astype(np.uint16)
    packed: NDArray[np.uint16] = np.bitwise_or(np.left_shift(green, 8), blue)
    return packed


def read_colour_png(path: Path) -> NDArray[np.uint8]:
    """Read an 8-bit colour PNG.

    Returns:
        (H, W, 3) RGB.

    Raises:
        SessionError: the file is missing, empty, torn, or no 8-bit colour PNG.
    """
    image = _decode(path, bits=8, kind=_RGB, wanted="an 8-bit colour PNG")
    return np.ascontiguousarray(image[..., ::-1], dtype=np.uint8)


def _read(path: Path, size: int = -1) -> bytes:
    try:
        with path.open("rb") as file:
            return file.read(size)
    except OSError as error:
        raise SessionError(f"The image {path} cannot be read: {error.strerror}.") from error


def _header(data: bytes, name: object) -> PngHeader:
    if not data:
        raise SessionError(f"The image {name} is empty (0 bytes): copy it again, or take it out of the folder.")
    if not data.startswith(_SIGNATURE) or len(data) < 33:
        raise SessionError(f"The file {name} is not a PNG image: copy it again, or take it out of the folder.")
    width, height, bits, kind = struct.unpack(">IIBB", data[16:26])
    if width * height > _MOST_PIXELS:
        raise SessionError(
            f"The image {name} says that it is {width}×{height}, which no depth image is: copy it again."
        )
    return PngHeader(width, height, bits, kind)


def _is_whole(data: bytes) -> bool:
    position = len(_SIGNATURE)
    while position + 12 <= len(data):
        (length,) = struct.unpack_from(">I", data, position)
        end = position + 8 + length
        if end + 4 > len(data) or zlib.crc32(data[position + 4 : end]) != struct.unpack_from(">I", data, end)[0]:
            return False
        if data[position + 4 : position + 8] == b"IEND":
            return True
        position = end + 4
    return False


def _decode(path: Path, bits: int, kind: int, wanted: str) -> NDArray[Any]:
    return _decode_bytes(_read(path), path, bits, kind, wanted)


def _decode_bytes(data: bytes, name: object, bits: int, kind: int, wanted: str) -> NDArray[Any]:
    header = _header(data, name)
    if (header.bits, header.kind) != (bits, kind):
        raise SessionError(f"The image {name} is a {header}, not {wanted}.")
    image = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_UNCHANGED) if _is_whole(data) else None
    if image is None:
        raise SessionError(f"The image {name} is torn: copy it again, or take it out of the folder.")
    return image
