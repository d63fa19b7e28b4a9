"""A RealSense camera without hardware: librealsense's software device, fed with the frames of a session.

It goes through the same code of the SDK as a camera: sensor, stream profile, frame queue, time stamps.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Sequence
from types import TracebackType
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from spf.frame import Camera
from spf.live.realsense import RealSense, load_realsense
from spf.live.uri import parse_live_uri

__all__ = ["VirtualRealSense"]


class VirtualRealSense:
    """A virtual camera that can be plugged in and out.

    Args:
        camera: of its depth.
        rate: frames per second.
        serial: its number.
        depth_unit: metres per count.
    """

    def __init__(self, camera: Camera, rate: int = 30, serial: str = "V1", depth_unit: float = 0.001) -> None:
        self.rs = load_realsense()
        self.camera, self.rate, self.serial, self._unit = camera, rate, serial, depth_unit
        self.plugged = True
        self.sent = 0
        self._stop = threading.Event()
        self._thread: threading.Thread | None = None
        self._make()

    def _make(self) -> None:
        rs, camera = self.rs, self.camera
        self.device = rs.software_device()
        self.device.register_info(rs.camera_info.name, "Virtual RealSense")
        self.device.register_info(rs.camera_info.serial_number, self.serial)
        self._sensor = self.device.add_sensor("Stereo Module")
        self._sensor.add_read_only_option(rs.option.depth_units, self._unit)  # before the stream
        intrinsics = rs.intrinsics()
        intrinsics.width, intrinsics.height = camera.width, camera.height
        intrinsics.fx, intrinsics.fy, intrinsics.ppx, intrinsics.ppy = camera.fx, camera.fy, camera.cx, camera.cy
        intrinsics.model = rs.distortion.none
        stream = rs.video_stream()
        stream.type, stream.index, stream.uid, stream.fmt = rs.stream.depth, 0, 1, rs.format.z16
        stream.width, stream.height, stream.fps, stream.bpp = camera.width, camera.height, self.rate, 2
        stream.intrinsics = intrinsics
        self._profile = self._sensor.add_video_stream(stream, True).as_video_stream_profile()

    def source(self, text: str | None = None) -> RealSense:
        """Return the live source that has this camera connected, as long as it is plugged in."""
        uri = text or f"realsense:?size={self.camera.width}x{self.camera.height}&rate={self.rate}"
        return RealSense(parse_live_uri(uri), lambda: [self.device] if self.plugged else [])

    def unplug(self) -> None:
        """Take it away: it is not listed any more, and its frames stop."""
        self.plugged = False

    def plug(self) -> None:
        """Put it back; its clock and its count begin anew."""
        self.sent = 0
        self._make()
        self.plugged = True

    def send(self, raw: NDArray[np.uint16], stamp_ms: float, hardware: bool = False) -> None:
        """Give one frame, if it is plugged in and started."""
        rs = self.rs
        if not self.plugged:
            return
        frame: Any = rs.software_video_frame()
        frame.pixels, frame.bpp, frame.stride = raw.view(np.uint8).ravel(), 2, raw.shape[1] * 2
        frame.timestamp, frame.frame_number, frame.profile = stamp_ms, self.sent, self._profile
        frame.domain = rs.timestamp_domain.hardware_clock if hardware else rs.timestamp_domain.system_time
        frame.depth_units = self._unit
        self._sensor.on_video_frame(frame)
        self.sent += 1

    def play(self, frames: Sequence[NDArray[np.uint16]]) -> Self:
        """Give frames at its rate in a thread, there and back again for ever, so that the motion never jumps."""
        there_and_back = [*frames, *frames[-2:0:-1]]
        began = time.time()

        def run() -> None:
            number = 0
            while not self._stop.is_set():
                due = began + number / self.rate
                time.sleep(max(due - time.time(), 0.0))
                self.send(there_and_back[number % len(there_and_back)], due * 1e3)
                number += 1

        self._thread = threading.Thread(target=run, name="virtual camera", daemon=True)
        self._thread.start()
        return self

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._stop.set()
        if self._thread is not None:
            self._thread.join()
