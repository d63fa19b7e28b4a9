"""The orbit: it starts in the sensor, keeps its distance and never flips."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from spf.render import ViewCamera

angles = st.floats(-10, 10)
focal_points = st.tuples(st.floats(-0.3, 0.3), st.floats(-0.3, 0.3), st.floats(0.2, 2))


@given(focal_points)
def test_without_an_orbit_the_eye_is_in_the_sensor_and_up_is_up(focal):
    view = ViewCamera(focal, distance=float(np.linalg.norm(focal)))
    placement = view.placement()
    assert_allclose(placement.position, 0, atol=1e-12)
    assert placement.up[1] < 0  # y points down
    right = np.cross(placement.position - placement.focal_point, placement.up)
    assert_allclose(right[1], 0, atol=1e-9)  # the horizon is level


@given(focal_points, angles, angles, st.floats(0.1, 3))
def test_the_eye_keeps_its_distance_and_looks_across_its_up(focal, azimuth, elevation, distance):
    placement = ViewCamera(focal, distance, 0.2, azimuth, elevation).placement()
    outward = placement.position - placement.focal_point
    assert_allclose(np.linalg.norm(outward), distance)
    assert_allclose(np.linalg.norm(placement.up), 1)
    assert_allclose(outward @ placement.up, 0, atol=1e-9)


@given(focal_points, angles, st.floats(-3.2, 3.2))
def test_nothing_flips_at_the_poles(focal, azimuth, elevation):
    one = ViewCamera(focal, azimuth=azimuth, elevation=elevation).placement()
    next_one = ViewCamera(focal, azimuth=azimuth + 1e-5, elevation=elevation + 1e-5).placement()
    assert_allclose(one.up, next_one.up, atol=1e-4)
    assert_allclose(one.position, next_one.position, atol=1e-4)


def test_azimuth_goes_right_and_elevation_up():
    view = ViewCamera((0, 0, 0.5), distance=0.5)
    assert view._replace(azimuth=0.3).placement().position[0] > 0.1
    assert view._replace(elevation=0.3).placement().position[1] < -0.1
    assert_allclose(view._replace(azimuth=math.pi).placement().position, [0, 0, 1], atol=1e-12)


def test_a_focal_point_straight_below_the_sensor_has_a_view():
    placement = ViewCamera((0, 0.5, 0), distance=0.5).placement()
    assert_allclose(placement.position, 0, atol=1e-12)
    assert np.isfinite(placement.up).all()


def test_zoom_narrows_the_angle():
    view = ViewCamera(distance=0.5, extent=0.2)
    assert_allclose(math.tan(view.placement().view_angle / 2), 0.2)
    assert_allclose(math.tan(view._replace(zoom=2.0).placement().view_angle / 2), 0.1)


def test_the_sensor_s_view_has_the_points_in_the_middle_and_inside():
    points = np.random.default_rng(0).uniform([0.1, -0.1, 0.4], [0.2, 0.1, 0.5], (500, 3))
    view = ViewCamera.from_sensor(points)
    assert_allclose(view.focal_point, [0.15, 0, 0.45], atol=0.01)
    assert_allclose(view.placement().position, 0, atol=1e-9)
    assert 0.2 <= view.extent <= 0.3


@pytest.mark.parametrize("points", [np.zeros((0, 3)), [[0, 0, math.nan]]])
def test_no_view_on_no_points(points):
    with pytest.raises(ValueError, match="at least one point"):
        ViewCamera.from_sensor(points)


@pytest.mark.parametrize("bad", [{"zoom": 0.0}, {"distance": -1.0}, {"extent": 0.0}, {"azimuth": math.nan}])
def test_a_view_that_cannot_be_is_refused(bad):
    with pytest.raises(ValueError, match="is no view"):
        ViewCamera(**bad).placement()
