"""The sensor thread: everything is recorded, the newest wins, a lost sensor comes back."""

from __future__ import annotations

import threading

import numpy as np
import pytest

from spf.errors import SensorError, SessionError
from spf.live import Feed
from spf.sessions import open_session
from tests.live.sources import ABOUT, CAMERA, Scripted, finish, raw_of


def recorded(feed: Feed, path):
    feed.record(path)
    with feed:
        finish(feed)
        state = feed.state
    return open_session(path), state


def test_every_capture_is_recorded_with_all_that_is_known(tmp_path):
    session, state = recorded(Feed(Scripted(range(100))), tmp_path / "r.mcap")
    assert (len(session), state.taken, state.missing, session.warnings) == (100, 100, 0, ())
    for number in range(100):
        np.testing.assert_array_equal(session.raw_depth(number), raw_of(number))
        assert session.times_ns[number] == round(number / 30 * 1e9)
    assert (session.camera, session.depth_unit, session.side) == (CAMERA, 0.0005, "left")
    assert session.metadata == {"serial": "F7", "sensor": "fake № 7"}
    assert session.start_time_ns > 1_600_000_000 * 10**9


def test_the_newest_wins_and_the_recording_has_all(tmp_path):
    """Whoever asks late gets the last one, and loses nothing of the recording."""
    feed = Feed(Scripted([*range(5), 0.3, *range(5, 60)]))
    feed.record(tmp_path / "r.mcap")
    with feed:
        early = feed.newest()
        finish(feed)
        late = feed.newest(early.index)
        assert feed.newest(late.index, 0.01) is None
    assert early.index < 5
    assert (late.index, late.recorded, late.capture.number) == (59, 59, 59)
    assert len(open_session(tmp_path / "r.mcap")) == 60


def test_a_taken_frame_is_the_recorded_one(tmp_path):
    feed = Feed(Scripted(range(7), first_stamp_ns=[123_456_789_012]))
    session, _ = recorded(feed, tmp_path / "r.mcap")
    frame, read = feed.newest().frame(), session[6]
    assert (frame.index, frame.time, frame.camera) == (read.index, read.time, read.camera)
    np.testing.assert_array_equal(frame.depth, read.depth)


def test_gaps_in_the_sensor_s_count_are_counted_and_repeats_left_out():
    feed = Feed(Scripted([0, 1, 4, 4, 3, 5, 8]))
    with feed:
        finish(feed)
        assert (feed.state.taken, feed.state.missing, feed.state.repeated) == (5, 4, 2)


def test_a_lost_sensor_is_connected_to_again(tmp_path):
    """Its clock begins anew, twice it isn't there yet; the recording goes on with later times and says what happened."""
    gone = SensorError("Unplugged.")
    source = Scripted([0, 1, 2, gone], gone, gone, [0, 1, 2, 3], first_stamp_ns=[10**12, 0, 0, 5])
    session, state = recorded(Feed(source, retry=0.02), tmp_path / "r.mcap")
    assert (len(session), state.reconnected, state.taken) == (7, 1, 7)
    assert (np.diff(session.times_ns) > 0).all()
    assert 0.04 < session.times[3] - session.times[2] < 10  # two waits of 0.02 s
    assert [note.text for note in session.notes] == ["The sensor was lost: Unplugged.", "The sensor came back."]
    assert source.closed == 2


def test_why_a_sensor_is_away_is_said_meanwhile():
    said: set[str] = set()
    source = Scripted([0, 1, SensorError("Unplugged.")], SensorError("Busy."))
    with Feed(source, retry=0.01) as feed:
        while not {"Unplugged. Trying again.", "Busy."} <= said:
            said.add(feed.state.message)
        assert not feed.state.connected
        assert not feed.state.ended


def test_a_sensor_that_is_not_there_at_first():
    away = SensorError("There is no camera.")
    with Feed(Scripted(away)) as feed, pytest.raises(SensorError, match="There is no camera"):
        feed.about()
    with Feed(Scripted(away, away, [0]), wait=True, retry=0.01) as feed:
        assert feed.about() == ABOUT
    with Feed(Scripted(away)) as feed:
        feed.record("never.mcap")
        with pytest.raises(SensorError, match="There is no camera"):
            feed.recording_began()


def test_a_first_frame_can_be_waited_for_with_an_end(tmp_path):
    come = threading.Event()

    def script():
        while not come.wait(0.002):
            yield None
        yield 0

    with Feed(Scripted(script())) as feed:
        feed.record(tmp_path / "r.mcap")
        assert feed.opened(10)
        assert not feed.recording_began(0.01)
        come.set()
        assert feed.recording_began(10)
        finish(feed)
        assert not feed.state.failed


def test_a_sensor_that_comes_back_as_another_one_ends_the_feed():
    source = Scripted([0, SensorError("Unplugged.")], [0])
    with Feed(source, retry=0.2) as feed:
        feed.newest()
        source.about = ABOUT._replace(camera=CAMERA._replace(fx=99.0))
        finish(feed)
        assert "came back with another image size or camera" in feed.state.message
        assert feed.state.failed


def test_recordings_are_begun_and_ended_while_it_runs(tmp_path):
    stop = threading.Event()

    def forever():
        number = 0
        while not stop.is_set():
            yield number
            yield 0.002
            number += 1

    source = Scripted(forever())
    with Feed(source) as feed:
        for name in ("a", "b"):
            begin = feed.newest(feed.state.taken + 2).index
            feed.record(tmp_path / f"{name}.mcap")
            feed.recording_began()
            assert feed.note("note", "now")
            while feed.recording.frames < 10:
                feed.newest(feed.state.taken, 0.1)
            done = feed.stop_recording()
            session = open_session(done.path)
            assert (len(session), done.lost, done.ended) == (done.frames, 0, "")
            assert session.times_ns[0] == 0
            number = next(n for n in range(begin, begin + 1000) if np.array_equal(raw_of(n), session.raw_depth(0)))
            assert begin <= number
            assert [(note.kind, note.text) for note in session.notes] == [("note", "now")]
            assert feed.recording is None
        (tmp_path / "c.mcap").touch()
        feed.record(tmp_path / "c.mcap")
        with pytest.raises(SessionError, match=r"c\.mcap is already there"):
            feed.recording_began()
        assert feed.newest(feed.state.taken) is not None  # which costs the feed nothing
        assert not feed.note("marker", "")
        stop.set()


def test_a_fault_in_a_source_is_not_swallowed():
    class Broken(Scripted):
        def captures(self):
            raise ZeroDivisionError("a fault")
            yield

    with Feed(Broken([])) as feed, pytest.raises(ZeroDivisionError, match="a fault"):
        feed.newest(timeout=10)
