"""The commands, end to end on small synthetic sessions."""

import json
import signal
import subprocess
import sys
import time

import numpy as np
import pytest

from spf import __version__
from spf.cli import execute
from spf.hand.shape import read_hand_shape
from spf.presets import Presets
from spf.runs import read_run
from spf.sessions import MCAPWriter, Note, open_session, write_session
from spf.synthetic import SyntheticSettings, synthesise
from spf.trackers import make_settings


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    path = tmp_path_factory.mktemp("made") / "made.mcap"
    write_session(synthesise(SyntheticSettings(frames=10, seed=5)), path)
    return path


@pytest.fixture(scope="module")
def run(made, tmp_path_factory):
    directory = tmp_path_factory.mktemp("runs") / "run"
    assert execute(["track", str(made), "-o", str(directory), "--init", "truth", "--set", "n=2", "--set", "k=2"]) == 0
    return directory


def test_help_and_version(capsys):
    assert execute([]) == 0
    text = capsys.readouterr().out
    for command in ("info", "convert", "synth", "calibrate", "track", "evaluate", "report", "export", "doctor"):
        assert command in text
        assert execute([command, "--help"]) == 0
        assert "spf " + command in capsys.readouterr().out
    assert execute(["--version"]) == 0
    assert capsys.readouterr().out == f"spf {__version__}\n"


def test_info(made, capsys):
    assert execute(["info", str(made), "--json"]) == 0
    facts = json.loads(capsys.readouterr().out)
    assert (facts["frames"], facts["side"], facts["truth"], facts["size"]) == (10, "right", "model", [320, 240])
    assert 0.2 < facts["depth_m"][1] < 0.6
    assert execute(["info", str(made)]) == 0
    assert "320, 240" in capsys.readouterr().out


def test_a_preset_saved_in_the_page_is_tracked_with_by_name_and_by_file(made, tmp_path, monkeypatch, capsys):
    monkeypatch.setenv("SPF_PRESETS", str(tmp_path))
    Presets().save("smd", "my hand", make_settings("smd", "default", {"k": "2.5"}))
    file = str(tmp_path / "my hand.smd.json")
    for number, preset in enumerate(("my hand", file)):
        options = ["--tracker", "smd", "--preset", preset, "--init", "truth", "--frames", "0:3", "--set", "mu=0.03"]
        assert execute(["track", str(made), "-o", str(tmp_path / f"run{number}"), *options]) == 0
        plan = read_run(tmp_path / f"run{number}").plan
        assert (plan.preset, plan.settings.k, plan.settings.mu) == ("my hand", 2.5, 0.03)
    capsys.readouterr()
    for options, says in ((["--preset", file], "of the tracker smd"), (["--preset", "none"], "There is no preset 'none'"),
                          (["--preset", str(tmp_path / "none.json")], "cannot be read")):  # fmt: skip
        assert execute(["track", str(made), "-o", str(tmp_path / "x"), "--init", "truth", *options]) != 0
        assert says in " ".join(capsys.readouterr().err.split())


def test_synth_and_convert(tmp_path, capsys):
    made, part = tmp_path / "a.mcap", tmp_path / "b.mcap"
    options = ["--motion", "pinch", "--sensor", "kinect2", "--frames", "6", "--side", "left", "--set", "holes=0.1"]
    assert execute(["synth", str(made), *options]) == 0
    session = open_session(made)
    assert (len(session), session.side, session.camera.width) == (6, "left", 512)
    assert execute(["convert", str(made), str(part), "--frames", "2:5"]) == 0
    clipped = open_session(part)
    assert len(clipped) == 3
    np.testing.assert_array_equal(clipped.raw_depth(0), session.raw_depth(2))
    np.testing.assert_allclose(clipped[1].truth.joints, session[3].truth.joints)
    assert clipped.hand_shape == session.hand_shape
    assert [path.name for path in sorted(tmp_path.iterdir())] == ["a.mcap", "b.mcap"]
    assert "Next: spf track" in capsys.readouterr().out


def test_track_and_evaluate(run, capsys):
    kept = read_run(run)
    assert (kept.plan.settings.n, kept.plan.settings.k) == (2, 2.0)
    assert len(kept.track) == 10
    capsys.readouterr()
    assert execute(["evaluate", str(run), "--json"]) == 0
    captured = capsys.readouterr()
    measures = json.loads(captured.out)
    assert captured.err == ""
    assert measures["frames"] == 10
    assert 0.0 < measures["mean_joint_error_mm"] < 30.0
    assert set(measures["frames_max_error_under_mm"]) == {"20", "30", "40"}
    for name in ("median_joint_error_mm", "fingertip_error_mm", "auc_0_50mm", "seconds_per_frame_median", "losses"):
        assert measures[name] is not None
    assert execute(["evaluate", str(run)]) == 0
    assert "mean_joint_error_mm" in capsys.readouterr().out


def test_repeat_is_identical(run, made, tmp_path, capsys):
    assert execute(["track", "--repeat", str(run), "-o", str(tmp_path / "again"), "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["frames"] == 10
    first, second = read_run(run).track, read_run(tmp_path / "again").track
    np.testing.assert_array_equal(first.poses, second.poses)
    np.testing.assert_array_equal(first.log_likelihood, second.log_likelihood)


def test_calibrate_and_track_from_its_files(made, tmp_path, capsys):
    hand, pose, directory = (tmp_path / name for name in ("hand.json", "pose.json", "run"))
    assert execute(["calibrate", str(made), "-o", str(hand), "--pose", str(pose)]) == 0
    assert "hand of" in capsys.readouterr().out
    options = ["--hand", str(hand), "--init", str(pose), "--tracker", "smd", "--frames", ":4"]
    assert execute(["track", str(made), "-o", str(directory), *options]) == 0
    kept = read_run(directory)
    assert len(kept.track) == 4 - kept.plan.first
    assert kept.plan.start.shape.to_dict() == json.loads(hand.read_text())


def test_force_replaces_a_run(made, run, tmp_path):
    directory = tmp_path / "run"
    options = ["track", str(made), "-o", str(directory), "--init", "truth", "--frames"]
    assert execute([*options, "0:2"]) == 0
    assert execute([*options, "0:3"]) == 2
    assert execute([*options, "0:3", "--force"]) == 0
    assert len(read_run(directory).track) == 3


def test_ctrl_c_keeps_what_is_tracked(tmp_path):
    session, directory = tmp_path / "long.mcap", tmp_path / "run"
    write_session(synthesise(SyntheticSettings(frames=200)), session)
    command = "import sys; from spf.cli import main; main()"
    options = ["track", str(session), "-o", str(directory), "--init", "truth", "--set", "n=64", "--set", "rounds=30"]
    process = subprocess.Popen([sys.executable, "-c", command, *options], stderr=subprocess.PIPE, text=True)
    while not (directory / "manifest.json").exists():  # the tracker is about to begin
        assert process.poll() is None
        time.sleep(0.1)
    time.sleep(3.0)
    process.send_signal(signal.SIGINT)
    _, told = process.communicate(timeout=120)
    assert process.returncode == 130
    assert told.startswith("spf: stopped: the ")
    assert told.count("\n") == 1
    kept = read_run(directory)
    assert kept.manifest["complete"] is False
    assert len(kept.track) == kept.manifest["frames_tracked"] < 200


def test_report_and_export(run, tmp_path, capsys):
    page, table = tmp_path / "run.html", tmp_path / "track.csv"
    assert execute(["report", str(run), "-o", str(page)]) == 0
    assert "open it in any browser" in capsys.readouterr().out
    assert "http" not in page.read_text()
    assert execute(["report", str(run), "-o", str(page)]) == 2
    assert execute(["report", str(run), "-o", str(page), "--no-session", "--force"]) == 0
    assert "Written without the session" in page.read_text()
    assert execute(["export", str(run), "-o", str(table)]) == 0
    assert len(table.read_text().splitlines()) == 11
    assert execute(["export", str(run), "-o", str(tmp_path / "hand.json")]) == 0
    assert read_hand_shape(tmp_path / "hand.json") == read_run(run).shape_at(9)


def test_doctor(monkeypatch, capsys):
    from spf.cli import results
    from spf.doctor import Check

    monkeypatch.setattr(results, "examine", lambda: (Check("Sun", True, "shines"),))
    assert execute(["doctor"]) == 0
    assert "shines" in capsys.readouterr().out
    monkeypatch.setattr(results, "examine", lambda: (Check("Sun", False, "none", "wait"),))
    assert execute(["doctor", "--json"]) == 1
    assert json.loads(capsys.readouterr().out)[0]["advice"] == "wait"


def test_trim_and_split_keep_every_frame_exactly(tmp_path, capsys):
    whole, middle = tmp_path / "whole.mcap", tmp_path / "middle.mcap"
    session = synthesise(SyntheticSettings(frames=8, seed=3))
    options = {"camera": session.camera, "depth_unit": session.depth_unit, "side": "right", "start_time_ns": 10**18}
    with MCAPWriter(whole, **options) as writer:
        for frame in session:
            writer.write(frame)
        writer.add_note(Note(-0.2, "event", "before"))
        writer.add_note(Note(session.times[1] + 0.01, "marker", "early"))
        writer.add_note(Note(session.times[4], "note", "here"))
        writer.add_note(Note(session.times[7] + 0.5, "event", "The sensor was lost."))
    source = open_session(whole)
    assert execute(["trim", str(whole), "3:6", str(middle)]) == 0
    assert execute(["split", str(whole), str(tmp_path / "part.mcap"), "--at", "2,5"]) == 0
    parts = [open_session(tmp_path / f"part-{number}.mcap") for number in (1, 2, 3)]
    assert [len(part) for part in parts] == [2, 3, 3]
    for first, part in [(3, open_session(middle)), (0, parts[0]), (2, parts[1]), (5, parts[2])]:
        assert (part.camera, part.side, part.depth_unit) == (source.camera, "right", source.depth_unit)
        assert part.start_time_ns == source.start_time_ns + source.times_ns[first]
        np.testing.assert_array_equal(
            part.times_ns, source.times_ns[first : first + len(part)] - source.times_ns[first]
        )
        for index in range(len(part)):
            np.testing.assert_array_equal(part.raw_depth(index), source.raw_depth(first + index))
            np.testing.assert_array_equal(part.truth(index).joints, source.truth(first + index).joints)
    assert [(note.kind, note.text) for note in open_session(middle).notes] == [("note", "here")]
    assert [[note.text for note in part.notes] for part in parts] == [
        ["before", "early"], ["here"], ["The sensor was lost."],
    ]  # fmt: skip
    assert execute(["info", str(parts[0].uri)]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert "recorded            2001-09-09 01:46:40 UTC" in lines
    assert [line.split() for line in lines if "event" in line or "marker" in line] == [
        ["notes", "-0.2", "s", "event:", "before"], ["0.0", "s", "marker:", "early"],
    ]  # fmt: skip
    assert open_session(middle).notes[0].time == pytest.approx(source.times[4] - source.times[3])
    capsys.readouterr()
    for wrong in (["trim", str(whole), "5:99", str(tmp_path / "x.mcap")], ["trim", str(whole), "1:2", str(middle)]):
        assert execute(wrong) == 2
    for at in ("0", "8", "5,2", "x"):
        assert execute(["split", str(whole), str(tmp_path / "x.mcap"), "--at", at]) == 2
    assert not list(tmp_path.glob("x*"))
