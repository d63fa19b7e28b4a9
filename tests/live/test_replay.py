"""``replay:`` gives a recording at its own pace; live URIs are told from paths and their mistakes are told."""

from __future__ import annotations

import time

import numpy as np
import pytest

from spf.errors import SensorError
from spf.live import Feed, is_live, open_live
from spf.sessions import open_session
from tests.live.sources import finish
from tests.sessions.makers import make_mcap, make_png_folder, scene
from tests.sessions.ros_makers import HEIGHT, WIDTH, Topics, depth_messages, write_ros1


@pytest.fixture
def made(tmp_path, rng):
    return make_mcap(tmp_path / "s.mcap", rng, frames=9)


def test_a_replay_s_recording_is_the_session(made, tmp_path):
    feed = Feed(open_live(f"replay:{made.path}"))
    feed.record(tmp_path / "r.mcap")
    with feed:
        finish(feed)
    again = open_session(tmp_path / "r.mcap")
    assert again.fingerprint() == open_session(made.path).fingerprint()
    assert (again.side, again.metadata["replay_of"]) == ("right", "s")


def test_frames_come_when_they_are_due(made):
    source = open_live(f"replay:{made.path}")
    source.open()
    began = time.monotonic()
    for capture in source.captures():
        if capture is not None:
            assert time.monotonic() - began >= capture.number / 30 - 0.01
            assert capture.captured <= time.monotonic()
    source.close()


def test_speed_and_loop(made):
    source = open_live(f"replay:{made.path}?speed=20&loop=1")
    assert source.open().rate == pytest.approx(600)
    captures = [capture for capture, _ in zip(source.captures(), range(20), strict=False) if capture is not None]
    assert [capture.number for capture in captures] == list(range(20))
    gaps = np.diff([capture.time_ns for capture in captures])
    np.testing.assert_allclose(gaps, 1e9 / 30 / 20, rtol=1e-3)
    np.testing.assert_array_equal(captures[9 + 4].raw, made.raw[4])


def test_a_folder_with_its_camera_elsewhere(tmp_path, rng):
    made = make_png_folder(tmp_path / "p", rng)
    camera = made.path / "camera.json"
    camera.rename(tmp_path / "c.json")
    assert open_live(f"replay:{made.path}?camera={tmp_path / 'c.json'}").open().camera == made.camera


def test_what_is_chosen_of_a_recording_is_chosen_of_its_replay(tmp_path, rng):
    topics, raw = Topics(ros1=True), scene(rng, 4, WIDTH, HEIGHT)
    messages = [
        *depth_messages(topics, raw, "/left/depth/image_raw"),
        *depth_messages(topics, raw[::-1], "/right/depth/image_raw"),
    ]
    write_ros1(tmp_path / "two.bag", messages)
    with pytest.raises(SensorError, match="has several topics with depth, choose one"):
        open_live(f"replay:{tmp_path / 'two.bag'}").open()
    source = open_live(f"replay:{tmp_path / 'two.bag'}?topic=/right/depth/image_raw&unit=0.0005&speed=50")
    assert source.open().depth_unit == 0.0005
    first = next(capture for capture in source.captures() if capture is not None)
    np.testing.assert_array_equal(first.raw, raw[-1])


@pytest.mark.parametrize(
    ("uri", "said"),
    [
        ("replay:nowhere.mcap", "There is no file or folder nowhere.mcap"),
        ("replay:x?speed=fast", "speed=fast of .* must be a number from 0.01 to 100"),
        ("replay:x?speed=nan", "must be a number"),
        ("replay:x?volume=3", r"replay: has no option volume; it takes replay:\?speed=1&loop=0"),
        ("replay:x?speed", "has options that cannot be read"),
        ("replay:x?speed=1&speed=2", "gives an option twice"),
        ("replay:x?size=3", "has no option size"),
        ("leap:", r"is no live sensor; there are .*zmq://HOST:PORT and replay:SESSION\.$"),
        ("wave.mcap", r"a recording is played as if it were one with replay:wave\.mcap\."),
    ],
)
def test_mistakes_are_told(uri, said):
    with pytest.raises(SensorError, match=said):
        open_live(uri).open()


def test_live_uris_are_told_from_paths(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "replay:x").touch()
    assert is_live("replay:y")
    assert not is_live("replay:x")  # a file of that name
    assert not is_live("sessions/open-close.mcap")
    assert not is_live("C:/sessions/s.mcap")
