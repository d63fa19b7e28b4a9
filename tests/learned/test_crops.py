"""Crops: the same hand looks the same wherever it is in the picture and whatever sensor took it."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from spf.frame import Camera
from spf.hand.model import load_hand, mirrored
from spf.learned.crops import make_crops, turn_towards
from spf.learned.layout import CROP_SIZE
from tests.scenes import CAMERAS, FACING, draw_hand, natural_pose

CAMERA = Camera(320, 240, 230.0, 230.0, 160.0, 120.0)
EXTENT = 0.25
FAR_SIDE = 1.0


def crop(depth, camera, centre, extent=EXTENT):
    return make_crops(depth, camera, [centre], [extent])[0][0]


def hand_depth(centre, camera=CAMERA, hand=None, turned=True):
    """A hand at a place, turned with the ray to it, so that it always shows the camera the same view."""
    hand = hand or load_hand("right")
    pose = natural_pose(hand)
    pose[:3] = centre
    turn = turn_towards(centre) if turned else np.eye(3)
    return draw_hand(hand, pose, camera, turn @ FACING)


coordinates = st.floats(-0.9, 0.9)


@given(coordinates, coordinates, st.floats(0.1, 2.0))
def test_the_virtual_camera_looks_at_the_centre(x, y, z):
    turn = turn_towards([x, y, z])
    np.testing.assert_allclose(turn @ turn.T, np.eye(3), atol=1e-12)
    assert np.linalg.det(turn) == pytest.approx(1.0)
    np.testing.assert_allclose(turn[:, 2], np.array([x, y, z]) / np.linalg.norm([x, y, z]), atol=1e-12)


@pytest.mark.parametrize("centre", [(0.0, 0.0, 0.5), (0.12, -0.07, 0.45), (-0.2, 0.1, 0.6)])
def test_a_wall_lies_as_deep_in_the_crop_as_geometry_says(centre):
    """Of the wall z = w, the point on a ray r is w/r_z r: its depth along the crop's axis follows from its direction."""
    wall = centre[2] + 0.02
    depth = np.full((CAMERA.height, CAMERA.width), wall, np.float32)
    (seen,), (turn,) = make_crops(depth, CAMERA, [centre], [EXTENT])
    away = np.linalg.norm(centre)
    steps = ((np.arange(CROP_SIZE) + 0.5) / CROP_SIZE - 0.5) * EXTENT
    x, y = np.meshgrid(steps, steps)
    rays = np.stack([x, y, np.full_like(x, away)], axis=-1) @ turn.T
    points = rays * (wall / rays[..., 2:])
    expected = ((points @ turn)[..., 2] - away) / (0.5 * EXTENT)
    inside = np.abs(expected) < 0.97
    assert inside.mean() > 0.5
    np.testing.assert_allclose(seen[inside], expected[inside], atol=2e-4)


@pytest.mark.parametrize("centre", [(0.13, 0.02, 0.48), (-0.1, -0.08, 0.48), (0.0, 0.09, 0.49)])
def test_the_place_in_the_picture_does_not_matter(centre):
    middle = (0.0, 0.0, float(np.linalg.norm(centre)))
    here, there = crop(hand_depth(centre), CAMERA, centre), crop(hand_depth(middle), CAMERA, middle)
    assert (np.abs(here - there) > 0.05).mean() < 0.03  # silhouettes differ by parts of pixels
    both = (here < FAR_SIDE) & (there < FAR_SIDE)
    assert both.mean() > 0.1
    assert np.median(np.abs(here - there)[both]) < 0.005


@pytest.mark.parametrize("factor", [0.5, 2.0, 3.0])
def test_the_resolution_does_not_matter(factor):
    other = Camera(int(320 * factor), int(240 * factor), 230.0 * factor, 230.0 * factor, 160.0 * factor, 120.0 * factor)
    centre = (0.05, 0.02, 0.5)
    here, there = crop(hand_depth(centre), CAMERA, centre), crop(hand_depth(centre, other), other, centre)
    assert (np.abs(here - there) > 0.05).mean() < 0.06
    both = (here < FAR_SIDE) & (there < FAR_SIDE)
    assert np.median(np.abs(here - there)[both]) < 0.01


def test_a_left_hand_mirrored_is_the_right_one():
    camera = CAMERA._replace(cx=159.5)
    right, left = load_hand("right"), mirrored(load_hand("right"))
    pose = natural_pose(right)
    mirror = np.diag([-1.0, 1.0, 1.0])
    reflected = pose * np.where(np.arange(len(pose)) == 0, -1.0, 1.0)
    centre = pose[:3]
    of_right = crop(draw_hand(right, pose, camera), camera, centre)
    of_left = crop(draw_hand(left, reflected, camera, mirror @ FACING @ mirror), camera, centre * [-1.0, 1.0, 1.0])
    assert (np.abs(of_left[:, ::-1] - of_right) > 0.02).mean() < 0.01


def test_an_orthographic_sensor_is_cropped_straight():
    camera, hand = CAMERAS["orthographic"], load_hand("right")
    pose = natural_pose(hand)
    seen, turns = make_crops(draw_hand(hand, pose, camera), camera, [pose[:3]], [EXTENT])
    np.testing.assert_array_equal(turns[0], np.eye(3))
    expected = CROP_SIZE**2 * (draw_hand(hand, pose, camera) > 0).sum() / (EXTENT * camera.fx) ** 2
    assert (seen[0] < FAR_SIDE).sum() == pytest.approx(expected, rel=0.05)


def test_nothing_is_background():
    nothing = np.zeros((240, 320), np.float32)
    assert (crop(nothing, CAMERA, (0.0, 0.0, 0.5)) == FAR_SIDE).all()
    behind = np.full((240, 320), 0.5 + 0.6 * EXTENT, np.float32)
    assert (crop(behind, CAMERA, (0.0, 0.0, 0.5)) == FAR_SIDE).all()


def test_what_is_outside_the_picture_is_background():
    full = np.full((240, 320), 0.5, np.float32)
    seen = crop(full, CAMERA, (0.5 * 160 / 230, 0.0, 0.5))
    assert (seen[:, -20:] == FAR_SIDE).all()
    assert (seen[:, :28] < FAR_SIDE).all()
