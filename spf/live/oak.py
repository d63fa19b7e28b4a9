"""``oak:``: Luxonis OAK stereo cameras through DepthAI 3."""

from __future__ import annotations

import datetime
import time
from collections.abc import Callable, Iterator
from typing import Any, NamedTuple

import numpy as np

from spf.errors import SensorError
from spf.frame import Camera
from spf.live.extras import import_extra
from spf.live.source import About, Capture, LiveSource
from spf.live.uri import LiveUri

__all__ = ["Oak", "Opened", "list_oak", "open_stereo"]

_OPTIONS = {"serial": "14442C10D13F7FD000", "size": "640x400", "rate": "30"}
_WAITING = 32  # frames that wait between the device's thread and ours
_LOOK = 0.005  # s between two looks for a frame: short beside a frame time
_NONE_AFTER = 0.2  # s after which a wait lets its user look whether to stop
_FIRST = 15.0  # s that the first frame is waited for: the device boots
_SILENCE = 3.0  # s without a frame after which the camera counts as lost
_MM = 0.001  # stereo depth is in millimetres
_REASONS = (
    (("x_link_device_already_in_use", "busy", "already in use"), "is in use by another program: close it"),
    (
        ("insufficient_permissions", "permission"),
        "may not be used: install its udev rule (SUBSYSTEM usb, idVendor 03e7)",
    ),
    (("no available devices", "cannot find", "device_not_found"), "is not connected: plug it in"),
)


class Opened(NamedTuple):
    """A running pipeline.

    Attributes:
        pipeline: to be stopped.
        queue: of depth frames (RAW16, mm).
        name, serial: of the device.
    """

    pipeline: Any
    queue: Any
    name: str
    serial: str


def list_oak() -> list[str]:
    """Return a URI and name of each camera that is connected.

    Raises:
        SensorError: the extra is not installed.
    """
    found = import_extra("depthai", "oak").Device.getAllAvailableDevices()
    return [f"oak:?serial={device.getDeviceId()} ({device.name})" for device in found]


def open_stereo(dai: Any, serial: str, size: tuple[int, int], rate: float) -> Opened:
    """Start the stereo depth of a device; needs one."""
    device = dai.Device(dai.DeviceInfo(serial)) if serial else dai.Device()
    pipeline = dai.Pipeline(device)
    left, right = (
        pipeline.create(dai.node.Camera).build(socket, sensorFps=rate)
        for socket in (dai.CameraBoardSocket.CAM_B, dai.CameraBoardSocket.CAM_C)
    )
    stereo = pipeline.create(dai.node.StereoDepth)
    stereo.setLeftRightCheck(True)
    stereo.setSubpixel(True)
    left.requestOutput(size).link(stereo.left)
    right.requestOutput(size).link(stereo.right)
    queue = stereo.depth.createOutputQueue(maxSize=_WAITING, blocking=False)
    pipeline.start()
    return Opened(pipeline, queue, str(device.getDeviceName()), str(device.getDeviceId()))


class Oak(LiveSource):
    """An OAK stereo camera; its depth comes in millimetres, rectified.

    Options: ``serial`` (else the first that is connected), ``size``, ``rate`` in frames a second.

    Args:
        uri: which camera and how.
        opener: starts the pipeline: that of a device by default.

    Raises:
        SensorError: an option is wrong, or the extra is not installed.
    """

    warm_up = _FIRST
    remedy = "unplug the camera and plug it in again"

    def __init__(self, uri: LiveUri, opener: Callable[..., Opened] = open_stereo) -> None:
        uri.check_options(_OPTIONS)
        if uri.place:
            raise SensorError(f"{uri.text} names no place: write oak:?serial={uri.place} for a certain camera.")
        self._serial, self._size = uri.options.get("serial", ""), uri.size((640, 400))
        self._rate, self._opener = uri.number("rate", 30, 1, 200), opener
        self._dai = import_extra("depthai", "oak")
        self._opened: Opened | None = None
        self._first: Any = None

    def open(self, stopped: Callable[[], bool] = lambda: False) -> About:
        """Start the pipeline and wait for its first frame, which says what camera took it.

        Raises:
            SensorError: there is no such camera, it is busy, may not be used or sends nothing.
        """
        try:
            self._opened = self._opener(self._dai, self._serial, self._size, self._rate)
        except RuntimeError as error:
            raise self._said(error) from error
        until = time.monotonic() + _FIRST
        while (first := self._next()) is None:
            if stopped() or time.monotonic() > until:
                self.close()
                raise SensorError(f"The OAK camera has sent no depth for {_FIRST:g} s: {self.remedy}.")
        self._first = first
        try:
            camera = self._camera(first)
        except SensorError:
            self.close()
            raise
        serial = self._opened.serial
        return About(self._opened.name or "OAK", camera, _MM, self._rate, None, {"serial": serial})

    def captures(self) -> Iterator[Capture | None]:
        """Yield depth frames.

        Raises:
            SensorError: the camera is gone or silent.
        """
        frame, heard = self._first, time.monotonic()
        while True:
            if frame is not None:
                heard = time.monotonic()
                stamp: datetime.timedelta = frame.getTimestamp()
                # DepthAI gives its stamps on a clock of this computer, from which they are a fixed while away.
                age = max((self._dai.Clock.now() - stamp).total_seconds(), 0.0)
                time_ns = (stamp // datetime.timedelta(microseconds=1)) * 1000
                yield Capture(frame.getSequenceNum(), time_ns, heard - age, np.array(frame.getFrame(), dtype=np.uint16))
            elif time.monotonic() - heard > _SILENCE:
                raise SensorError(f"The OAK camera has sent nothing for {_SILENCE:g} s.")
            else:
                yield None
            frame = self._next()

    def close(self) -> None:
        """Stop the pipeline."""
        opened, self._opened, self._first = self._opened, None, None
        if opened is not None:
            opened.pipeline.stop()
            opened.pipeline.wait()

    def _next(self) -> Any:
        """Return the next frame, None when none comes for a while."""
        assert self._opened is not None
        until = time.monotonic() + _NONE_AFTER
        try:
            while (frame := self._opened.queue.tryGet()) is None:
                if not self._opened.pipeline.isRunning():
                    raise SensorError("The OAK camera was unplugged, or stopped.")
                if time.monotonic() > until:
                    return None
                time.sleep(_LOOK)
        except RuntimeError as error:
            raise self._said(error) from error
        return frame

    def _camera(self, frame: Any) -> Camera:
        matrix = frame.getTransformation().getIntrinsicMatrix()
        (fx, _, cx), (_, fy, cy), _ = matrix
        if fx <= 2 or fy <= 2:  # the unit matrix: nothing is known
            raise SensorError("The OAK camera doesn't say its intrinsics: calibrate it with the maker's tool.")
        return Camera(int(frame.getWidth()), int(frame.getHeight()), float(fx), float(fy), float(cx), float(cy))

    def _said(self, error: RuntimeError) -> SensorError:
        """Say what an error of DepthAI means."""
        text = str(error)
        for signs, meaning in _REASONS:
            if any(sign in text.lower() for sign in signs):
                return SensorError(f"The OAK camera {meaning} ({text}).")
        return SensorError(f"The OAK camera failed: {text}.")
