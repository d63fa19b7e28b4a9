"""Live tracking: the newest frame wins, a hand that leaves is found again, a kept run can be repeated bit for bit."""

from __future__ import annotations

import json
import time

import numpy as np
import pytest

from spf.cli import execute
from spf.hand import HandShape, write_hand_shape
from spf.live import About, Capture, Feed, LiveSource
from spf.live import tracking as live_tracking
from spf.live.keeping import LiveRun
from spf.live.tracking import Request, find_live_start, follow
from spf.prepare import prepare
from spf.runs import check_same_session, read_run, track_plan
from spf.sessions import open_session, write_session
from spf.synthetic import SyntheticSettings, synthesise
from spf.trackers import make_settings

REQUEST = Request("spf", "default", make_settings("spf", "default", {"n": "2"}))


class Held(LiveSource):
    """A session whose next frame comes when the test says that so many may have been given."""

    def __init__(self, session) -> None:
        self.session, self.allowed = session, 0

    def open(self, stopped=lambda: False) -> About:
        return About("held", self.session.camera, self.session.depth_unit, 30.0, self.session.side)

    def captures(self):
        for index in range(len(self.session)):
            while index >= self.allowed:
                time.sleep(0.001)
                yield None
            raw = self.session.raw_depth(index)
            yield Capture(index, int(self.session.times_ns[index]), time.monotonic(), raw)

    def close(self) -> None: ...


@pytest.fixture(scope="module")
def leaving():
    """A hand that is away in frames 6 to 13."""
    return synthesise(SyntheticSettings(frames=24, seed=3, absent_from=6, absent_frames=8, clutter="none", speed_mm=4))


def test_a_hand_that_leaves_is_lost_and_found_when_it_returns(leaving):
    start = prepare(leaving, init="truth")
    source = Held(leaving)
    lost, errors = {}, {}
    with Feed(source) as feed:
        source.allowed = 1
        feed.newest(timeout=10)
        for tracked in follow(feed, REQUEST, start):
            index = tracked.frame.index
            lost[index] = tracked.result.lost
            if (truth := leaving.truth(index)) is not None:
                errors[index] = np.linalg.norm(tracked.result.joints - truth.joints, axis=1).mean()
            assert tracked.latency > 0
            source.allowed = index + 2
    assert list(lost) == list(range(24))  # one at a time: nothing is dropped
    assert not any(lost[index] for index in range(2))  # it then leaves the view, by 12 cm a frame at last
    assert all(lost[index] for index in range(9, 14))
    assert not any(lost[index] for index in range(20, 24))
    assert errors[23] < 0.012


def test_the_newest_frame_wins_and_the_run_is_repeated_from_its_recording(leaving, tmp_path):
    start = prepare(leaving, init="truth")
    source, steps = Held(leaving), iter([5, 6, 17, 18, 20, 24])
    feed = Feed(source)
    feed.record(tmp_path / "r.mcap")
    with feed:
        source.allowed = 3
        while feed.state.taken < 3:
            feed.newest(feed.state.taken, 0.01)
        kept = LiveRun(tmp_path / "run", tmp_path / "r.mcap", "held:", REQUEST, start, ["spf"])
        with kept:
            frames = []
            for tracked in follow(feed, REQUEST, start):
                frames.append((tracked.frame.index, tracked.dropped))
                kept.add(tracked)
                source.allowed = next(steps, 24)
                while feed.state.taken < source.allowed:  # the tracker is slow: meanwhile all of them come
                    feed.newest(feed.state.taken, 0.01)
            feed.stop_recording()
            kept.finish()
    assert frames == [(2, 0), (4, 1), (5, 0), (16, 10), (17, 0), (19, 1), (23, 3)]
    run, session = read_run(tmp_path / "run"), open_session(tmp_path / "r.mcap")
    check_same_session(run.manifest, session)
    assert len(session) == 24
    assert (run.manifest["live"]["uri"], run.manifest["live"]["dropped"]) == ("held:", 15)
    assert run.manifest["live"]["latency_ms_p95"] > 0
    again = list(track_plan(session, run.plan, run.track.frame.tolist()))
    np.testing.assert_array_equal([result.joints for result in again], run.track.joints)
    np.testing.assert_array_equal([result.time for result in again], run.track.time)
    assert execute(["track", "--repeat", str(tmp_path / "run"), "-o", str(tmp_path / "again")]) == 0
    repeated = read_run(tmp_path / "again")
    np.testing.assert_array_equal(repeated.track.joints, run.track.joints)
    assert repeated.manifest["live"] == run.manifest["live"]


def test_a_scene_without_a_hand_is_told_and_a_start_stops_when_asked(monkeypatch):
    monkeypatch.setattr(live_tracking, "_LOOKED_AT", 4)
    empty = synthesise(SyntheticSettings(frames=12, absent_from=0, absent_frames=12, clutter="none"))
    source, said = Held(empty), []
    source.allowed = 12
    with Feed(source) as feed:
        assert find_live_start(feed, REQUEST, lambda text, _share: said.append(text)) is None  # the feed ended
    with Feed(Held(empty)) as feed:
        assert find_live_start(feed, REQUEST, lambda text, _share: None, lambda: True) is None
    assert said[0] == "Waiting for frames"


def test_the_command_tracks_a_replay_live(tmp_path, capsys):
    session = synthesise(SyntheticSettings(frames=80, seed=2, speed_mm=4))
    write_session(session, tmp_path / "s.mcap")
    write_hand_shape(HandShape.from_dict(session.hand_shape, "it"), tmp_path / "hand.json")
    uri, run = f"replay:{tmp_path / 's.mcap'}?loop=1&speed=0.2", tmp_path / "run"
    arguments = ["track", uri, "-o", str(run), "--hand", str(tmp_path / "hand.json"), "--seconds", "25", "--set", "n=2"]
    assert execute([*arguments, "--json"]) == 0
    lines = [json.loads(line) for line in capsys.readouterr().out.splitlines()]
    assert lines[-1]["not_recorded"] == 0
    kept = read_run(run)
    assert kept.manifest["complete"]
    recorded = open_session(run / "session.mcap")
    assert len(recorded) == lines[-1]["recorded"]
    assert not kept.track.lost[-1]
    truth = np.stack([session.truth(index % 80).joints for index in kept.track.frame])
    assert np.median(np.linalg.norm(kept.track.joints - truth, axis=2).mean(axis=1)) < 0.012
    assert execute(arguments) == 2
    assert "holds a run already" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (
            ["track", "replay:s", "--frames", "0:3"],
            "A live sensor is tracked from where it is found on: leave out --frames",
        ),
        (["track", "replay:s", "--init", "truth"], "leave out --init"),
        (["track", "sessions/open-close.mcap", "--seconds", "3"], "--seconds and --wait are for live sensors"),
    ],
)
def test_options_that_do_not_fit_are_told(tmp_path, capsys, arguments, said):
    assert execute([*arguments, "-o", str(tmp_path / "run")]) == 2
    assert said in capsys.readouterr().err


def test_a_live_uri_given_for_a_session_is_told(capsys):
    assert execute(["info", "zmq://box:5555"]) == 2
    assert "is a live sensor: 'spf record zmq://box:5555 -o FILE' records it" in capsys.readouterr().err
    assert execute(["info", "replay:sessions/open-close.mcap"]) == 2
    assert "give the recording itself, sessions/open-close.mcap." in capsys.readouterr().err
