"""The covariance of an estimate: its derivatives against differences, its parts, and what it says of hidden fingers."""

from __future__ import annotations

import numpy as np
import pytest

from spf.cost.products import curvature, gauss_newton, products, see
from spf.filters import smart
from spf.filters.step import start_at
from spf.filters.uncertainty import uncertainty_of
from spf.frame import JOINT_NAMES
from spf.hand import load_hand
from spf.hand.kinematics import joint_jacobian, joints_of
from spf.locate import reach_of
from spf.observation import observe
from spf.synthetic import SyntheticSettings, synthesise
from tests.scenes import CAMERAS, FACING, hand_problem, natural_pose

_SETTINGS = smart.SpfSettings(rounds=4, learned=False)


@pytest.mark.parametrize(("side", "free_dip"), [("right", False), ("left", True)])
@pytest.mark.parametrize("angles", [(0.0, 0.0, 0.0), (0.7, -0.5, 0.9)])
def test_joint_jacobian_is_the_derivative_of_the_joints(side, free_dip, angles):
    hand = load_hand(side, free_dip=free_dip)
    pose, step = natural_pose(hand, angles), 1e-6
    expected = np.stack(
        [
            (joints_of(hand, pose + d, FACING) - joints_of(hand, pose - d, FACING)) / (2 * step)
            for d in step * np.eye(len(pose))
        ],
        axis=2,
    )
    np.testing.assert_allclose(joint_jacobian(hand, pose, FACING), expected, atol=1e-8)


def test_the_dense_hessian_has_the_known_diagonal_and_products():
    hand = load_hand("right")
    truth = natural_pose(hand)
    problem = hand_problem(hand, truth, CAMERAS["pinhole"])
    sample = see(problem, truth)
    matrix = gauss_newton(problem, truth, sample)
    np.testing.assert_allclose(np.diag(matrix), curvature(problem, truth, sample), rtol=1e-6)
    direction = np.random.default_rng(1).normal(size=len(truth))
    product = products(problem, truth, direction, sample).product
    np.testing.assert_allclose(matrix @ direction, product, rtol=1e-6, atol=1e-6 * np.abs(product).max())
    assert np.linalg.eigvalsh(matrix).min() > -1e-6 * np.linalg.eigvalsh(matrix).max()


@pytest.fixture(scope="module")
def tracked():
    session = synthesise(SyntheticSettings(motion="open_close", sensor="kinect2", frames=4, seed=3))
    frame = session[0]
    state = start_at(session.hand, frame.truth.pose, frame.truth.orientation, frame.time - 1 / 30, _SETTINGS.n)
    observation = observe(frame, state.estimate[:3], reach_of(session.hand))
    _, info = smart.step(np.random.default_rng(0), state, observation, session.hand, _SETTINGS)
    return session, observation, info


def test_the_covariance_is_one_and_the_factor_scales_it(tracked):
    session, observation, info = tracked
    said = uncertainty_of(session.hand, observation, info, _SETTINGS, factor=1.0)
    wider = uncertainty_of(session.hand, observation, info, _SETTINGS, factor=4.0)
    assert said.pose.shape == (26, 26)
    assert said.joints.shape == (21, 3, 3)
    np.testing.assert_allclose(said.pose, said.pose.T, atol=1e-12)
    assert np.linalg.eigvalsh(said.pose).min() > 0.0
    np.testing.assert_allclose(wider.deviation, 2.0 * said.deviation)
    np.testing.assert_allclose(said.deviation**2, np.trace(said.joints, axis1=1, axis2=2))


def test_samples_that_differ_widen_it_by_what_they_differ(tracked):
    """Two samples of equal weight, 1 cm to both sides of the estimate: 1 cm of deviation along x is added."""
    session, observation, info = tracked
    one = info._replace(predicted=info.estimate[None], optimised=info.estimate[None], log_weights=np.log([0.5, 0.5]))
    shift = np.eye(26)[0] * 0.01
    two = one._replace(predicted=one.predicted + shift, optimised=one.optimised - shift)
    alone, apart = (uncertainty_of(session.hand, observation, i, _SETTINGS, factor=1.0) for i in (one, two))
    difference = apart.joints - alone.joints
    np.testing.assert_allclose(difference[:, 0, 0], 1e-4, rtol=1e-6)
    np.testing.assert_allclose(difference[:, 1:, 1:], 0.0, atol=1e-12)


def test_what_is_not_seen_is_less_sure():
    """Of fingers that no depth is read of, only the dynamics say where they are."""
    session = synthesise(SyntheticSettings(motion="open_close", sensor="kinect2", frames=2, seed=3))
    frame = session[0]
    truth, hand = frame.truth, session.hand
    state = start_at(hand, truth.pose, truth.orientation, frame.time - 1 / 30, _SETTINGS.n)
    tip = JOINT_NAMES.index("middle_tip")
    row = int(frame.camera.project(truth.joints[JOINT_NAMES.index("middle_mcp")])[1])
    depth = frame.depth.copy()
    depth[:row] = 0.0  # fingers are up: nothing of them is read
    deviations = []
    for seen in (frame.depth, depth):
        observation = observe(frame._replace(depth=seen), truth.pose[:3], reach_of(hand))
        _, info = smart.step(np.random.default_rng(0), state, observation, hand, _SETTINGS)
        at_truth = info._replace(estimate=truth.pose, log_weights=np.full(len(info.log_weights), -np.inf))
        deviations.append(uncertainty_of(hand, observation, at_truth, _SETTINGS, factor=1.0).deviation[tip])
    assert deviations[1] > 1.2 * deviations[0]
