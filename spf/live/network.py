"""``zmq://host:port``: a sensor on another computer, sent by ``spf stream``; every message stands for itself.

A message has three parts: the letters ``spf1``, a JSON header with all that is known of the sensor and the frame, and the depth
counts, compressed with zstd. A receiver may come late, go away and come back; what a slow network drops is counted.
"""

from __future__ import annotations

import json
import time
from collections.abc import Callable, Iterator
from typing import Any, NamedTuple

import numpy as np
import zstandard

from spf.errors import SensorError
from spf.frame import Camera
from spf.live.extras import import_extra
from spf.live.source import About, Capture, HostClock, LiveSource
from spf.live.uri import LiveUri

__all__ = ["NetworkSource", "Publisher", "decode", "encode"]

_MAGIC = b"spf1"
_WAITING = 64  # messages that wait on each side before new ones are dropped
_FIRST = 10.0  # s that a first message is waited for
_SILENCE = 3.0  # s without a message after which the sender counts as lost
_LOOK = 0.2  # s after which a wait lets its user look whether to stop
_MOST_PIXELS = 1 << 26
_LARGEST_HEADER = 1 << 16


class Message(NamedTuple):
    """One decoded message: the stream that it is of, the sensor, and the capture with its stamps as they were sent."""

    stream: str
    about: About
    number: int
    time_ns: int
    raw: np.ndarray


def encode(stream: str, about: About, capture: Capture, level: int = 1) -> list[bytes]:
    """Encode a capture.

    Args:
        stream: new whenever a sender begins anew.
        about: the sensor.
        capture: to be sent; its colour is not.
        level: of the compression.

    Returns:
        the parts of the message.
    """
    header: dict[str, Any] = {
        "stream": stream,
        "number": capture.number,
        "time_ns": capture.time_ns,
        **about._asdict(),
        "camera": about.camera._asdict(),
        "metadata": dict(about.metadata),
    }
    counts = np.ascontiguousarray(capture.raw, dtype="<u2")
    return [_MAGIC, json.dumps(header).encode(), zstandard.ZstdCompressor(level=level).compress(counts.tobytes())]


def decode(parts: list[bytes]) -> Message:
    """Decode a message; nothing in it is trusted.

    Raises:
        SensorError: it is none of ``spf stream``, or damaged.
    """
    try:
        magic, text, packed = parts
        if magic != _MAGIC or len(text) > _LARGEST_HEADER:
            raise ValueError(magic)
        header = json.loads(text)
        camera = Camera(**header["camera"])
        size = camera.width * camera.height
        numbers = [header["depth_unit"], header["rate"], *camera[2:6]]
        sound = 0 < size <= _MOST_PIXELS and camera.model in ("pinhole", "orthographic") and np.isfinite(numbers).all()
        if not (sound and header["depth_unit"] > 0 and camera.fx > 0 and camera.fy > 0):
            raise ValueError("header")
        if zstandard.frame_content_size(packed) != 2 * size:
            raise ValueError("size")
        counts = zstandard.ZstdDecompressor().decompress(packed, max_output_size=2 * size, allow_extra_data=False)
        raw = np.frombuffer(counts, "<u2").reshape(camera.height, camera.width).astype(np.uint16, copy=False)
        side = header["side"] if header["side"] in ("left", "right") else None
        metadata = {str(key): str(value) for key, value in header["metadata"].items()}
        warnings = tuple(map(str, header["warnings"]))
        about = About(str(header["sensor"]), camera, header["depth_unit"], header["rate"], side, metadata, warnings)
        return Message(str(header["stream"]), about, int(header["number"]), int(header["time_ns"]), raw)
    except (
        ValueError,
        KeyError,
        TypeError,
        AttributeError,
        OverflowError,
        zstandard.ZstdError,
        RecursionError,
    ) as error:
        raise SensorError(
            "What is received is no depth of 'spf stream': check the address and both versions."
        ) from error


def _check_port(address: str) -> None:
    """Check the number of a port, which ZeroMQ takes modulo 65536."""
    port = address.rpartition(":")[2]
    if port.isdecimal() and int(port) > 65535:
        raise SensorError(f"{address} has no such port: ports go up to 65535.")


class NetworkSource(LiveSource):
    """Receives what ``spf stream`` sends.

    Raises:
        SensorError: pyzmq is not installed, or the URI is wrong.
    """

    warm_up = 3.0
    remedy = "start 'spf stream URI --to tcp://*:PORT' there and see that no firewall closes the port"

    def __init__(self, uri: LiveUri) -> None:
        uri.check_options({})
        self._zmq = import_extra("zmq", "stream")
        host, colon, port = uri.place.rpartition(":")
        if not (host and colon and port.isdecimal()):
            raise SensorError(f"{uri.text} must name a host and a port, as zmq://192.168.0.7:5555.")
        _check_port(uri.text)
        self._address = f"tcp://{uri.place}"
        self._socket: Any = None
        self._first: Message | None = None

    def open(self, stopped: Callable[[], bool] = lambda: False) -> About:
        """Connect, and wait for a first message.

        Raises:
            SensorError: the address is wrong, or nothing comes.
        """
        socket = self._zmq.Context.instance().socket(self._zmq.SUB)
        socket.setsockopt(self._zmq.RCVHWM, _WAITING)
        socket.setsockopt(self._zmq.LINGER, 0)
        socket.setsockopt(self._zmq.MAXMSGSIZE, 4 * _MOST_PIXELS)
        socket.setsockopt(self._zmq.SUBSCRIBE, b"")
        self._socket = socket
        try:
            socket.connect(self._address)
            until = time.monotonic() + _FIRST
            while not socket.poll(int(_LOOK * 1e3)):
                if stopped() or time.monotonic() > until:
                    raise SensorError(f"Nothing comes from {self._address}: {self.remedy}.")
            self._first = decode(socket.recv_multipart())
        except self._zmq.ZMQError as error:
            self.close()
            raise SensorError(f"{self._address} cannot be connected to: {error}.") from error
        except SensorError:
            self.close()
            raise
        return self._first.about

    def captures(self) -> Iterator[Capture | None]:
        """Yield what comes.

        Raises:
            SensorError: nothing comes any more, the sender began anew, or what comes is damaged.
        """
        message, clock, heard = self._first, HostClock(), time.monotonic()
        assert message is not None
        stream, about = message.stream, message.about
        while True:
            if message is not None:
                if message.stream != stream or message.about != about:
                    raise SensorError(f"The sender at {self._address} began anew.")
                heard = time.monotonic()
                captured = clock.captured(message.time_ns, heard)
                yield Capture(message.number, message.time_ns, captured, message.raw)
            elif time.monotonic() - heard > _SILENCE:
                raise SensorError(f"Nothing comes from {self._address} any more: the sender or the network is gone.")
            else:
                yield None
            message = decode(self._socket.recv_multipart()) if self._socket.poll(int(_LOOK * 1e3)) else None

    def close(self) -> None:
        """Disconnect."""
        if self._socket is not None:
            self._socket.close()
            self._socket = None


class Publisher:
    """Sends captures to whoever connects; who is too slow loses frames, and slows nobody.

    Args:
        address: to offer them at, as ``tcp://*:5555``.

    Raises:
        SensorError: pyzmq is not installed, or the address cannot be offered.
    """

    def __init__(self, address: str) -> None:
        zmq = import_extra("zmq", "stream")
        _check_port(address)
        self._stream = str(time.time_ns())
        self._socket = zmq.Context.instance().socket(zmq.PUB)
        self._socket.setsockopt(zmq.SNDHWM, _WAITING)
        self._socket.setsockopt(zmq.LINGER, 200)
        try:
            self._socket.bind(address)
        except zmq.ZMQError as error:
            self._socket.close()
            raise SensorError(
                f"{address} cannot be offered here ({error}): give tcp://*:PORT with a free port; the tracker connects to it."
            ) from error
        self.address = str(self._socket.getsockopt(zmq.LAST_ENDPOINT).decode())

    def send(self, about: About, capture: Capture) -> None:
        """Send a capture, without waiting."""
        self._socket.send_multipart(encode(self._stream, about, capture))

    def close(self) -> None:
        """Stop sending."""
        self._socket.close()
