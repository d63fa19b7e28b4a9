"""The floor under an error, and labels that contradict the depth."""

from __future__ import annotations

import numpy as np
import pytest

from spf.evaluate.contradictions import CONTRADICTED, label_energy, labelled_hand
from spf.evaluate.floor import floor_of, marked
from spf.frame import JOINT_NAMES, Truth
from spf.hand.kinematics import joints_of, pose_hand
from spf.hand.model import load_hand
from spf.hand.shape import HandShape
from spf.joint_definitions import corrected_joints
from spf.synthetic import SyntheticSettings, synthesise


@pytest.fixture(scope="module")
def session():
    return synthesise(SyntheticSettings(motion="count", sensor="kinect2", frames=6, seed=5))


@pytest.mark.parametrize("side", ["right", "left"])
def test_a_marked_hand_has_the_corrected_joints(side, rng):
    hand, offsets = load_hand(side), rng.normal(scale=0.05, size=(len(JOINT_NAMES), 3))
    pose = hand.constrain(rng.normal(scale=0.3, size=hand.dofs))
    expected = corrected_joints(hand, pose_hand(hand, pose), offsets)
    np.testing.assert_allclose(joints_of(marked(hand, offsets), pose), expected, atol=1e-12)


def test_the_exact_hand_at_the_exact_pose_fits_and_stays(session):
    floor = floor_of(session.hand, session[0], np.random.default_rng(0), exact=True)
    assert floor is not None
    assert floor.fitted.max() < 1e-9
    assert 0.0 < floor.descended.mean() < 0.004
    again = joints_of(session.hand, floor.pose, floor.reference) - session[0].truth.joints
    np.testing.assert_allclose(np.linalg.norm(again, axis=1), floor.descended)


def test_a_hand_of_another_size_has_a_higher_floor(session):
    frame = session[0]
    exact = floor_of(session.hand, frame, np.random.default_rng(0))
    larger = floor_of(load_hand("right").scaled(1.2), frame, np.random.default_rng(0))
    assert exact is not None
    assert larger is not None
    assert exact.fitted.mean() < 0.001
    assert larger.fitted.mean() > 0.004
    assert larger.descended.mean() > exact.descended.mean()


def test_the_pull_keeps_digits_nearer_to_the_truth_than_a_free_descent_does(session):
    indices = range(0, len(session), max(len(session) // 8, 1))
    apart = {
        pulled: [
            floor_of(session.hand, session[i], np.random.default_rng(i), exact=True, pulled=pulled).descended.mean()
            for i in indices
        ]
        for pulled in (True, False)
    }
    assert np.mean(apart[True]) < np.mean(apart[False])


def test_a_frame_without_truth_or_without_anything_there_has_no_floor(session):
    frame, rng = session[0], np.random.default_rng(0)
    assert floor_of(session.hand, frame._replace(truth=None), rng) is None
    assert floor_of(session.hand, frame._replace(depth=np.zeros_like(frame.depth)), rng) is None


def test_a_hand_is_sized_by_its_labels(session):
    shape = HandShape("right", scale=0.8)
    hand, offsets = shape.hand(), np.full((len(JOINT_NAMES), 3), 0.02)
    poses = [session.truth(index).pose for index in (0, 3, 5)]
    labels = np.array([joints_of(marked(hand, offsets), pose) for pose in poses])
    assert labelled_hand("right", labels, offsets).length == pytest.approx(hand.length, rel=0.03)


def test_labels_contradict_the_depth_when_they_show_another_hand(session):
    frame, other = session[0], session[5]
    assert label_energy(session.hand, frame) < 0.4
    moved = frame.truth.joints + np.array([0.06, 0.0, 0.0])
    assert label_energy(session.hand, frame._replace(truth=Truth(moved))) > CONTRADICTED
    assert label_energy(session.hand, frame._replace(depth=np.zeros_like(frame.depth))) == 1.0
    assert np.isnan(label_energy(session.hand, other._replace(truth=None)))
