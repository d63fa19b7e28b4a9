"""The start of a run: from the truth, from a pose file, automatically."""

import dataclasses
import json

import numpy as np
import pytest

from spf.errors import HandError, StartError
from spf.hand import HandShape, SavedPose, load_hand, read_pose, write_pose
from spf.hand.kinematics import joints_of
from spf.prepare import SessionFrames, fit_pose, prepare
from spf.synthetic import SyntheticSettings, synthesise


@pytest.fixture(scope="module")
def session():
    return synthesise(SyntheticSettings(frames=16, seed=4))


@pytest.fixture(scope="module")
def late():
    """A hand that comes into view in frame 6."""
    return synthesise(SyntheticSettings(frames=20, absent_from=0, absent_frames=6))


class Counting:
    """A session that counts how often its frames are decoded."""

    def __init__(self, session):
        self.session, self.decoded = session, []

    def __len__(self):
        return len(self.session)

    def __getitem__(self, index):
        self.decoded.append(index)
        return self.session[index]


def test_frames_are_decoded_when_asked_for_and_once(session):
    counting = Counting(session)
    frames = SessionFrames(counting, 4, 12)
    part = frames[2:6]
    assert (len(frames), len(part)) == (8, 4)
    assert counting.decoded == []
    assert [part[0].index, frames[2].index, part[-1].index, frames[7].index] == [6, 6, 9, 11]
    assert counting.decoded == [6, 9, 11]
    with pytest.raises(IndexError):
        frames[8]


def test_the_exact_truth_is_taken_as_it_is(session):
    start = prepare(session, init="truth", first=3)
    truth = session[3].truth
    assert start.frame == 3
    np.testing.assert_array_equal(start.pose, truth.pose)
    np.testing.assert_array_equal(start.reference, truth.orientation)
    assert start.shape == HandShape.from_dict(session.hand_shape)
    assert start.doubt == ""
    assert 0.0 < start.golden < 0.3


def test_the_truth_of_the_first_frame_that_shows_the_hand(late):
    assert late[6].truth is not None
    assert 6 < prepare(late, init="truth").frame < 14


def test_a_given_hand_is_fitted_to_the_true_joints(session):
    shape = HandShape.from_dict(session.hand_shape)._replace(scale=1.03)
    start = prepare(session, init="truth", shape=shape)
    joints = joints_of(shape.hand(), start.pose, start.reference)
    assert start.shape == shape
    assert np.linalg.norm(joints - session[0].truth.joints, axis=1).mean() < 0.004


@pytest.mark.parametrize("side", ["left", "right"])
def test_a_pose_is_fitted_to_its_own_joints(side, rng):
    hand = load_hand(side)
    pose = np.zeros(hand.dofs)
    pose[6:] = hand.limits[6:].mean(axis=1) + 0.1 * rng.normal(size=hand.dofs - 6)
    pose[:6] = [0.03, -0.02, 0.4, 1.2, -0.7, 2.0]
    joints = joints_of(hand, hand.constrain(pose))
    fitted, reference = fit_pose(hand, joints)
    np.testing.assert_allclose(joints_of(hand, fitted, reference), joints, atol=3e-4)
    joints[[3, 4, 8]] = np.nan
    partly, reference = fit_pose(hand, joints)
    known = np.isfinite(joints).all(axis=1)
    np.testing.assert_allclose(joints_of(hand, partly, reference)[known], joints[known], atol=3e-4)


def test_too_few_joints_of_the_palm():
    joints = np.full((21, 3), np.nan)
    joints[:2] = 0.1
    with pytest.raises(StartError, match="lacks the joints of the palm"):
        fit_pose(load_hand("right"), joints)


@pytest.mark.parametrize("side", ["left", "right"])
def test_side_and_size_come_from_joints_that_are_all_the_truth_has(side):
    made = synthesise(SyntheticSettings(frames=13, side=side, shape="small", clutter="none"))
    session = dataclasses.replace(made, side=None, hand_shape=None)
    start = prepare(session, init="truth")
    assert start.shape.side == side
    assert start.shape.hand().length == pytest.approx(made.hand.length, rel=0.06)
    joints = joints_of(start.shape.hand(), start.pose, start.reference)
    assert np.linalg.norm(joints - session[0].truth.joints, axis=1).mean() < 0.008


def test_no_truth_to_start_from(session):
    with pytest.raises(StartError, match="has no ground truth"):
        prepare(dataclasses.replace(session, has_truth=False), init="truth")
    absent = synthesise(SyntheticSettings(frames=5, absent_from=0, absent_frames=5))
    with pytest.raises(StartError, match="None of the frames"):
        prepare(absent, init="truth")


def test_a_pose_file_is_used_as_it_is_written(session, tmp_path):
    truth = session[2].truth
    shape = HandShape.from_dict(session.hand_shape)
    saved = SavedPose("right", truth.pose, truth.orientation, 2, shape)
    write_pose(saved, tmp_path / "pose.json")
    again = read_pose(tmp_path / "pose.json")
    np.testing.assert_array_equal(again.pose, saved.pose)
    np.testing.assert_array_equal(again.reference, saved.reference)
    assert (again.frame, again.shape) == (2, shape)
    start = prepare(session, init=tmp_path / "pose.json")
    assert start.frame == 2
    np.testing.assert_array_equal(start.pose, truth.pose)
    assert start.shape == shape
    assert prepare(session, init=tmp_path / "pose.json", shape=shape._replace(scale=1.1)).shape.scale == 1.1
    with pytest.raises(HandError, match="outside the frames 5 to 15"):
        prepare(session, init=tmp_path / "pose.json", first=5)


def test_a_pose_where_the_depth_shows_nothing(session, tmp_path):
    pose = session[0].truth.pose.copy()
    pose[2] += 5.0
    shape = HandShape.from_dict(session.hand_shape)
    write_pose(SavedPose("right", pose, np.eye(3), 0, shape), tmp_path / "pose.json")
    with pytest.raises(StartError, match="shows nothing where the first pose puts the hand"):
        prepare(session, init=tmp_path / "pose.json")


GOOD = {"format": "spf-pose", "side": "right", "pose": [0.0] * 26}


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"format": "other"}, "is no pose file"),
        ({"side": "upper"}, "whose pose it is"),
        ({"pose": [0.0] * 30}, "30 entries"),
        ({"pose": ["a"] * 26}, "not a list of numbers"),
        ({"pose": [float("nan")] * 26}, "not a finite number"),
        ({"reference": [[1, 0], [0, 1]]}, "no rotation matrix"),
        ({"reference": [[2, 0, 0], [0, 1, 0], [0, 0, 1]]}, "no rotation matrix"),
        ({"frame": -1}, "no frame's number"),
        ({"side": "left"}, "of a left hand"),
    ],
)
def test_pose_files_that_do_not_fit(session, tmp_path, change, words):
    path = tmp_path / "pose.json"
    path.write_text(json.dumps({**GOOD, **change}))
    with pytest.raises(HandError, match=words):
        prepare(session, init=path)


def test_pose_files_that_cannot_be_read(session, tmp_path):
    with pytest.raises(HandError, match="cannot be read"):
        prepare(session, init=tmp_path / "missing.json")
    (tmp_path / "torn.json").write_text('{"format": "spf-')
    with pytest.raises(HandError, match="torn or not JSON"):
        prepare(session, init=tmp_path / "torn.json")


def test_a_hand_of_the_other_side(session):
    with pytest.raises(HandError, match=r"left hand, and .* shows a right hand"):
        prepare(session, shape=HandShape("left"))


def test_the_automatic_start_counts_frames_from_the_sessions_first(late):
    told = []
    shape = HandShape.from_dict(late.hand_shape)
    start = prepare(late, shape=shape, first=2, progress=lambda text, share: told.append((text, share)))
    assert 6 <= start.frame < 14
    assert start.shape == shape
    assert told
    assert all(0.0 <= share <= 1.0 for _, share in told)


def test_nothing_to_find():
    absent = synthesise(SyntheticSettings(frames=3, clutter="none", absent_from=0, absent_frames=3))
    with pytest.raises(StartError, match="No frame shows anything"):
        prepare(absent)
