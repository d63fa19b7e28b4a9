"""``realsense:``: Intel RealSense depth cameras through librealsense."""

from __future__ import annotations

import ctypes
import time
from collections.abc import Callable, Iterator
from types import ModuleType
from typing import Any

import numpy as np

from spf.errors import SensorError
from spf.frame import Camera
from spf.live.extras import import_extra
from spf.live.source import About, Capture, HostClock, LiveSource
from spf.live.uri import LiveUri

__all__ = ["RealSense", "list_realsense", "load_realsense"]

_OPTIONS = {"serial": "012345678901", "size": "640x480", "rate": "30"}
_WAITING = 32  # frames that wait between the camera's thread and ours
_LOOK_MS = 200  # after which a wait lets its user look whether to stop
_SILENCE = 3.0  # s without a frame after which the camera counts as lost
#: What librealsense says, and what it means for a user.
_REASONS = (
    (
        ("busy", "errno=16", "resolve requests"),
        "is in use by another program, or can't give what is asked: close the other one",
    ),
    (("permission", "access", "errno=13"), "may not be used: install librealsense's udev rules and plug it in again"),
    (("disconnected", "no device", "errno=19", "errno=5"), "was unplugged"),
)


def load_realsense() -> ModuleType:
    """Import librealsense's binding; its wheel wants a libusb, which a system may lack.

    Raises:
        SensorError: the extra is not installed.
    """
    libusb = import_extra("libusb_package", "realsense")
    ctypes.CDLL(str(libusb.get_library_path()), mode=ctypes.RTLD_GLOBAL)
    return import_extra("pyrealsense2", "realsense")


def list_realsense() -> list[str]:
    """Return a URI and name of each camera that is connected.

    Raises:
        SensorError: the extra is not installed.
    """
    rs = load_realsense()
    return [
        f"realsense:?serial={_about(rs, device, 'serial_number')} ({_about(rs, device, 'name')})"
        for device in rs.context().query_devices()
    ]


def _about(rs: ModuleType, device: Any, name: str) -> str:
    info = getattr(rs.camera_info, name)
    return str(device.get_info(info)) if device.supports(info) else ""


class RealSense(LiveSource):
    """A RealSense depth camera.

    Options: ``serial`` (else the first that is connected), ``size``, ``rate`` in frames a second.

    Args:
        uri: which camera and how.
        devices: lists the connected devices; librealsense's own list by default.

    Raises:
        SensorError: an option is wrong, or the extra is not installed.
    """

    remedy = "unplug the camera and plug it in again, at a USB 3 port"

    def __init__(self, uri: LiveUri, devices: Callable[[], list[Any]] | None = None) -> None:
        uri.check_options(_OPTIONS)
        if uri.place:
            raise SensorError(f"{uri.text} names no place: write realsense:?serial={uri.place} for a certain camera.")
        self._serial = uri.options.get("serial", "")
        self._size, self._rate = uri.size((640, 480)), int(uri.number("rate", 30, 1, 300))
        self._rs = load_realsense()
        if devices is None:
            context = self._rs.context()
            devices = lambda: list(context.query_devices())  # noqa: E731
        self._devices = devices
        self._sensor: Any = None
        self._queue: Any = None

    def open(self, stopped: Callable[[], bool] = lambda: False) -> About:
        """Open the depth sensor and start it.

        Raises:
            SensorError: there is no such camera, it has no such mode, is busy or may not be used.
        """
        rs, device = self._rs, self._find()
        name = _about(rs, device, "name") or "RealSense"
        try:
            sensor = device.first_depth_sensor()
            profile = self._profile(sensor, name)
            intrinsics, unit = profile.get_intrinsics(), float(np.float32(sensor.get_option(rs.option.depth_units)))
            sensor.open(profile)
            self._sensor, self._queue = sensor, rs.frame_queue(_WAITING, True)
            sensor.start(self._queue)
        except RuntimeError as error:
            self.close()
            raise self._said(name, error) from error
        camera = Camera(
            intrinsics.width, intrinsics.height, intrinsics.fx, intrinsics.fy, intrinsics.ppx, intrinsics.ppy
        )
        serial, firmware = _about(rs, device, "serial_number"), _about(rs, device, "firmware_version")
        bent = any(intrinsics.coeffs) and intrinsics.model != rs.distortion.none
        warnings = (f"The depth of {name} has a lens distortion, which is not undone.",) if bent else ()
        # A float32 of the device: its shortest decimal is what was meant.
        return About(
            name,
            camera,
            float(str(np.float32(unit))),
            self._rate,
            None,
            {"serial": serial, "firmware": firmware},
            warnings,
        )

    def captures(self) -> Iterator[Capture | None]:
        """Yield depth frames.

        Raises:
            SensorError: the camera is gone or silent.
        """
        rs, clock, heard = self._rs, HostClock(), time.monotonic()
        while True:
            try:
                came, frame = self._queue.try_wait_for_frame(_LOOK_MS)
            except RuntimeError as error:
                raise self._said("The camera", error) from error
            now = time.monotonic()
            if came:
                heard = now
                time_ns = round(frame.get_timestamp() * 1e6)
                hardware = frame.get_frame_timestamp_domain() == rs.timestamp_domain.hardware_clock
                # Other domains are this computer's own time of day.
                captured = clock.captured(time_ns, now) if hardware else now - max(time.time() - time_ns / 1e9, 0.0)
                yield Capture(frame.get_frame_number(), time_ns, captured, np.array(frame.get_data(), dtype=np.uint16))
            elif now - heard > _SILENCE:
                self._find()
                raise SensorError(f"The RealSense camera has sent nothing for {_SILENCE:g} s.")
            else:
                yield None

    def close(self) -> None:
        """Stop the sensor and give it back."""
        sensor, self._sensor, self._queue = self._sensor, None, None
        if sensor is not None:
            for step in (sensor.stop, sensor.close):
                try:
                    step()
                except RuntimeError:  # a camera that is gone can't be stopped, and needs not
                    continue

    def _find(self) -> Any:
        rs = self._rs
        try:
            devices = self._devices()
        except RuntimeError as error:
            raise self._said("The camera", error) from error
        for device in devices:
            if self._serial in ("", _about(rs, device, "serial_number")):
                return device
        there = ", ".join(f"{_about(rs, d, 'name')} (serial {_about(rs, d, 'serial_number')})" for d in devices)
        which = f"with serial {self._serial} " if self._serial else ""
        raise SensorError(
            f"No RealSense camera {which}is connected: plug it into a USB 3 port."
            + (f" There is {there}." if there else "")
        )

    def _profile(self, sensor: Any, name: str) -> Any:
        rs = self._rs
        depth = [
            profile.as_video_stream_profile()
            for profile in sensor.get_stream_profiles()
            if profile.stream_type() == rs.stream.depth and profile.format() == rs.format.z16
        ]
        for profile in depth:
            if ((profile.width(), profile.height()), profile.fps()) == (self._size, self._rate):
                return profile
        modes = sorted({f"{p.width()}x{p.height()} at {p.fps()}" for p in depth}, key=_first_number)
        width, height = self._size
        raise SensorError(
            f"{name} has no depth of {width}x{height} at {self._rate} frames a second (on this USB port); "
            f"it has {', '.join(modes) or 'none'}."
        )

    def _said(self, name: str, error: RuntimeError) -> SensorError:
        """Say what an error of librealsense means."""
        text = str(error)
        for signs, meaning in _REASONS:
            if any(sign in text.lower() for sign in signs):
                return SensorError(f"{name} {meaning} ({text}).")
        return SensorError(f"{name} failed: {text}.")


def _first_number(mode: str) -> int:
    return int(mode.partition("x")[0])
