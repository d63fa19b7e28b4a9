"""Joints that a person marked: kept beside any session or within a native one, read as truth, nothing recorded lost."""

import json
import shutil

import numpy as np
import pytest
from mcap.reader import make_reader

from spf.errors import SessionError
from spf.evaluate import evaluate_run
from spf.frame import JOINT_NAMES
from spf.runs import read_run, reopen_session
from spf.sessions import Mark, keep_marks, marks_in, open_session, with_marks, write_session
from spf.sessions.marks import count_marks, marks_file, marks_from_csv, marks_to_csv, marks_to_json, merged
from spf.sessions.mcap_marks import embed_marks
from tests.made_runs import LOST, kept_run, made_session

TIP, WRIST = JOINT_NAMES.index("index_tip"), 0
MARKS = {
    1: {"index_tip": Mark((0.01, -0.02, 0.4), 0.005), "wrist": Mark((0.0, 0.05, 0.41)), "little_tip": Mark(None)},
    3: {"wrist": Mark((0.001, 0.05, 0.42), 0.015)},
}


@pytest.fixture
def native(tmp_path):
    """The path of a native session of eight frames with an exact truth."""
    path = tmp_path / "take.mcap"
    write_session(made_session(), path)
    return path


@pytest.fixture
def folder(tmp_path):
    """The path of a read-only foreign recording without truth."""
    session = made_session(4)
    camera = session.camera
    path = tmp_path / "room.npz"
    np.savez(
        path, depth=np.stack([session.raw_depth(i) for i in range(4)]), depth_unit=session.depth_unit,
        fx=camera.fx, fy=camera.fy, cx=camera.cx, cy=camera.cy,
    )  # fmt: skip
    return path


def same(marks, other):
    """Whether marks are equal; an unknown offset equals an unknown one."""
    return marks_to_json(marks, 9, (1, 1)) == marks_to_json(other, 9, (1, 1))


def test_marks_beside_a_foreign_recording_are_its_truth(folder):
    before = folder.read_bytes()
    session = open_session(folder)
    assert not session.has_truth
    keep_marks(session, MARKS)
    opened = open_session(folder)
    assert folder.read_bytes() == before
    assert marks_file(folder).name == "room.npz.marks.json"
    assert same(marks_in(opened), MARKS)
    assert opened.has_truth
    assert opened.joint_definition == "marks"
    assert opened.fingerprint() == session.fingerprint()
    assert opened[0].truth is None
    joints = opened[1].truth.joints
    assert joints[TIP] == pytest.approx([0.01, -0.02, 0.4])
    assert np.isfinite(joints).all(axis=1).sum() == 2  # a hidden joint is none
    assert opened.metadata["marks"] == "2 frames with 3 joints marked by hand"


def test_marks_stand_in_for_the_recorded_truth_joint_by_joint(native):
    recorded = open_session(native)
    keep_marks(recorded, MARKS)
    opened = open_session(native)
    was, now = recorded[1].truth, opened[1].truth
    assert now.joints[TIP] == pytest.approx([0.01, -0.02, 0.4])
    assert now.joints[5] == pytest.approx(was.joints[5])
    assert now.pose is None
    assert was.pose is not None
    assert opened[0].truth.pose is not None
    assert any("marked by hand" in warning for warning in opened.warnings)
    assert opened.joint_definition == "model"
    assert same(marks_in(with_marks(opened, {})), {})
    assert with_marks(opened, {})[1].truth.joints[TIP] == pytest.approx(was.joints[TIP])


def test_marks_within_a_native_file_leave_every_byte_before_its_end(native):
    before, session = native.read_bytes(), open_session(native)
    for marks in ({2: {"wrist": Mark((0.0, 0.0, 0.5))}}, MARKS):
        embed_marks(native, marks_to_json(marks, len(session), (session.camera.width, session.camera.height)))
    opened = open_session(native)
    assert same(marks_in(opened), MARKS)
    end = len(before) - before[::-1].index(bytes([15])[::-1])
    after = native.read_bytes()
    common = next(i for i, (a, b) in enumerate(zip(before, after, strict=False)) if a != b)
    assert common > 0.9 * end * 0.9
    for index in range(len(session)):  # the session that was open, and the one opened now
        assert (session.raw_depth(index) == opened.raw_depth(index)).all()
    assert session[1].truth.pose == pytest.approx(open_session(native).inner[1].truth.pose)
    with native.open("rb") as file:  # the format's own library
        reader = make_reader(file, validate_crcs=True)
        summary = reader.get_summary()
        assert summary.statistics.metadata_count == 4
        assert sum(1 for _ in reader.iter_messages()) == summary.statistics.message_count
        assert [record.name for record in reader.iter_metadata()].count("spf.marks") == 1
    assert not list(native.parent.glob(".*.part"))


def test_the_file_beside_is_newer_than_what_is_within(native):
    session = open_session(native)
    embed_marks(native, marks_to_json(MARKS, len(session), (session.camera.width, session.camera.height)))
    keep_marks(open_session(native), {5: {"wrist": Mark((0.0, 0.0, 0.5))}})
    assert list(marks_in(open_session(native))) == [5]
    keep_marks(open_session(native), {})
    assert marks_in(open_session(native)) == {}


def test_a_torn_file_holds_no_marks_and_stays_as_it_is(native):
    whole = native.read_bytes()
    native.write_bytes(whole[: int(0.8 * len(whole))])
    with pytest.raises(SessionError, match="was torn"):
        embed_marks(native, "{}")
    assert native.read_bytes() == whole[: int(0.8 * len(whole))]


def test_conversion_takes_marks_along_as_truth(folder, tmp_path):
    keep_marks(open_session(folder), MARKS)
    write_session(open_session(folder), tmp_path / "out.mcap")
    converted = open_session(tmp_path / "out.mcap")
    assert converted.joint_definition == "marks"
    assert converted[1].truth.joints[TIP] == pytest.approx([0.01, -0.02, 0.4])
    assert converted[0].truth is None


def test_a_run_is_evaluated_over_the_joints_that_are_marked(tmp_path):
    session = made_session()
    path, native = tmp_path / "room.npz", tmp_path / "take.mcap"
    write_session(session, native)
    camera = session.camera
    np.savez(
        path, depth=np.stack([session.raw_depth(i) for i in range(8)]), depth_unit=session.depth_unit,
        times_ns=session.times_ns, fx=camera.fx, fy=camera.fy, cx=camera.cx, cy=camera.cy,
    )  # fmt: skip
    kept_run(open_session(path), tmp_path / "run") if False else kept_run(open_session(native), tmp_path / "run")
    run = read_run(tmp_path / "run")
    off = np.array([0.003, 0.0, 0.004])
    marked = {
        index: {JOINT_NAMES[j]: Mark(tuple(run.track.joints[index, j] + off)) for j in joints}
        for index, joints in ((0, (0, 8)), (6, (4,)))
    }
    assert not set(marked) & set(LOST)
    keep_marks(open_session(path), marked)
    foreign = open_session(path)
    measures = evaluate_run(run, foreign)
    assert measures["frames_with_truth"] == 2
    assert measures["joints_compared"] == measures["joints_marked_by_hand"] == 3
    assert measures["mean_joint_error_mm"] == pytest.approx(5.0)
    assert measures["joint_error_mm"]["index_tip"] == pytest.approx(5.0)
    assert measures["joint_error_mm"]["ring_tip"] is None
    assert "by hand" in measures["correction"]
    keep_marks(open_session(native), marked)  # and where there is a truth, the marks of those joints are taken
    assert evaluate_run(run, reopen_session(run.manifest))["joint_error_mm"]["wrist"] > 0.5


def test_csv_there_and_back():
    assert same(marks_from_csv(marks_to_csv(MARKS), 8, "marks.csv"), MARKS)
    short = "frame,joint,x_m,y_m,z_m\n2,wrist,0.1,0.2,0.5\n"
    assert marks_from_csv(short, 8, "marks.csv")[2]["wrist"].point == (0.1, 0.2, 0.5)
    assert count_marks(merged(MARKS, marks_from_csv(short, 8, "x"))) == (3, 4)


@pytest.mark.parametrize(
    ("line", "words"),
    [
        ("9,wrist,0,0,0.5", "frame 9"),
        ("1,elbow,0,0,0.5", "'elbow'"),
        ("1,wrist,0,zero,0.5", "not all numbers"),
        ("1,wrist,0,0,-0.5", "where no hand is"),
        ("1,wrist,0,0,nan", "where no hand is"),
        ("1,wrist,0,0,512", "where no hand is"),
        ("1,wrist,0,0,0.5\n1,wrist,0,0,0.5", "twice"),
    ],
)
def test_a_mistaken_csv_is_one_sentence(line, words):
    with pytest.raises(SessionError, match=words):
        marks_from_csv(f"frame,joint,x_m,y_m,z_m\n{line}\n", 8, "marks.csv")
    with pytest.raises(SessionError, match="lacks the column x_m"):
        marks_from_csv("frame,joint\n", 8, "marks.csv")


@pytest.mark.parametrize(
    ("content", "words"),
    [
        ("{", "torn or no marks"),
        ('{"format": "other"}', "torn or no marks"),
        (marks_to_json(MARKS, 7, (320, 240)), "another recording"),
    ],
)
def test_damaged_marks_are_refused_and_kept(native, content, words):
    beside = marks_file(native)
    beside.write_text(content)
    with pytest.raises(SessionError, match=words):
        open_session(native)
    assert beside.read_text() == content


def test_a_folder_that_cannot_be_written_says_so(native, monkeypatch):
    session = open_session(native)
    shutil.copy(native, native.parent / "kept")
    (native.parent / f".{marks_file(native).name}.part").mkdir()
    with pytest.raises(SessionError, match="cannot be written"):
        keep_marks(session, MARKS)
    assert json.loads(json.dumps(1)) == 1
