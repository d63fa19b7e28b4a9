"""Joints marked in the page, without a browser: placed at the surface and behind it, kept at once, taken onward, undone."""

import shutil

import numpy as np
import pytest

from app.marking import Marking
from app.placing import depth_beneath, skin_offsets
from spf.frame import JOINT_NAMES
from spf.sessions import marks_in, open_session
from spf.sessions.marks import marks_file


@pytest.fixture
def take(sample, tmp_path):
    """The path of a session that may be marked."""
    path = tmp_path / "take.mcap"
    shutil.copy(sample, path)
    return path


@pytest.fixture
def marking(page, take, act):
    """The marks of a page that shows its first frame."""
    state, controller = page
    marking = Marking(controller)
    act(lambda: controller.open(str(take)))
    assert state.error == ""
    return marking


def place_truth(marking, names, frame=0):
    recorded = marking.frame().truth.joints
    for name in names:
        marking.choose(name)
        marking.place(*marking.session.camera.project(recorded[JOINT_NAMES.index(name)]))


def test_a_joint_is_put_behind_the_surface_by_its_offset_and_kept_at_once(marking, take):
    truth = marking.frame().truth.joints.copy()
    marking.place(*marking.session.camera.project(truth[0]))
    mark = marks_in(open_session(take))[0]["wrist"]
    assert mark.offset == skin_offsets()["wrist"]
    surface = depth_beneath(marking.frame(), *marking.pixel_of("wrist"))
    assert mark.point[2] == pytest.approx(surface + mark.offset, abs=1e-6)
    assert np.linalg.norm(mark.point - truth[0]) < 0.012
    assert marking.chosen == JOINT_NAMES[1]  # the next click places the next joint


def test_all_joints_placed_where_they_are_seen_are_near_the_truth(marking):
    recorded = marking.frame().truth.joints.copy()
    place_truth(marking, JOINT_NAMES)
    apart = np.linalg.norm(marking.frame().truth.joints - recorded, axis=1)
    assert len(marking.joints) == 21
    assert np.median(apart) < 0.006


def test_nudges_depths_and_offsets(marking):
    place_truth(marking, ["middle_mcp"])
    marking.choose("middle_mcp")
    before = marking.pixel_of("middle_mcp")
    marking.nudge(2, -1)
    assert np.subtract(marking.pixel_of("middle_mcp"), before) == pytest.approx([2, -1], abs=1e-3)
    marking.set_offset(0.02)
    surface = depth_beneath(marking.frame(), *marking.pixel_of("middle_mcp"))
    assert marking.joints["middle_mcp"].mark.point[2] == pytest.approx(surface + 0.02, abs=1e-6)
    marking.deepen(0.001)
    assert marking.joints["middle_mcp"].mark.offset == pytest.approx(0.021)
    marking.set_depth(0.5)
    assert marking.joints["middle_mcp"].mark.point[2] == 0.5
    assert np.isnan(marking.joints["middle_mcp"].mark.offset)  # how far behind a surface is not known any more
    marking.place(1.0, 1.0, "middle_mcp")  # where no surface is seen, the depth stays
    assert marking.joints["middle_mcp"].mark.point[2] == 0.5


def test_no_depth_no_mark(marking):
    assert depth_beneath(marking.frame(), 1, 1) == depth_beneath(marking.frame(), -50, 1e5) == 0
    marking.place(1.0, 1.0)
    assert marking.joints == {}
    assert "no depth at this place" in marking.told


def test_hidden_unset_and_undone(marking, take):
    place_truth(marking, ["wrist", "index_tip"])
    marking.choose("ring_tip")
    marking.hide()
    assert marks_in(open_session(take))[0]["ring_tip"].point is None
    marking.choose("wrist")
    marking.unset()
    assert set(marks_in(open_session(take))[0]) == {"index_tip", "ring_tip"}
    marking.unset_all()
    assert marks_in(open_session(take)) == {}
    for left in ({"index_tip", "ring_tip"}, {"index_tip", "ring_tip", "wrist"}, {"index_tip", "wrist"}):
        marking.undo()
        assert set(marks_in(open_session(take))[0]) == left
    assert marking.chosen == "ring_tip"


def test_the_next_frame_begins_with_these_marks_and_keeps_none_unseen(marking, take):
    place_truth(marking, ["wrist", "index_mcp", "index_tip"])
    marking.onward()
    assert marking.state.frame == 1
    assert {placing.suggested for placing in marking.joints.values()} == {True}
    assert list(marks_in(open_session(take))) == [0]
    marking.choose("index_tip")
    marking.nudge(1, 0)
    assert set(marks_in(open_session(take))[1]) == {"index_tip"}
    marking.confirm()
    assert set(marks_in(open_session(take))[1]) == {"wrist", "index_mcp", "index_tip"}
    marking._controller.look(0)
    assert not any(placing.suggested for placing in marking.joints.values())
    marking._controller.look(119)
    marking.onward()
    assert marking.state.frame == 119


def test_what_was_tracked_is_compared_with_the_marks_and_stays(marking, act):
    act(marking._controller.start, marking._controller.step)
    state = marking.state
    marking._controller.look(0)
    before, tracked = state.summary.error, state.last
    marking.choose("wrist")
    marking.place(*np.add(marking.session.camera.project(state.summary.joints[0]), (12, 0)))
    assert state.summary.error > before + 0.0003
    assert state.last == tracked
    marking.undo()
    assert state.summary.error == pytest.approx(before)


def test_two_pages_lose_none_of_each_others_marks(marking, take, page, act):
    from app.controller import Controller
    from app.runner import Runner
    from app.state import State

    other = Controller(State(), Runner())
    second = Marking(other)
    act(lambda: other.open(str(take)))
    place_truth(marking, ["wrist"])
    other.look(4)
    place_truth(second, ["index_tip"])
    other.close()
    assert {frame: set(joints) for frame, joints in marks_in(open_session(take)).items()} == {
        0: {"wrist"},
        4: {"index_tip"},
    }


def test_marks_are_written_into_the_session(marking, take, act):
    place_truth(marking, ["wrist"])
    act(marking.embed)
    assert not marks_file(take).exists()
    assert "wrist" in marks_in(open_session(take))[0]
    place_truth(marking, ["index_tip"])  # and marked further
    assert set(marks_in(open_session(take))[0]) == {"wrist", "index_tip"}
    name, content = marking.file_of_marks()
    assert name == "take-marks.csv"
    assert content.count(b"\n") == 3


def test_a_place_that_cannot_be_written_is_said_and_nothing_is_lost(marking, take):
    (take.parent / f".{marks_file(take).name}.part").mkdir()
    place_truth(marking, ["wrist"])
    assert "cannot be written" in marking.state.error
    assert "wrist" in marking.joints
