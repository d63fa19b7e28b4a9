"""A run kept in a directory: what is written is read back, what was tracked is kept, and a repetition is identical."""

import json
import subprocess
import sys
import tracemalloc
from dataclasses import fields
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest

from spf.errors import RunError
from spf.hand.kinematics import joints_of
from spf.hand.shape import SHAPE_PARAMETERS
from spf.manifest import Plan, manifest_of, plan_of
from spf.prepare import prepare
from spf.runs import RunWriter, check_free, read_run, reopen_session, track_plan
from spf.sessions import open_session, write_session
from spf.synthetic import SyntheticSettings, synthesise
from spf.trackers import make_settings
from spf.trackfile import joined, read_track, rows_of, track_of

FRAMES = 40
COLUMNS = ("frame", "lost", "recovered", "poses", "references", "joints", "log_likelihood", "ess", "golden", "overlap")


@pytest.fixture(scope="module")
def session(tmp_path_factory):
    path = tmp_path_factory.mktemp("session") / "made.mcap"
    write_session(synthesise(SyntheticSettings(frames=FRAMES, seed=2)), path)
    return open_session(path)


def plan_for(session, first=0, last=FRAMES, begin=0):
    start = prepare(session, init="truth", first=begin)
    return Plan("spf", "default", make_settings("spf", changes={"k": "1.5"}), 7, "truth", first, last, start)


def keep(session, plan, directory, most=None):
    manifest = manifest_of(plan, session, None, ["spf", "track"])
    with RunWriter(directory, manifest, plan.start.shape.hand().dof_names) as writer:
        for result in track_plan(session, plan):
            writer.add(result)
            if len(writer.track) == most:
                raise KeyboardInterrupt


@pytest.fixture(scope="module")
def kept(session, tmp_path_factory):
    directory = tmp_path_factory.mktemp("runs") / "first"
    keep(session, plan_for(session), directory)
    return directory


def test_what_is_written_is_read_back(session, kept):
    run = read_run(kept)
    plan = plan_for(session)
    assert run.plan._replace(start=None) == plan._replace(start=None)
    assert (run.plan.start.shape, run.plan.start.golden) == (plan.start.shape, plan.start.golden)
    np.testing.assert_array_equal(run.plan.start.pose, plan.start.pose)
    assert run.manifest["complete"] is True
    assert run.manifest["frames_tracked"] == len(run.track) == FRAMES
    np.testing.assert_array_equal(run.track.frame, np.arange(FRAMES))
    assert run.track.poses.shape == (FRAMES, 26)
    assert run.track.joints.shape == (FRAMES, 21, 3)
    np.testing.assert_allclose(
        run.track.references @ run.track.references.transpose(0, 2, 1), np.eye(3) + np.zeros((FRAMES, 3, 3)), atol=1e-9
    )
    assert {"observe", "optimise", "weigh"} <= run.track.timings.keys()
    assert (run.track.evaluations > 0).all()
    names = pq.read_schema(kept / "track.parquet").names
    assert {"frame", "time", "pose_palm_x", "pose_little_pip_flexion", "joint_wrist_x", "joint_little_tip_z"} <= set(
        names
    )


def test_a_run_repeated_from_its_manifest_is_identical(kept, tmp_path):
    first = read_run(kept)
    keep(reopen_session(first.manifest), first.plan, tmp_path / "again")
    second = read_run(tmp_path / "again")
    for name in COLUMNS:
        np.testing.assert_array_equal(getattr(first.track, name), getattr(second.track, name), err_msg=name)


def test_what_was_tracked_is_kept_when_it_is_stopped(session, kept, tmp_path):
    with pytest.raises(KeyboardInterrupt):
        keep(session, plan_for(session), tmp_path / "run", most=4)
    run = read_run(tmp_path / "run")
    assert run.manifest["complete"] is False
    assert run.manifest["frames_tracked"] == len(run.track) == 4
    np.testing.assert_array_equal(run.track.poses, read_run(kept).track.poses[:4])


def test_frames_before_the_first_pose_are_without_a_hand(session, tmp_path):
    keep(session, plan_for(session, first=2, last=7, begin=5), tmp_path / "run")
    track = read_run(tmp_path / "run").track
    assert track.frame.tolist() == [2, 3, 4, 5, 6]
    assert track.lost.tolist() == [True, True, True, False, False]
    assert np.isnan(track.ess[:3]).all()
    assert (track.seconds[:3] == 0).all()


def test_a_run_is_not_written_over(kept, tmp_path):
    with pytest.raises(RunError, match="holds a run already"):
        check_free(kept, False)
    check_free(kept, True)
    (tmp_path / "notes.txt").write_text("mine")
    with pytest.raises(RunError, match="holds other things"):
        check_free(tmp_path, True)
    with pytest.raises(RunError, match="is a file"):
        check_free(tmp_path / "notes.txt", True)
    check_free(tmp_path / "new", False)


def test_another_recording_is_noticed(kept, tmp_path):
    write_session(synthesise(SyntheticSettings(frames=3, seed=3)), tmp_path / "other.mcap")
    with pytest.raises(RunError, match="is not the recording of this run"):
        reopen_session(read_run(kept).manifest, tmp_path / "other.mcap")


@pytest.mark.parametrize("name", ["tracker", "settings", "seed", "frames", "start"])
def test_a_manifest_that_lacks_something(kept, name):
    manifest = json.loads((kept / "manifest.json").read_text())
    del manifest[name]
    with pytest.raises(RunError, match="damaged or of another version"):
        plan_of(manifest)


def test_runs_that_cannot_be_read(kept, tmp_path):
    with pytest.raises(RunError, match="is no run"):
        read_run(tmp_path)
    (tmp_path / "manifest.json").write_text('{"format"')
    with pytest.raises(RunError, match="torn or not JSON"):
        read_run(tmp_path)
    (tmp_path / "manifest.json").write_text("{}")
    with pytest.raises(RunError, match="no manifest"):
        read_run(tmp_path)
    (tmp_path / "manifest.json").write_bytes((kept / "manifest.json").read_bytes())
    with pytest.raises(RunError, match="cannot be read"):
        read_run(tmp_path)
    (tmp_path / "track.parquet").write_bytes((kept / "track.parquet").read_bytes()[:-100])
    with pytest.raises(RunError, match="torn or no Parquet"):
        read_run(tmp_path)


def test_parts_of_a_run_are_joined_to_one_track(kept):
    track = read_run(kept).track
    rows = rows_of(track)
    bare = [row._replace(result=row.result._replace(timings={})) for row in rows[:5]]  # as where the hand is lost
    whole = track_of([*bare, *rows[5:]], track.dof_names)
    parts = joined([track_of(part, track.dof_names) for part in ([], bare, rows[5:6], rows[6:])])
    assert whole.timings.keys() == parts.timings.keys()
    for name in (field.name for field in fields(whole)):
        if name == "timings":
            for stage in whole.timings:
                np.testing.assert_array_equal(whole.timings[stage], parts.timings[stage])
        else:
            np.testing.assert_array_equal(getattr(whole, name), getattr(parts, name))


@pytest.mark.skipif(not Path("/proc/self/task").is_dir(), reason="counts the threads of a process as Linux tells them")
def test_reading_a_run_leaves_no_thread_behind(kept):
    """One that still held the file when the program ended aborted it, now and then."""
    code = (
        "import os, sys; from pathlib import Path; from spf.trackfile import read_track; "
        "before = len(os.listdir('/proc/self/task')); read_track(Path(sys.argv[1])); "
        "print(len(os.listdir('/proc/self/task')) - before)"
    )
    done = subprocess.run(
        [sys.executable, "-c", code, str(kept / "track.parquet")], capture_output=True, text=True, check=True
    )
    assert done.stdout == "0\n"


def test_a_long_run_takes_little_memory(kept, tmp_path):
    """Hours of a live run: no objects of the tracker are kept, only the numbers that are written."""
    run = read_run(kept)
    rows = rows_of(run.track)
    manifest = {key: value for key, value in run.manifest.items() if key not in ("complete", "frames_tracked")}
    with RunWriter(tmp_path / "run", manifest, run.track.dof_names) as writer:
        for _ in range(10):
            writer.add(rows[0].result)
        tracemalloc.start()
        try:
            for number in range(2000):
                result = rows[number % len(rows)].result
                writer.add(result._replace(pose=result.pose.copy(), joints=result.joints.copy()))
            kept_bytes, _ = tracemalloc.get_traced_memory()
        finally:
            tracemalloc.stop()
    assert kept_bytes < 2000 * 1300
    assert len(read_run(tmp_path / "run").track) == 2010


def test_the_hand_of_a_frame_has_the_shape_that_it_was_tracked_with(kept):
    run = read_run(kept)
    last, changes = len(run.track) - 1, run.track.shape_changes
    np.testing.assert_array_equal(changes[0], np.zeros(len(SHAPE_PARAMETERS)))
    assert changes[last].any()  # a shape that was refined on the way
    for row in (0, last):
        hand = run.hand_at(row)
        joints = joints_of(hand, run.track.poses[row], run.track.references[row])
        np.testing.assert_allclose(joints, run.track.joints[row], atol=1e-9)


def test_a_track_of_an_older_build_is_read(kept, tmp_path):
    table = pq.read_table(kept / "track.parquet")
    newer = [name for name in table.column_names if name == "winner" or name.startswith("shape_")]
    assert len(newer) == 1 + len(SHAPE_PARAMETERS)
    pq.write_table(table.drop_columns(newer), tmp_path / "track.parquet")
    track = read_track(tmp_path / "track.parquet")
    assert not track.shape_changes.any()
    assert set(track.winner) == {""}
    np.testing.assert_array_equal(track.poses, read_run(kept).track.poses)
