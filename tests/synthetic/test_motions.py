"""Motions: natural in their limits, as fast as asked, and the thumb really meets the fingers."""

from __future__ import annotations

import numpy as np
import pytest

from spf.hand import Hand, HandShape, load_hand
from spf.hand.kinematics import joints_of, pose_hand
from spf.hand.model import mirrored
from spf.synthetic.motions import MOTIONS
from spf.synthetic.postures import CURLED, FIST, FLAT, GRASP, OPEN, POINT, RELAXED, count, touch
from spf.synthetic.trajectory import (
    Trajectory,
    View,
    joint_speed,
    make_trajectory,
    minimum_jerk,
    mirrored_trajectory,
)

VIEW = View(np.array([0.02, -0.03, 0.5]), 0.1, -0.1, 0.2)
SPEEDS = {"slow": 4.0, "medium": 9.0, "fast": 16.0}


@pytest.fixture(scope="module")
def hand() -> Hand:
    return load_hand("right")


def trajectory_of(hand: Hand, motion: str, speed_mm: float = 9.0, seed: int = 5, frames: int = 90) -> Trajectory:
    return make_trajectory(hand, MOTIONS[motion], VIEW, frames, speed_mm, 30.0, np.random.default_rng(seed))


@pytest.mark.parametrize("motion", MOTIONS)
class TestEveryMotion:
    def test_stays_inside_the_joint_limits(self, hand: Hand, motion: str) -> None:
        poses = trajectory_of(hand, motion).poses
        np.testing.assert_array_equal(poses, hand.constrain(poses))

    def test_turns_are_rotations_and_palm_angles_are_zero(self, hand: Hand, motion: str) -> None:
        poses, orientations = trajectory_of(hand, motion)
        np.testing.assert_array_equal(poses[:, 3:6], 0.0)
        products = orientations @ orientations.transpose(0, 2, 1)
        np.testing.assert_allclose(products, np.broadcast_to(np.eye(3), products.shape), atol=1e-12)
        np.testing.assert_allclose(np.linalg.det(orientations), 1.0)

    @pytest.mark.parametrize("speed", SPEEDS)
    def test_is_as_fast_as_asked(self, hand: Hand, motion: str, speed: str) -> None:
        measured = joint_speed(hand, trajectory_of(hand, motion, SPEEDS[speed]))
        assert measured == pytest.approx(SPEEDS[speed], rel=0.1)

    def test_same_seed_same_motion_other_seed_another(self, hand: Hand, motion: str) -> None:
        first, again, other = (trajectory_of(hand, motion, seed=seed, frames=20) for seed in (1, 1, 2))
        np.testing.assert_array_equal(first.poses, again.poses)
        np.testing.assert_array_equal(first.orientations, again.orientations)
        assert np.abs(first.poses - other.poses).max() > 1e-3

    def test_moves_smoothly(self, hand: Hand, motion: str) -> None:
        """No joint jumps: played four times slower, its step changes far less from frame to frame."""

        def jerkiness(speed_mm: float) -> float:
            joints = [joints_of(hand, p, r) for p, r in zip(*trajectory_of(hand, motion, speed_mm), strict=True)]
            return float(np.linalg.norm(np.diff(joints, n=2, axis=0), axis=2).max())

        tremor = 0.0015
        assert jerkiness(2.0) < 0.25 * jerkiness(8.0) + tremor

    def test_mirrors_to_the_other_hand(self, hand: Hand, motion: str) -> None:
        right = trajectory_of(hand, motion, frames=4)
        left = mirrored_trajectory(right)
        other = mirrored(hand)
        for r_pose, r_turn, l_pose, l_turn in zip(*right, *left, strict=True):
            reflected = joints_of(other, l_pose, l_turn) * (-1.0, 1.0, 1.0)
            np.testing.assert_allclose(reflected, joints_of(hand, r_pose, r_turn), atol=1e-6)


def test_a_longer_session_begins_at_the_same_posture(hand: Hand) -> None:
    short, long = (trajectory_of(hand, "pinch", frames=frames) for frames in (10, 60))
    np.testing.assert_allclose(short.poses[0], long.poses[0], atol=1e-12)


def test_a_single_frame_is_a_motion_too(hand: Hand) -> None:
    assert trajectory_of(hand, "wave", frames=1).poses.shape == (1, 26)


def test_minimum_jerk_starts_and_stops_without_velocity_and_acceleration() -> None:
    h = 1e-3
    np.testing.assert_allclose(minimum_jerk(np.array([-1.0, 0.0, 0.5, 1.0, 2.0])), [0.0, 0.0, 0.5, 1.0, 1.0])
    for end in (0.0, 1.0):
        before, at, after = minimum_jerk(np.array([end - h, end, end + h]))
        assert abs(after - before) / (2 * h) < 1e-4
        assert abs(after - 2 * at + before) / h**2 < 0.1


@pytest.mark.parametrize(
    "posture",
    [OPEN, FLAT, RELAXED, CURLED, FIST, POINT, GRASP, *(count(number) for number in range(6))],
    ids=["open", "flat", "relaxed", "curled", "fist", "point", "grasp", *(f"count {n}" for n in range(6))],
)
def test_postures_are_inside_the_limits(hand: Hand, posture: np.ndarray) -> None:
    pose = np.concatenate([np.zeros(6), posture])
    np.testing.assert_array_equal(hand.constrain(pose), pose)


@pytest.mark.parametrize("number", range(6))
def test_counting_shows_that_many_fingers(hand: Hand, number: int) -> None:
    """A shown fingertip is far from the wrist, a hidden one is not."""
    joints = joints_of(hand, np.concatenate([np.zeros(6), count(number)]))
    fingers = np.linalg.norm(joints[[8, 12, 16, 20]] - joints[0], axis=1) > 0.14
    thumb = np.linalg.norm(joints[4] - joints[9]) > 0.08
    assert fingers.sum() + thumb == number


SHAPES = {
    "standard": HandShape("right"),
    "small": HandShape("right", scale=0.8),
    "long thumb": HandShape("right", lengths=(1.15,) * 3 + (0.95,) * 12),
    "long fingers": HandShape("right", lengths=(1.0,) * 3 + (1.1,) * 12),
}


@pytest.mark.parametrize("finger", ["index", "middle", "ring", "little"])
@pytest.mark.parametrize("shape", SHAPES)
def test_the_thumb_meets_the_finger(shape: str, finger: str) -> None:
    """The skins of both digits come closer than 3 mm near their tips, and the tip joints don't run into each other."""
    hand = SHAPES[shape].hand()
    posed = pose_hand(hand, np.concatenate([np.zeros(6), touch(hand, finger, 0.5 * RELAXED)]))
    digit = ["index", "middle", "ring", "little"].index(finger) + 2
    thumb_skin, finger_skin = posed.vertices[hand.digit == 1], posed.vertices[hand.digit == digit]
    tips = posed.joints[[4, 4 * digit]]
    near = [
        skin[np.linalg.norm(skin - tip, axis=1) < 0.016]
        for skin, tip in zip((thumb_skin, finger_skin), tips, strict=True)
    ]
    gaps = np.linalg.norm(near[0][:, None] - near[1][None], axis=2)
    assert gaps.min() < 0.003
    assert 0.006 < np.linalg.norm(tips[0] - tips[1]) < 0.022
