"""ROS messages that hold depth: images, compressed images, CameraInfo, decoded from ROS 1 or ROS 2 (CDR) bytes.

The decoder reads only what it needs and takes no size on trust. It is our own because the recordings that people have
do not all obey their message definitions: librealsense leaves four bytes behind its ROS 1 images.
"""

from __future__ import annotations

import struct
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from spf.sessions.png import decode_depth_png
from spf.sessions.rectify import Lens
from spf.sessions.rvl import decode_rvl

__all__ = ["CAMERA_INFO", "COMPRESSED", "IMAGE", "CameraInfo", "Image", "Wire", "decode_camera_info", "decode_image"]

IMAGE = "sensor_msgs/msg/Image"
COMPRESSED = "sensor_msgs/msg/CompressedImage"
CAMERA_INFO = "sensor_msgs/msg/CameraInfo"

#: Encodings that are depth: NumPy type without its byte order, and metres per count where the encoding says it
#: (REP 118: integers are mm, floating point is metres).
_DEPTH = {"16UC1": "u2", "mono16": "u2", "32FC1": "f4"}
_CONFIG = struct.Struct("<iff")


class Wire:
    """A cursor over an encoded message.

    Args:
        data: the message.
        cdr: encoded as in ROS 2 (aligned, with a header that tells the byte order), else as in ROS 1.
    """

    def __init__(self, data: bytes, cdr: bool) -> None:
        self._data, self._cdr, self._position = data, cdr, 4 if cdr else 0
        if cdr and len(data) < 4:
            raise ValueError("an empty message")
        self._order = ">" if cdr and not data[1] & 1 else "<"

    def _take(self, size: int) -> bytes:
        found = self._data[self._position : self._position + size]
        if size < 0 or len(found) < size:
            raise ValueError("a message that ends too early")
        self._position += size
        return found

    def _align(self, size: int) -> None:
        if self._cdr:
            self._position += (4 - self._position) % size  # alignment counts from behind the 4 bytes of the CDR header

    def number(self, kind: str = "I") -> Any:
        """Read a number of a :mod:`struct` kind."""
        size = struct.calcsize(kind)
        self._align(size)
        return struct.unpack(self._order + kind, self._take(size))[0]

    def numbers(self, kind: str, count: int) -> list[Any]:
        """Read an array of numbers of fixed length."""
        if not 0 <= count <= len(self._data):
            raise ValueError("an array longer than its message")
        return [self.number(kind) for _ in range(count)]

    def blob(self) -> bytes:
        """Read an array of bytes."""
        return self._take(self.number())

    def text(self) -> str:
        """Read a string."""
        return self.blob().rstrip(b"\0").decode("utf-8", "replace")

    def stamp(self) -> int:
        """Read the first part of a header: its time in ns."""
        if not self._cdr:
            self.number()  # ROS 1 counts messages here
        seconds = self.number("I")
        return int(seconds * 10**9 + self.number("I"))


class Image(NamedTuple):
    """A depth image as it was recorded.

    Attributes:
        stamp_ns: time in its header.
        frame_id: whose coordinates it is in.
        encoding: ``16UC1``, ``mono16`` or ``32FC1`` for depth, else whatever it is.
        pixels: (H, W) uint16 counts or float32 metres, None if it is not depth.
    """

    stamp_ns: int
    frame_id: str
    encoding: str
    pixels: NDArray[np.uint16] | NDArray[np.float32] | None

    def counts(self, unit: float) -> NDArray[np.uint16]:
        """Return (H, W) counts; metres are rounded to the unit, and are no reading where they are no number or too far.

        Raises:
            ValueError: it is not a depth image.
        """
        if self.pixels is None:
            raise ValueError(f"an image with encoding {self.encoding}")
        if self.pixels.dtype == np.uint16:
            return self.pixels.astype(np.uint16)
        return metres_to_counts(self.pixels, unit)


class CameraInfo(NamedTuple):
    """What a CameraInfo says.

    Attributes:
        frame_id: whose coordinates it is about.
        lens: camera and distortion of the unrectified image; its focal lengths are 0 when it was never calibrated.
        rectified: fx, fy, cx, cy of the rectified image.
    """

    frame_id: str
    lens: Lens
    rectified: tuple[float, float, float, float]


def metres_to_counts(metres: NDArray[Any], unit: float) -> NDArray[np.uint16]:
    """Return counts of a unit in metres; 0 where it is no number, not positive, or too far for 16 bits."""
    with np.errstate(invalid="ignore", over="ignore"):
        counts = np.rint(metres.astype(np.float64) / unit)
        return np.where((counts > 0) & (counts <= 65535), counts, 0).astype(np.uint16)


def decode_image(data: bytes, kind: str, cdr: bool) -> Image:
    """Decode an Image or a CompressedImage.

    Raises:
        ValueError, struct.error: it is damaged.
    """
    wire = Wire(data, cdr)
    stamp, frame = wire.stamp(), wire.text()
    if kind == COMPRESSED:
        return _decode_compressed(wire, stamp, frame)
    height, width, encoding = wire.number(), wire.number(), wire.text()
    order, step, pixels = ">" if wire.number("B") else "<", wire.number(), wire.blob()
    if encoding not in _DEPTH:
        return Image(stamp, frame, encoding, None)
    dtype = np.dtype(order + _DEPTH[encoding])
    if not (0 < width <= step // dtype.itemsize and height > 0 and step * height <= len(pixels)):
        raise ValueError(f"an image of {width}×{height} with {len(pixels)} bytes")
    rows = np.frombuffer(pixels, np.uint8, step * height).reshape(height, step)[:, : width * dtype.itemsize]
    image = np.ascontiguousarray(rows).view(dtype).astype(dtype.newbyteorder("="))
    return Image(stamp, frame, encoding, image)


def _decode_compressed(wire: Wire, stamp: int, frame: str) -> Image:
    """Decode a compressedDepth image: 12 bytes of settings, then counts or quantised inverse depth, as PNG or in RVL."""
    layout, data = wire.text(), wire.blob()
    encoding, _, transport = (part.strip() for part in layout.partition(";"))
    if "compressedDepth" not in transport or encoding not in _DEPTH:
        return Image(stamp, frame, layout, None)
    _, a, b = _CONFIG.unpack_from(data)
    image = data[_CONFIG.size :]
    is_rvl = "rvl" in transport.lower()
    stored = decode_rvl(image) if is_rvl else decode_depth_png(image, "the compressedDepth image")
    if encoding != "32FC1":
        return Image(stamp, frame, encoding, stored)
    with np.errstate(divide="ignore", invalid="ignore"):
        depth = np.where(stored > 0, a / (stored.astype(np.float32) - np.float32(b)), np.nan)
    return Image(stamp, frame, encoding, depth.astype(np.float32))


def decode_camera_info(data: bytes, cdr: bool) -> CameraInfo:
    """Decode a CameraInfo.

    Raises:
        ValueError, struct.error: it is damaged.
    """
    wire = Wire(data, cdr)
    wire.stamp()
    frame, height, width, model = wire.text(), wire.number(), wire.number(), wire.text()
    distortion = wire.numbers("d", wire.number())
    k, _, p = wire.numbers("d", 9), wire.numbers("d", 9), wire.numbers("d", 12)
    lens = Lens(width, height, k[0], k[4], k[2], k[5], model, tuple(distortion))
    return CameraInfo(frame, lens, (p[0], p[5], p[2], p[6]))
