"""Skeletons over the depth image."""

import numpy as np
import pytest

from spf.frame import Camera, Frame
from spf.render import Skeleton, depth_picture

CAMERA = Camera(320, 240, 300.0, 300.0, 160.0, 120.0)
EMPTY = Frame(0, 0.0, np.zeros((240, 320), np.float32), CAMERA)
MAGENTA = (255, 0, 255)


def drawn_around(matrix: np.ndarray, joint: tuple[float, float, float]) -> np.ndarray:
    """Pixels (M, 2), from the joint, that a matrix around one joint, all others unknown, adds to the picture; twice its size."""
    joints = np.full((21, 3), np.nan)
    joints[3] = joint
    bare = Skeleton(joints, MAGENTA)
    ringed = bare._replace(around=np.tile(matrix, (21, 1, 1)))
    pictures = [depth_picture(EMPTY, skeletons=[one], width=640) for one in (bare, ringed)]
    v, u = np.nonzero(
        (pictures[1][..., 1] < 30) & (pictures[1][..., 0] > 120) & (pictures[0] != pictures[1]).any(axis=2)
    )
    return np.stack([u, v], axis=1) - (2.0 * CAMERA.project(joints[3]) + 0.5)


def test_a_ball_around_a_joint_is_a_circle_of_its_size():
    ring = drawn_around(np.eye(3) * 0.02**2, (0.01, -0.02, 0.6))
    assert len(ring) > 50
    assert np.linalg.norm(ring, axis=1) == pytest.approx(2 * 300.0 * 0.02 / 0.6, abs=1.5)


def test_the_ellipse_lies_as_the_matrix_does():
    along, across = np.array([1.0, 2.0, 0.0]) / np.sqrt(5.0), np.array([2.0, -1.0, 0.0]) / np.sqrt(5.0)
    ring = drawn_around(0.04**2 * np.outer(along, along) + 0.015**2 * np.outer(across, across), (0.0, 0.0, 0.6))
    a, b = ring @ along[:2] / 40.0, ring @ across[:2] / 15.0
    assert np.hypot(a, b) == pytest.approx(1.0, abs=0.15)
    assert np.abs(a).max() > 0.95


def test_around_joints_that_are_sure_nothing_is_seen():
    joints = np.tile([0.0, 0.0, 0.6], (21, 1))
    np.testing.assert_array_equal(
        depth_picture(EMPTY, skeletons=[Skeleton(joints, MAGENTA)]),
        depth_picture(EMPTY, skeletons=[Skeleton(joints, MAGENTA, np.zeros((21, 3, 3)))]),
    )
