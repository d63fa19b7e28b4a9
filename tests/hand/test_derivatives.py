"""J_F v and J_Fᵀ u against central differences, and against each other."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from spf.hand import Hand, load_hand
from spf.hand.kinematics import pose_hand, skin_jvp, skin_vjp

STEP = 1e-5
HANDS = [(side, free_dip) for side in ("left", "right") for free_dip in (False, True)]
#: How far the rotations are from zero: at, near, away.
SPREADS = {"at": 0.0, "near": 1e-4, "away": 1.0}


@pytest.fixture(scope="module", params=HANDS, ids=[f"{side}-{30 if free else 26}" for side, free in HANDS])
def hand(request: pytest.FixtureRequest) -> Hand:
    side, free_dip = request.param
    return load_hand(side, free_dip=free_dip)


def a_pose(hand: Hand, spread: float, rng: np.random.Generator) -> np.ndarray:
    pose = hand.constrain(spread * rng.uniform(-1.2, 1.2, hand.dofs))
    pose[:3] = rng.normal(0.0, 0.3, 3)
    return pose


@pytest.mark.parametrize("spread", SPREADS.values(), ids=SPREADS.keys())
class TestAgainstCentralDifferences:
    def test_jvp(self, hand: Hand, spread: float, rng: np.random.Generator) -> None:
        for reference in (None, Rotation.random(rng=rng).as_matrix()):
            pose, direction = a_pose(hand, spread, rng), rng.normal(size=hand.dofs)
            ahead, behind = (pose_hand(hand, pose + sign * STEP * direction, reference) for sign in (1.0, -1.0))
            points_rate, normals_rate = skin_jvp(hand, pose, direction, reference)
            for rate, plus, minus in (
                (points_rate, ahead.vertices, behind.vertices),
                (normals_rate, ahead.normals, behind.normals),
            ):
                expected = (plus - minus) / (2.0 * STEP)
                np.testing.assert_allclose(rate, expected, atol=1e-6 * np.abs(expected).max())

    def test_jvp_of_every_entry(self, hand: Hand, spread: float, rng: np.random.Generator) -> None:
        pose = a_pose(hand, spread, rng)
        for entry in range(hand.dofs):
            direction = np.zeros(hand.dofs)
            direction[entry] = 1.0
            ahead, behind = (pose_hand(hand, pose + sign * STEP * direction).vertices for sign in (1.0, -1.0))
            expected = (ahead - behind) / (2.0 * STEP)
            rate, _ = skin_jvp(hand, pose, direction)
            np.testing.assert_allclose(rate, expected, atol=1e-6 * np.abs(expected).max())

    def test_vjp(self, hand: Hand, spread: float, rng: np.random.Generator) -> None:
        pose, reference = a_pose(hand, spread, rng), Rotation.random(rng=rng).as_matrix()
        u_x, u_n = rng.normal(size=(2, *hand.skin.vertices.shape))

        def potential(p: np.ndarray) -> float:
            posed = pose_hand(hand, p, reference)
            return float(np.sum(u_x * (posed.vertices - pose[:3])) + np.sum(u_n * posed.normals))

        steps = STEP * np.eye(hand.dofs)
        expected = np.array([(potential(pose + s) - potential(pose - s)) / (2.0 * STEP) for s in steps])
        gradient = skin_vjp(hand, pose, u_x, u_n, reference)
        np.testing.assert_allclose(gradient, expected, atol=1e-6 * np.abs(expected).max())


@pytest.mark.parametrize("spread", SPREADS.values(), ids=SPREADS.keys())
def test_one_is_the_other_s_adjoint(hand: Hand, spread: float, rng: np.random.Generator) -> None:
    """⟨u, J v⟩ = ⟨Jᵀ u, v⟩ to rounding."""
    pose, direction = a_pose(hand, spread, rng), rng.normal(size=hand.dofs)
    u_x, u_n = rng.normal(size=(2, *hand.skin.vertices.shape))
    points_rate, normals_rate = skin_jvp(hand, pose, direction)
    forward = float(np.sum(u_x * points_rate) + np.sum(u_n * normals_rate))
    backward = float(skin_vjp(hand, pose, u_x, u_n) @ direction)
    assert forward == pytest.approx(backward, rel=1e-11, abs=1e-9)


def test_normals_turn_at_right_angles_to_themselves(hand: Hand, rng: np.random.Generator) -> None:
    pose, direction = a_pose(hand, 1.0, rng), rng.normal(size=hand.dofs)
    _, normals_rate = skin_jvp(hand, pose, direction)
    along = np.sum(normals_rate * pose_hand(hand, pose).normals, axis=1)
    np.testing.assert_allclose(along, 0.0, atol=1e-12)


def test_a_translation_moves_points_and_no_normals(hand: Hand, rng: np.random.Generator) -> None:
    direction = np.zeros(hand.dofs)
    direction[:3] = rng.normal(size=3)
    points_rate, normals_rate = skin_jvp(hand, a_pose(hand, 1.0, rng), direction)
    np.testing.assert_allclose(points_rate, np.broadcast_to(direction[:3], points_rate.shape), atol=1e-15)
    np.testing.assert_array_equal(normals_rate, 0.0)


def test_forces_add_up(hand: Hand, rng: np.random.Generator) -> None:
    """The gradient with respect to the translation is the sum of all forces on points."""
    u_x, u_n = rng.normal(size=(2, *hand.skin.vertices.shape))
    gradient = skin_vjp(hand, a_pose(hand, 1.0, rng), u_x, u_n)
    np.testing.assert_allclose(gradient[:3], u_x.sum(axis=0), rtol=1e-12, atol=1e-12)
