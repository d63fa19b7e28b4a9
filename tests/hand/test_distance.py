"""Distances of points from a surface."""

import numpy as np
import pytest

from spf.hand.distance import distances_to_surface
from spf.hand.kinematics import pose_hand
from spf.hand.model import load_hand


def test_a_triangle_is_met_inside_at_an_edge_and_at_a_corner():
    vertices, faces = [[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]]
    points = [[0.2, 0.2, 0.5], [0.5, -0.3, 0.4], [-0.3, -0.4, 0.0], [1.0, 1.0, 0.0]]
    assert distances_to_surface(points, vertices, faces) == pytest.approx([0.5, 0.5, 0.5, np.sqrt(0.5)])


def test_points_lifted_off_a_hand_are_as_far_as_they_were_lifted():
    hand = load_hand("right")
    vertices = pose_hand(hand, hand.neutral_pose(), np.eye(3)).vertices
    corners = vertices[hand.faces]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    lifted = corners.mean(axis=1) + 0.001 * normals
    found = distances_to_surface(lifted, vertices, hand.faces)
    assert (found <= 0.001 + 1e-9).all()
    assert np.median(found) == pytest.approx(0.001, abs=1e-6)
    assert distances_to_surface(corners.mean(axis=1), vertices, hand.faces) == pytest.approx(0, abs=1e-9)


def test_no_points_have_no_distances():
    assert distances_to_surface(np.zeros((0, 3)), [[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]]).shape == (0,)
