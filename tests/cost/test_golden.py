"""The rendered comparison: golden energy and silhouette overlap."""

from __future__ import annotations

import numpy as np
import pytest

from spf.cost.problem import GOLDEN_TRUNCATION, Problem, costs, golden
from spf.hand.kinematics import pose_hand
from spf.hand.model import load_hand
from spf.kernels.golden import FOREARM_COST, FOREARM_RADIUS, FOREARM_TAPER, compare_depth
from spf.kernels.render import project_vertices, rasterise
from tests.scenes import CAMERAS, FACING, hand_problem, natural_pose


def proxy_depth(problem: Problem, pose: np.ndarray) -> np.ndarray:
    """The coarse mesh on the coarse grid, by the slow road: the proxy as a hand of its own."""
    hand = problem.hand._replace(skin=problem.hand.proxy)
    points = pose_hand(hand, pose, problem.reference).vertices
    projected = np.empty((len(points), 3), np.float32)
    depth = np.empty_like(problem.observation.arrays.grid_depth)
    project_vertices(points, problem.observation.arrays.grid_camera, projected)
    rasterise(projected, hand.proxy_faces, depth)
    return depth


@pytest.mark.parametrize("camera", CAMERAS)
def test_a_rendered_truth_has_golden_energy_zero(camera: str) -> None:
    hand = load_hand("right")
    truth = natural_pose(hand, (0.2, -0.1, 0.3))
    problem = hand_problem(hand, truth, CAMERAS[camera])
    depth = proxy_depth(problem, truth)
    labels = (depth < 1e8).astype(np.uint8)
    exact = problem.observation.arrays._replace(grid_depth=depth, grid_labels=labels)
    energies, overlap = golden(problem._replace(observation=problem.observation._replace(arrays=exact)), truth[None])
    assert energies[0] == pytest.approx(0, abs=1e-9)
    assert overlap[0] == pytest.approx(1)


@pytest.mark.parametrize("camera", CAMERAS)
@pytest.mark.parametrize("side", ["left", "right"])
def test_the_truth_explains_the_frame_best(side: str, camera: str, rng: np.random.Generator) -> None:
    hand = load_hand(side)
    truth = natural_pose(hand, (0.2, -0.1, 0.3))
    problem = hand_problem(hand, truth, CAMERAS[camera])
    others = truth + rng.normal(size=(20, 26)) * np.r_[np.full(3, 0.01), np.full(23, 0.2)]
    poses = np.vstack([truth, others])
    energies, overlap = golden(problem, poses)
    assert energies.argmin() == 0
    assert overlap.argmax() == 0
    assert energies[0] < 0.05  # the coarse mesh is not the mesh, and the frame was smoothed
    assert overlap[0] > 0.93
    assert ((energies >= 0) & (energies <= 2)).all()
    assert costs(problem, poses).argmin() == 0


def test_comparison_agrees_with_its_formula(rng: np.random.Generator) -> None:
    height, width = 12, 17
    rendered = np.where(rng.random((height, width)) < 0.5, rng.uniform(0.4, 0.5, (height, width)), 1e9)
    rendered = rendered.astype(np.float32)
    observed = rng.uniform(0.4, 0.5, (height, width)).astype(np.float32)
    labels = rng.integers(0, 3, (height, width)).astype(np.uint8)
    outside = rng.random((height, width)).astype(np.float32)
    camera = np.array([50.0, 55.0, 8.0, 6.0, 1.0])
    wrist, axis = np.array([0.0, 0.02, 0.45]), np.array([0.0, 1.0, 0.0])
    scale = 0.9
    found = compare_depth(rendered, observed, labels, outside, camera, wrist, axis, scale, GOLDEN_TRUNCATION)

    covered, seen, empty = rendered < 1e8, labels == 1, labels == 0
    v, u = np.mgrid[:height, :width]
    away = np.stack([(u - 8) / 50 * observed, (v - 6) / 55 * observed, observed], axis=-1) - wrist
    along = away @ axis
    across = np.linalg.norm(away - along[..., None] * axis, axis=-1)
    beyond = (along >= -0.004) & (across < 0.045 + 1.2 * along)
    arm = away[~covered & seen & beyond].sum(axis=0)
    arm /= np.linalg.norm(arm)
    from_arm = np.linalg.norm(away - (away @ arm)[..., None] * arm, axis=-1)
    cone = FOREARM_RADIUS * scale + FOREARM_TAPER * np.maximum(away @ arm, 0)
    forearm = ~covered & seen & beyond & (from_arm < cone)
    squared = ((rendered.astype(float) - observed) / GOLDEN_TRUNCATION) ** 2
    both, missed, beside = covered & seen, ~covered & seen & ~forearm, covered & empty
    total = np.minimum(squared[both], 1).sum() + missed.sum() + outside[beside].sum() + FOREARM_COST * forearm.sum()
    union = both.sum() + missed.sum() + beside.sum()
    assert forearm.sum() > 2
    assert found == pytest.approx((total / union, both.sum() / union), rel=1e-5)


def test_a_hand_outside_the_image_explains_nothing() -> None:
    hand = load_hand("right")
    truth = natural_pose(hand)
    problem = hand_problem(hand, truth, CAMERAS["pinhole"])
    gone = truth + np.r_[1.0, np.zeros(25)]
    energies, overlap = golden(problem, gone[None])
    assert energies[0] == pytest.approx(2)  # nothing of the observation covered, all of the model lost
    assert overlap[0] == 0


def test_reference_orientation_turns_the_hand() -> None:
    """Half a turn about the camera's axis in R_ref is half a turn of the picture."""
    hand = load_hand("right")
    pose = natural_pose(hand)
    turn = np.diag([-1.0, -1.0, 1.0])
    upright, turned = pose_hand(hand, pose, FACING).vertices, pose_hand(hand, pose, turn @ FACING).vertices
    np.testing.assert_allclose((upright - pose[:3]) @ turn.T, turned - pose[:3], atol=1e-12)
