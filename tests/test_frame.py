"""Cameras: projection and back-projection undo each other, and a cropped or subsampled camera sees the same rays."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from spf.frame import JOINT_NAMES, Camera


def finite(low: float, high: float) -> st.SearchStrategy[float]:
    return st.floats(low, high, allow_nan=False, allow_infinity=False)


@st.composite
def cameras(draw: st.DrawFn) -> Camera:
    width, height = draw(st.integers(2, 1280)), draw(st.integers(2, 960))
    focal = finite(50, 2000)
    return Camera(
        width,
        height,
        fx=draw(focal),
        fy=draw(focal),
        cx=draw(finite(0, width)),
        cy=draw(finite(0, height)),
        model=draw(st.sampled_from(["pinhole", "orthographic"])),
    )


points = st.tuples(finite(-2, 2), finite(-2, 2), finite(0.1, 5))


@given(cameras(), st.lists(points, min_size=1, max_size=5))
def test_back_project_undoes_project(camera, xyz):
    xyz = np.array(xyz)
    uv = camera.project(xyz)
    assert uv.shape == (len(xyz), 2)
    assert_allclose(camera.back_project(uv[:, 0], uv[:, 1], xyz[:, 2]), xyz, atol=1e-9)


@given(cameras(), finite(0, 1280), finite(0, 960), finite(0.1, 5))
def test_project_undoes_back_project(camera, u, v, z):
    assert_allclose(camera.project(camera.back_project(u, v, z)), [u, v], atol=1e-8)


@given(cameras(), points, st.integers(0, 50), st.integers(0, 50))
def test_crop_shifts_pixels(camera, xyz, left, top):
    cropped = camera.crop(left, top, 20, 10)
    assert (cropped.width, cropped.height) == (20, 10)
    assert_allclose(cropped.project(xyz), camera.project(xyz) - [left, top], atol=1e-7)


@given(cameras(), points, st.integers(1, 8))
def test_subsample_divides_pixels(camera, xyz, factor):
    subsampled = camera.subsample(factor)
    assert_allclose(subsampled.project(xyz), camera.project(xyz) / factor, atol=1e-7)
    assert np.zeros((camera.height, camera.width))[::factor, ::factor].shape == (subsampled.height, subsampled.width)


def test_cropping_and_subsampling_an_image_sees_the_same_points():
    camera = Camera(32, 24, fx=30.0, fy=33.0, cx=15.0, cy=11.5)
    v, u = np.mgrid[:24, :32]
    whole = camera.back_project(u, v, 0.5 + 0.01 * u)
    crop = camera.crop(6, 4, 16, 12).subsample(2)
    v, u = np.mgrid[: crop.height, : crop.width]
    assert_allclose(crop.back_project(u, v, 0.5 + 0.01 * (6 + 2 * u)), whole[4:16:2, 6:22:2])


def test_a_pinhole_point_by_hand():
    camera = Camera(320, 240, fx=200.0, fy=100.0, cx=160.0, cy=120.0)
    assert_allclose(camera.project([0.1, -0.2, 0.5]), [160 + 200 * 0.2, 120 - 100 * 0.4])


def test_an_orthographic_camera_ignores_depth():
    camera = Camera(320, 240, fx=1000.0, fy=1000.0, cx=160.0, cy=120.0, model="orthographic")
    assert_allclose(camera.project([[0.05, 0.02, 0.3], [0.05, 0.02, 3.0]]), [[210.0, 140.0]] * 2)


@pytest.mark.parametrize("finger", ["thumb", "index", "middle", "ring", "little"])
def test_every_finger_has_four_joints(finger):
    assert len(JOINT_NAMES) == len(set(JOINT_NAMES)) == 21
    assert sum(name.startswith(finger) for name in JOINT_NAMES) == 4
