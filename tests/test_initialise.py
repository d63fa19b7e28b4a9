"""The automatic start on whole scenes: the hand, not its arm, and its size."""

import numpy as np
import pytest

from benchmarks.holds.sessions import open_source, synthetic
from spf.calibrate import size_by_render
from spf.hand import HandShape
from spf.hand.kinematics import joints_of
from spf.initialise import find_start
from spf.locate import reach_of
from spf.observation import observe
from spf.prepare import SessionFrames, fit_pose
from spf.shape_equations import View
from spf.synthetic import SyntheticSettings, synthesise


@pytest.mark.parametrize(("kind", "number", "first"), [("medium", 0, 15), ("any_view", 2, 28), ("back", 52, 7)])
def test_a_hand_on_a_long_arm_is_not_looked_for_in_the_elbow(kind, number, first):
    session = open_source(synthetic(kind, number, 1, 40)[0])
    frames = SessionFrames(session, first, first + 1)
    start = find_start(frames, np.random.default_rng(0))
    found = joints_of(start.shape.hand(), start.pose, start.reference)
    assert np.linalg.norm(found - frames[0].truth.joints, axis=1).mean() < 0.04


@pytest.mark.parametrize(("number", "side"), [(3, "right"), (3, "left"), (203, "left")])
def test_of_two_hands_in_view_the_one_of_the_stated_side_is_meant(number, side):
    session = open_source(synthetic("second_hand", number, 1, 6)[0])
    second, moves = session.stage.clutter.second
    start = find_start(SessionFrames(session, 0, 6), np.random.default_rng(0), side=side)
    poses = moves.poses if second.side == side else session.stage.trajectory.poses
    assert start.shape.side == side
    assert np.linalg.norm(start.pose[:3] - poses[start.frame, :3]) < 0.02


def test_sizes_that_are_too_large_and_too_small_end_in_the_true_one():
    session = synthesise(SyntheticSettings(motion="count", sensor="realsense", frames=40, shape="standard", seed=2))
    for wrong in (0.94, 1.07):
        views = []
        for frame in (session[index] for index in range(0, 40, 5)):
            pose, reference = fit_pose(session.hand, frame.truth.joints)
            views.append(View(observe(frame, pose[:3], reach_of(session.hand)), pose, reference))
        shape, _, _ = size_by_render(views, HandShape(session.hand.side, scale=wrong), np.random.default_rng(0))
        assert shape.hand().length == pytest.approx(session.hand.length, rel=0.04)
