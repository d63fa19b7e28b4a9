"""``spf record`` as a user runs it: ended by its time, by Ctrl-C, by the system or by nothing at all."""

from __future__ import annotations

import json
import os
import pty
import random
import re
import signal
import subprocess
import sys
import time
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from benchmarks.kills import kill_once
from spf.cli import execute, live_track
from spf.cli.live_status import facts, in_words
from spf.errors import SensorError
from spf.live import FeedState, Recording, recorder
from spf.live.source import LiveSource
from spf.sessions import open_session
from tests.sessions.makers import make_mcap


@pytest.fixture
def made(tmp_path, rng):
    return make_mcap(tmp_path / "s.mcap", rng, frames=12)


def spf(*arguments: object, **options) -> subprocess.Popen:
    program = "import sys; from spf.cli import main; main()"
    return subprocess.Popen([sys.executable, "-c", program, *map(str, arguments)], **options)


def test_a_replay_is_recorded_to_its_end(made, tmp_path, capsys):
    out = tmp_path / "r.mcap"
    assert execute(["record", f"replay:{made.path}", "-o", str(out), "--side", "left"]) == 0
    assert "Recorded 12 frames (0.4 s" in capsys.readouterr().out
    session = open_session(out)
    np.testing.assert_array_equal([session.raw_depth(i) for i in range(12)], made.raw)
    assert session.side == "left"
    assert execute(["record", f"replay:{made.path}", "-o", str(out)]) == 2
    assert "exists already" in capsys.readouterr().err
    assert execute(["record", f"replay:{made.path}", "-o", str(out), "--force", "--json"]) == 0
    last = json.loads(capsys.readouterr().out.splitlines()[-1])
    assert (last["recorded"], last["not_recorded"], last["complete"]) == (12, 0, True)


def test_a_recording_is_named_as_what_it_is(made, tmp_path, capsys):
    out = tmp_path / "r.csv"
    assert execute(["record", f"replay:{made.path}", "-o", str(out)]) == 2
    assert f"name it something like {tmp_path / 'r.mcap'}" in " ".join(capsys.readouterr().err.split())
    assert not out.exists()


def test_how_it_stands_is_one_line_of_words():
    state = FeedState(None, False, "", 120, 2, 0, 29.6, 1, False, False)
    recording = Recording(Path("r.mcap"), 118, 0, 0, 0, 3.93, 2_540_000, 60.0, "", "")
    assert in_words({"doing": "[b]tracking", **facts(state, recording)}) == (
        "not connected · \\[b]tracking · 120 frames · 30/s · 2 lost before this computer · connected again 1× · "
        "recorded 118 frames · 3.9 s · 2.5 MB"
    )


def test_it_stops_after_its_time(made, tmp_path, capsys):
    out = tmp_path / "r.mcap"
    assert execute(["record", f"replay:{made.path}?loop=1", "-o", str(out), "--seconds", "0.7"]) == 0
    assert 0.4 < open_session(out).times[-1] < 5


@pytest.fixture
def filling_disk(monkeypatch):
    """A disk that is full a moment after a recording began."""
    free = iter([10 << 30, *range(200 << 20, 0, -1 << 20)])
    monkeypatch.setattr(recorder, "_LOOK_EVERY", 0.0)
    monkeypatch.setattr(recorder.shutil, "disk_usage", lambda _path: SimpleNamespace(free=next(free, 0)))


@pytest.mark.parametrize("command", ["record", "track"])
def test_a_disk_that_gets_full_fails_the_command_and_keeps_what_was_recorded(
    made, tmp_path, capsys, monkeypatch, filling_disk, command
):
    def find(feed, request, progress, stop):
        while not stop():
            time.sleep(0.01)

    monkeypatch.setattr(live_track, "find_live_start", find)
    out = tmp_path / "r.mcap" if command == "record" else tmp_path / "run"
    file = out if command == "record" else out / "session.mcap"
    assert execute([command, f"replay:{made.path}?loop=1", "-o", str(out), "--seconds", "60"]) == 2
    said = capsys.readouterr()
    kept = len(open_session(file))
    assert kept > 0
    assert f"Recorded {kept} frames" in said.out
    ended = "The disk is nearly full: the recording was ended, what is recorded is safe. Make room and go on in another"
    assert ended in said.err


def test_a_sensor_that_is_not_there_leaves_no_run_behind(tmp_path, capsys, monkeypatch):
    class Unplugged(LiveSource):
        def open(self, stopped):
            raise SensorError("There is no such sensor: plug it in.")

        def captures(self):
            raise AssertionError

        def close(self):
            pass

    monkeypatch.setattr(live_track, "open_live", lambda _uri: Unplugged())
    assert execute(["track", "realsense:", "-o", str(tmp_path / "runs" / "run")]) == 2
    assert "There is no such sensor" in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("found", "said"),
    [
        (
            None,
            r"The 0.5 s of --seconds were over before a hand was believed, .* give more\. \S+ has all that was seen",
        ),
        ("late", r"The 0.5 s of --seconds were over when the first pose was found, so nothing was tracked"),
    ],
)
def test_a_time_too_short_to_track_in_is_named(made, tmp_path, capsys, monkeypatch, found, said):
    def find(feed, request, progress, stop):
        while not stop():
            time.sleep(0.01)
        return found

    monkeypatch.setattr(live_track, "find_live_start", find)
    arguments = ["track", f"replay:{made.path}?loop=1", "-o", str(tmp_path / "run"), "--seconds", "0.5"]
    assert execute(arguments) == 2
    assert re.search(said, capsys.readouterr().err)
    assert [path.name for path in (tmp_path / "run").iterdir()] == ["session.mcap"]
    assert len(open_session(tmp_path / "run" / "session.mcap")) > 5


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["replay:nowhere"], "There is no file or folder nowhere"),
        (["leap:"], "leap: is no live sensor; there are realsense:, oak:, zmq://HOST:PORT and replay:SESSION."),
        (["s.mcap"], "a recording is played as if it were one with replay:s.mcap."),
        (["replay:s", "--sidde", "left"], "(see spf record --help)"),
        (["replay:s", "--side", "up"], "--side takes left or right"),
    ],
)
def test_mistakes_are_told(tmp_path, capsys, arguments, said):
    assert execute(["record", *arguments, "-o", str(tmp_path / "r.mcap")]) == 2
    assert said in capsys.readouterr().err
    assert not (tmp_path / "r.mcap").exists()


def test_a_run_and_its_recording_cannot_have_one_name(tmp_path, capsys):
    assert execute(["record", "replay:s", "-o", str(tmp_path / "r"), "--track", str(tmp_path / "r")]) == 2
    assert "--track takes a directory, and --output a file" in capsys.readouterr().err


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_ended_from_outside_it_leaves_a_whole_file(made, tmp_path, number):
    out = tmp_path / "r.mcap"
    with spf("record", f"replay:{made.path}?loop=1", "-o", out, "--json", stdout=subprocess.PIPE) as child:
        json.loads(child.stdout.readline())
        child.send_signal(number)
        last = json.loads(child.stdout.read().splitlines()[-1])
    session = open_session(out)
    assert (child.returncode, session.warnings, last["complete"]) == (0, (), True)
    assert len(session) == last["recorded"]


def test_what_it_counted_is_there_after_kill_9(made, tmp_path):
    out = tmp_path / "r.mcap"
    with spf("record", f"replay:{made.path}?loop=1&speed=5", "-o", out, "--json", stdout=subprocess.PIPE) as child:
        counted = [json.loads(child.stdout.readline())["recorded"] for _ in range(4)][-1]
        child.kill()
    session = open_session(out)
    assert len(session) >= counted > 0
    for index in range(len(session)):
        np.testing.assert_array_equal(session.raw_depth(index), made.raw[index % 12])


def test_killed_at_random_moments_no_acknowledged_frame_is_lost(made, tmp_path):
    choose = random.Random(7)
    for number in range(4):
        kill = kill_once(str(made.path), tmp_path / f"{number}.mcap", choose.uniform(0, 0.5))
        assert kill.readable >= kill.acknowledged > 0
        assert kill.wrong == 0
        assert f"{kill.readable} complete frames were recovered" in kill.told


@pytest.mark.skipif(sys.platform == "win32", reason="no pseudo-terminals on this system")
def test_what_is_typed_becomes_markers_and_notes(made, tmp_path):
    out = tmp_path / "r.mcap"
    keyboard, terminal = pty.openpty()
    options = {"stdin": terminal, "stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True}
    with spf("record", f"replay:{made.path}?loop=1", "-o", out, "--json", **options) as child:
        child.stdout.readline()
        os.write(keyboard, b"\nthumb hidden\n")
        said = [child.stderr.readline(), child.stderr.readline()]
        time.sleep(0.1)
        child.send_signal(signal.SIGINT)
        child.communicate()
    os.close(keyboard)
    os.close(terminal)
    assert said == ["spf: marker set.\n", "spf: noted: thumb hidden\n"]
    assert [(note.kind, note.text) for note in open_session(out).notes] == [("marker", ""), ("note", "thumb hidden")]
