"""RealSense cameras, through librealsense's own virtual device: depth, times, loss and return, and what is said."""

from __future__ import annotations

import time

import numpy as np
import pytest

pytest.importorskip("libusb_package", reason="spf[realsense] is not installed")

from benchmarks.virtual_realsense import VirtualRealSense
from spf.errors import SensorError
from spf.frame import Camera
from spf.live import Feed, open_live, realsense
from spf.live.realsense import RealSense, list_realsense
from spf.live.uri import parse_live_uri
from spf.sessions import open_session

CAMERA = Camera(64, 48, 60.5, 61.25, 31.5, 23.25)


def raw_of(number: int) -> np.ndarray:
    return np.random.default_rng(number).integers(0, 65536, (48, 64), dtype=np.uint16)


@pytest.fixture
def camera():
    with VirtualRealSense(CAMERA, depth_unit=0.0001) as made:
        yield made


def give(camera: VirtualRealSense, feed: Feed, numbers, start_ms: float, hardware: bool = False) -> None:
    """Give frames one by one, as fast as they are taken."""
    for number in numbers:
        before = feed.state.taken
        camera.send(raw_of(number), start_ms + number * 1000 / 30, hardware)
        assert feed.newest(before - 1, timeout=10) is not None


def test_depth_intrinsics_unit_and_times_come_through_the_sdk(camera, tmp_path):
    feed = Feed(camera.source())
    feed.record(tmp_path / "r.mcap")
    with feed:
        about = feed.about()
        give(camera, feed, range(20), time.time() * 1e3)
    assert (about.camera, about.depth_unit, about.rate) == (CAMERA, 0.0001, 30)
    session = open_session(tmp_path / "r.mcap")
    assert (len(session), session.camera, session.depth_unit) == (20, CAMERA, 0.0001)
    assert session.metadata["sensor"] == "Virtual RealSense"
    assert session.metadata["serial"] == "V1"
    for number in range(20):
        np.testing.assert_array_equal(session.raw_depth(number), raw_of(number))
    np.testing.assert_allclose(session.times, np.arange(20) / 30, atol=2e-6)  # the SDK's stamps are ms in double


@pytest.mark.parametrize("hardware", [False, True])
def test_when_a_frame_was_captured(camera, hardware):
    """By this computer's clock; a clock of the camera's own is set by the frame that came fastest."""
    with Feed(camera.source()) as feed:
        feed.about()
        stamp = 5_000.0 if hardware else time.time() * 1e3
        began = time.monotonic()
        for number, late in enumerate((0.0, 0.05, 0.0)):
            time.sleep(late)
            camera.send(raw_of(number), stamp + number * 10, hardware)
            taken = feed.newest(number - 1, timeout=10)
            assert began - 0.01 <= taken.capture.captured - number * 0.01 <= time.monotonic()
            assert taken.capture.time_ns == pytest.approx(number * 10_000_000, abs=2000)  # ms in double


def test_frames_lost_before_us_are_counted(camera):
    with Feed(camera.source()) as feed:
        feed.about()
        give(camera, feed, [0, 1], 0.0, hardware=True)
        camera.sent += 3
        give(camera, feed, [5, 6], 0.0, hardware=True)
        assert (feed.state.taken, feed.state.missing) == (4, 3)


def test_unplugged_and_plugged_in_again(camera, tmp_path, monkeypatch):
    monkeypatch.setattr(realsense, "_SILENCE", 0.3)
    feed = Feed(camera.source(), retry=0.02)
    feed.record(tmp_path / "r.mcap")
    with feed:
        feed.about()
        give(camera, feed, range(5), 9_000.0, hardware=True)
        camera.unplug()
        while "No RealSense camera is connected" not in feed.state.message:
            time.sleep(0.005)
        assert not feed.state.connected
        camera.plug()  # its clock begins anew
        while not feed.state.connected:
            time.sleep(0.005)
        give(camera, feed, range(5, 9), 0.0, hardware=True)
        assert (feed.state.reconnected, feed.state.message) == (1, "")
    session = open_session(tmp_path / "r.mcap")
    for number in range(9):
        np.testing.assert_array_equal(session.raw_depth(number), raw_of(number))
    assert (np.diff(session.times) > 0).all()
    assert session.times[5] - session.times[4] > 0.3
    assert [note.kind for note in session.notes] == ["event", "event"]


def test_a_silent_camera_is_told(camera, monkeypatch):
    monkeypatch.setattr(realsense, "_SILENCE", 0.1)
    with Feed(camera.source(), retry=0.5) as feed:
        while "has sent nothing for 0.1 s. Trying again." not in feed.state.message:
            time.sleep(0.005)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("realsense:?size=320x240", "no depth of 320x240 at 30 frames a second .*; it has 64x48 at 30"),
        ("realsense:?size=64x48&rate=60", "no depth of 64x48 at 60 frames a second"),
        ("realsense:?serial=77", r"No RealSense camera with serial 77 is connected.* Virtual RealSense \(serial V1\)"),
        ("realsense:?size=64", "must be like size=640x480"),
        ("realsense:77", "realsense:\\?serial=77 for a certain camera"),
        ("realsense:?fps=30", "realsense: has no option fps"),
    ],
)
def test_what_cannot_be_had_is_told(camera, text, said):
    with pytest.raises(SensorError, match=said):
        camera.source(text).open()


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ("xioctl(VIDIOC_S_FMT) failed, errno=16 Last Error: Device or resource busy", "is in use by another program"),
        ("Couldn't resolve requests", "is in use by another program"),
        ("failed to open usb interface: 0, error: RS2_USB_STATUS_ACCESS", "udev rules"),
        ("Cannot open '/dev/video0', errno=13 Last Error: Permission denied", "udev rules"),
        ("something else", "Virtual RealSense failed: something else"),
    ],
)
def test_the_sdk_s_errors_are_said_in_our_words(camera, words, said):
    class Device:
        def __getattr__(self, name):
            return getattr(camera.device, name)

        def first_depth_sensor(self):
            raise RuntimeError(words)

    uri = parse_live_uri("realsense:?size=64x48")
    with pytest.raises(SensorError, match=said):
        RealSense(uri, lambda: [Device()]).open()


def test_a_camera_can_be_closed_and_opened_again(camera):
    source = camera.source()
    for _ in range(3):
        source.open()
        source.close()
    source.close()


def test_no_camera_is_told():
    if list_realsense():
        pytest.skip("a real camera is connected")
    with pytest.raises(SensorError, match="No RealSense camera is connected: plug it into a USB 3 port"):
        open_live("realsense:").open()
