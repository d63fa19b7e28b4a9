"""OAK cameras, through DepthAI's own pipeline and queues, with a host node in the place of the device's stereo."""

from __future__ import annotations

import queue
import time

import numpy as np
import pytest

from spf.errors import SensorError
from spf.frame import Camera
from spf.live import Feed, oak, open_live
from spf.live.oak import Oak, Opened
from spf.live.uri import parse_live_uri
from spf.sessions import open_session

dai = pytest.importorskip("depthai", reason="spf[oak] is not installed")
CAMERA = Camera(64, 48, 60.5, 61.25, 31.5, 23.25)
MATRIX = [[60.5, 0, 31.5], [0, 61.25, 23.25], [0, 0, 1]]


def raw_of(number: int) -> np.ndarray:
    return np.random.default_rng(number).integers(0, 65536, (48, 64), dtype=np.uint16)


class Stereo(dai.node.ThreadedHostNode):
    """Sends what a test puts into its queue; ends at None."""

    def __init__(self, todo: queue.Queue, matrix) -> None:
        dai.node.ThreadedHostNode.__init__(self)
        self.depth = self.createOutput()
        self._todo, self._matrix = todo, matrix

    def run(self) -> None:
        while self.isRunning() and (number := self._todo.get()) is not None:
            frame = dai.ImgFrame()
            frame.setType(dai.ImgFrame.Type.RAW16)
            frame.setWidth(64)
            frame.setHeight(48)
            frame.setSequenceNum(number)
            frame.setTimestamp(dai.Clock.now())
            if self._matrix is not None:
                frame.setTransformation(dai.ImgTransformation(64, 48, self._matrix))
            frame.setData(raw_of(number).view(np.uint8).ravel())
            self.depth.send(frame)


class Host:
    """Opens host pipelines instead of a device's."""

    def __init__(self, matrix=MATRIX) -> None:
        self.todo: queue.Queue = queue.Queue()
        self.matrix = matrix
        self.failures: list[RuntimeError] = []
        self.pipeline = None

    def __call__(self, module, serial, size, rate) -> Opened:
        if self.failures:
            raise self.failures.pop(0)
        self.pipeline = module.Pipeline(createImplicitDevice=False)
        node = self.pipeline.create(Stereo, self.todo, self.matrix)
        frames = node.depth.createOutputQueue(maxSize=32, blocking=False)
        self.pipeline.start()
        return Opened(self.pipeline, frames, "OAK-D № 1", "ABC")


@pytest.fixture
def host():
    made = Host()
    yield made
    made.todo.put(None)


def source(host: Host, text: str = "oak:") -> Oak:
    return Oak(parse_live_uri(text), host)


def give(host: Host, feed: Feed, numbers) -> None:
    """Give frames one by one, as fast as they are taken."""
    for number in numbers:
        before = feed.state.taken
        host.todo.put(number)
        assert feed.newest(before - 1, timeout=10) is not None


def test_depth_intrinsics_and_times_come_through_the_sdk(host, tmp_path):
    feed = Feed(source(host))
    feed.record(tmp_path / "r.mcap")
    began = time.monotonic()
    with feed:
        give(host, feed, [0, 1, 2, 5, 6])
        taken = feed.newest()
        assert began <= taken.capture.captured <= time.monotonic()
        assert (feed.about().camera, feed.about().depth_unit, feed.state.missing) == (CAMERA, 0.001, 2)
        host.todo.put(None)
    session = open_session(tmp_path / "r.mcap")
    assert (len(session), session.camera) == (5, CAMERA)
    assert session.metadata == {"sensor": "OAK-D № 1", "serial": "ABC"}
    for index, number in enumerate([0, 1, 2, 5, 6]):
        np.testing.assert_array_equal(session.raw_depth(index), raw_of(number))
    assert 0 < session.times[-1] < time.monotonic() - began


def test_a_device_that_goes_and_comes_back(host, monkeypatch):
    monkeypatch.setattr(oak, "_SILENCE", 0.3)
    with Feed(source(host), retry=0.02) as feed:
        give(host, feed, [0, 1, 2])
        host.failures = [RuntimeError("No available devices"), RuntimeError("X_LINK_DEVICE_ALREADY_IN_USE")]
        host.todo.put(None)  # the node ends, and nothing comes any more
        said = set()
        while not {"lost", "away", "busy"} <= said:
            message = feed.state.message
            said |= {"lost"} if "Trying again." in message else set()
            said |= {"away"} if "is not connected: plug it in" in message else set()
            said |= {"busy"} if "is in use by another program" in message else set()
        give(host, feed, [0, 1])
        assert (feed.state.taken, feed.state.reconnected) == (5, 1)
        host.todo.put(None)


def test_a_device_that_sends_nothing_is_told(host, monkeypatch):
    monkeypatch.setattr(oak, "_FIRST", 0.3)
    host.todo.put(None)
    with pytest.raises(SensorError, match=r"has sent no depth for 0\.3 s"):
        source(host).open()


def test_unknown_intrinsics_are_told():
    host = Host(matrix=None)
    host.todo.put(0)
    host.todo.put(None)
    with pytest.raises(SensorError, match="doesn't say its intrinsics"):
        source(host).open()


def test_no_camera_is_told():
    if oak.list_oak():
        pytest.skip("a real camera is connected")
    with pytest.raises(SensorError, match="is not connected: plug it in"):
        open_live("oak:").open()


def test_wrong_options_are_told(host):
    for text, said in (
        ("oak:?size=big", "must be like size"),
        ("oak:?fps=3", "has no option fps"),
        ("oak:1", "serial=1"),
    ):
        with pytest.raises(SensorError, match=said):
            source(host, text)
