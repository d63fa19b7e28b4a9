"""The recorder: what is acknowledged is in the file; a slow or full disk is told before anything is lost."""

from __future__ import annotations

import errno
import os
import subprocess
import sys
import threading
import time

import numpy as np
import pytest

from spf.errors import SessionError
from spf.live import Capture, Recorder, recorder
from spf.sessions import MCAPWriter, open_session
from tests.live.sources import ABOUT, raw_of


def capture(number: int) -> Capture:
    return Capture(number, 10**9 + number * 10**7, time.monotonic(), raw_of(number))


def test_an_acknowledged_frame_is_in_the_file(tmp_path):
    path, seen = tmp_path / "r.mcap", []

    def acknowledge(index: int) -> None:
        session = open_session(path)  # while it is being recorded
        np.testing.assert_array_equal(session.raw_depth(index), raw_of(index))
        seen.append(index)

    with Recorder(path, ABOUT, capture(0), acknowledge=acknowledge) as recording:
        assert [recording.offer(capture(number)) for number in range(6)] == list(range(6))
    assert seen == list(range(6))
    assert recording.state.frames == 6


def test_markers_and_notes_come_back_with_their_times(tmp_path):
    first = capture(0)
    with Recorder(tmp_path / "r.mcap", ABOUT, first) as recording:
        recording.offer(first)
        recording.note("marker", "", first.captured + 0.5)
        recording.note("note", "thumb bent, № 3", first.captured + 1.25)
        recording.note("note", "at the same time", first.captured + 1.25)
        recording.offer(capture(1))
    notes = open_session(tmp_path / "r.mcap").notes
    assert [(round(note.time, 3), note.kind, note.text) for note in notes] == [
        (0.5, "marker", ""),
        (1.25, "note", "thumb bent, № 3"),
        (1.25, "note", "at the same time"),
    ]


def test_what_a_slow_disk_costs_is_counted_and_noted(tmp_path, monkeypatch):
    monkeypatch.setattr(recorder, "_QUEUE_BYTES", 0)
    hold = threading.Event()
    with Recorder(tmp_path / "r.mcap", ABOUT, capture(0), acknowledge=lambda _index: hold.wait()) as recording:
        recording.offer(capture(0))
        while recording.state.frames < 1:
            time.sleep(0.001)  # the disk hangs now, with the first frame in the file
        indices = [recording.offer(capture(number)) for number in range(1, 36)]
        assert indices == [*range(1, 31), None, None, None, None, None]
        assert (recording.state.lost, recording.state.queued) == (5, 30)
        hold.set()
        while recording.state.queued:
            time.sleep(0.001)
        assert recording.offer(capture(40)) == 31
    session = open_session(tmp_path / "r.mcap")
    assert (len(session), recording.state.lost) == (32, 5)
    np.testing.assert_array_equal(session.raw_depth(31), raw_of(40))
    assert [note.text for note in session.notes] == [
        "5 frames before this one were not recorded: the disk was too slow."
    ]


def test_a_disk_that_gets_full_is_told_and_the_file_ends_whole(tmp_path, monkeypatch):
    monkeypatch.setattr(recorder, "_LOOK_EVERY", 0.0)
    free = [200 << 20]
    with Recorder(tmp_path / "r.mcap", ABOUT, capture(0), free_space=lambda _path: free[0]) as recording:
        said = set()
        for number in range(400):  # until one is refused: the recorder may end between two looks at it
            index = recording.offer(capture(number))
            if index is None:
                break
            assert index == number
            while recording.state.frames <= number and not recording.state.ended:
                pass
            said.add(
                recording.state.warning.removeprefix("The disk is full in less than ").removesuffix(" s: make room.")
            )
            free[0] -= 1 << 20
        assert said <= {"", "10", "30", "60", "120"}  # a sentence a step, not a second
        assert said & {"10", "30", "60", "120"}  # before it was full
        assert "The disk is nearly full" in recording.state.ended
        assert index is None
        assert recording.state.lost == 1
    session = open_session(tmp_path / "r.mcap")
    assert (len(session), session.warnings) == (recording.state.frames, ())
    assert 100 < len(session) < 200


def test_a_full_disk_is_refused_at_once(tmp_path):
    with pytest.raises(SessionError, match="is full but for 5 MB"):
        Recorder(tmp_path / "r.mcap", ABOUT, capture(0), free_space=lambda _path: 5 << 20)
    with pytest.raises(SessionError, match="There is no folder"):
        Recorder(tmp_path / "nowhere" / "r.mcap", ABOUT, capture(0))


LIMITED = """
import resource, sys
from tests.live.test_recorder import capture
from tests.live.sources import ABOUT
from spf.live import Recorder
from pathlib import Path
resource.setrlimit(resource.RLIMIT_FSIZE, (20_000, 20_000))
with Recorder(Path(sys.argv[1]), ABOUT, capture(0)) as recording:
    for number in range(40):
        recording.offer(capture(number))
print(recording.state.frames, recording.state.lost, recording.state.ended)
"""


@pytest.mark.skipif(sys.platform == "win32", reason="no limits on the size of files")
def test_a_write_that_fails_half_way_loses_no_acknowledged_frame(tmp_path):
    """The system takes a part of a frame and refuses the rest; the file is cut where it was whole."""
    path = tmp_path / "r.mcap"
    done = subprocess.run([sys.executable, "-c", LIMITED, str(path)], capture_output=True, text=True, check=True)
    frames, lost, ended = done.stdout.split(" ", 2)
    session = open_session(path)
    assert 5 < len(session) == int(frames) == 40 - int(lost)
    assert "cannot be written: File too large. What was recorded before is safe in it" in ended
    assert "nothing but its index is missing" in session.warnings[0]
    for number in range(len(session)):
        np.testing.assert_array_equal(session.raw_depth(number), raw_of(number))


def gone(*_: object) -> None:
    raise OSError(errno.EIO, "Input/output error")


def test_a_note_that_cannot_be_written_is_no_lost_frame(tmp_path, monkeypatch):
    with Recorder(tmp_path / "r.mcap", ABOUT, capture(0)) as recording:
        recording.offer(capture(0))
        while recording.state.frames < 1:
            time.sleep(0.001)
        monkeypatch.setattr(MCAPWriter, "_add", gone)
        assert recording.note("marker", "")
        while not recording.state.ended:
            time.sleep(0.001)
        assert not recording.note("note", "too late")
    state = recording.state
    assert (state.frames, state.lost, state.notes_lost) == (1, 0, 1)
    assert state.ended.endswith("r.mcap cannot be written: Input/output error. What was recorded before is safe in it.")


def test_what_is_queued_behind_a_failed_write_is_counted_by_kind(tmp_path, monkeypatch):
    hold = threading.Event()

    def fail(*_: object) -> None:
        hold.wait()
        gone()

    monkeypatch.setattr(MCAPWriter, "_add", fail)
    with Recorder(tmp_path / "r.mcap", ABOUT, capture(0)) as recording:
        for number in range(3):
            recording.offer(capture(number))
        recording.note("note", "thumb bent")
        hold.set()
    state = recording.state
    assert (state.frames, state.queued, state.lost, state.notes_lost) == (0, 0, 3, 1)


def test_a_failed_sync_loses_nothing_that_is_written(tmp_path, monkeypatch):
    monkeypatch.setattr(recorder, "_SYNC_EVERY", 0.0)
    monkeypatch.setattr(os, "fsync", gone)
    with Recorder(tmp_path / "r.mcap", ABOUT, capture(0)) as recording:
        recording.offer(capture(0))
        while not recording.state.ended:
            time.sleep(0.001)
    assert (recording.state.frames, recording.state.lost) == (1, 0)
    np.testing.assert_array_equal(open_session(tmp_path / "r.mcap").raw_depth(0), raw_of(0))


def test_a_device_without_room_is_told(tmp_path):
    if not os.path.exists("/dev/full"):
        pytest.skip("no /dev/full on this system")
    with pytest.raises(SessionError, match="No space left on device"):
        MCAPWriter("/dev/full", camera=ABOUT.camera, overwrite=True)
