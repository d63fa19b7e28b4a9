"""The three pictures: which hands, paths and points they hold, and in which colours."""

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from spf.render import Scene, particles_scene, reconstruction_scene, trajectories_scene
from spf.render.palette import FAINT, OBSERVED, OPTIMISED, PREDICTED, RESIDUAL, gradient
from tests.render.conftest import sphere

BALL = sphere()
POINTS = np.random.default_rng(3).normal([0, 0, 0.5], 0.02, (50, 3))


def hands(count, shift=0.0):
    return np.stack([BALL.vertices + shift + 0.01 * n for n in range(count)])


def as_bytes(colour):
    return np.round(np.asarray(colour) * 255)


def test_both_halves_of_the_particles_are_shown_in_their_colours():
    scene = particles_scene(hands(3, 0.1), hands(3), BALL.faces, points=POINTS)
    assert len(scene.meshes) == 6
    for mesh, colour in zip(scene.meshes, [PREDICTED] * 3 + [OPTIMISED] * 3, strict=True):
        assert_array_equal(mesh.colour, as_bytes(colour))
        assert 0 < mesh.opacity < 1
    assert_allclose(scene.meshes[0].vertices, hands(3, 0.1)[0], atol=1e-6)
    assert (scene.points[0].colour <= as_bytes(FAINT)).all()


def test_the_heavier_a_particle_the_more_solid():
    weights = np.array([0.5, 0.0, 0.1]), np.array([0.2, 0.15, 0.05])
    scene = particles_scene(hands(3), hands(3), BALL.faces, predicted_weights=weights[0], optimised_weights=weights[1])
    opacity = np.array([mesh.opacity for mesh in scene.meshes])
    assert_array_equal(np.argsort(opacity), np.argsort(np.concatenate(weights)))
    assert opacity.max() > 3 * opacity.min() > 0


def test_only_the_heaviest_particles_are_drawn_both_halves_of_each():
    before, after = np.array([0.0, 0.3, 0.0, 0.0]), np.array([0.1, 0.0, 0.5, 0.1])
    scene = particles_scene(
        hands(4, 0.1), hands(4), BALL.faces, predicted_weights=before, optimised_weights=after, at_most=2
    )
    expected = [hands(4, 0.1)[1], hands(4, 0.1)[2], hands(4)[1], hands(4)[2]]
    for mesh, vertices in zip(scene.meshes, expected, strict=True):
        assert_allclose(mesh.vertices, vertices, atol=1e-6)


def test_a_tracker_without_predictions_and_weights_that_are_all_zero():
    scene = particles_scene(None, hands(2), BALL.faces, optimised_weights=[0.0, 0.0])
    assert [mesh.opacity for mesh in scene.meshes] == [scene.meshes[0].opacity] * 2
    assert scene.points == ()


def test_a_tracker_that_optimises_nothing():
    scene = particles_scene(hands(3), None, BALL.faces, predicted_weights=[0.1, 0.7, 0.2], at_most=2)
    assert [mesh.colour.tolist() for mesh in scene.meshes] == [as_bytes(PREDICTED).tolist()] * 2
    assert_allclose(scene.meshes[0].vertices, hands(3)[1], atol=1e-6)
    paths = trajectories_scene(np.empty((0, 1, 6, 3)), weights=[], points=POINTS)
    assert paths.lines == ()
    assert len(paths.points) == 1


@pytest.mark.parametrize("weights", [[1.0], [1.0, -1.0], [1.0, np.nan]])
def test_weights_that_do_not_fit_are_refused(weights):
    with pytest.raises(ValueError, match="weights"):
        particles_scene(hands(2), hands(2), BALL.faces, optimised_weights=weights)
    with pytest.raises(ValueError, match="weights"):
        trajectories_scene(np.zeros((2, 3, 6, 3)), weights=weights)


def test_halves_of_different_length_are_refused():
    with pytest.raises(ValueError, match="3 predicted and 2 optimised"):
        particles_scene(hands(3), hands(2), BALL.faces)


def test_trajectories_run_from_start_to_end_in_the_colours_of_before_and_after():
    paths = np.random.default_rng(0).normal(size=(2, 5, 6, 3))
    scene = trajectories_scene(paths, points=POINTS)
    lines, (backdrop, start, end) = scene.lines[0], scene.points
    assert lines.paths.shape == (12, 5, 3)
    assert_allclose(lines.paths[7], paths[1, :, 1], atol=1e-6)
    assert_allclose(start.xyz, paths[:, 0].reshape(12, 3), atol=1e-6)
    assert_allclose(end.xyz, paths[:, -1].reshape(12, 3), atol=1e-6)
    assert_array_equal(lines.colour[:, 0], np.tile(as_bytes(PREDICTED), (12, 1)))
    assert_array_equal(lines.colour[:, -1], np.tile(as_bytes(OPTIMISED), (12, 1)))
    assert len(backdrop.xyz) == len(POINTS)


def test_light_particles_fade():
    colours = trajectories_scene(np.zeros((2, 3, 1, 3)), weights=[1.0, 0.0]).lines[0].colour.astype(float)
    strong, weak = (np.abs(colours[n] - as_bytes(FAINT)).sum() for n in (0, 1))
    assert strong > 2 * weak > 0


@pytest.mark.parametrize("shape", [(2, 0, 6, 3), (2, 6, 3), (2, 5, 6, 2)])
def test_paths_of_another_shape_are_refused(shape):
    with pytest.raises(ValueError, match="paths have shape"):
        trajectories_scene(np.zeros(shape))


def test_points_far_from_the_reconstruction_are_red():
    residuals = np.r_[0.0, 0.005, 0.01, np.full(47, 0.5)]
    flat = POINTS * [1, 1, 0] + [0, 0, 0.5]
    scene = reconstruction_scene(BALL.vertices, BALL.faces, points=flat, residuals=residuals)
    colours = scene.points[0].colour
    assert_array_equal(colours[0], as_bytes(OBSERVED))
    assert_array_equal(colours[2], as_bytes(RESIDUAL))
    assert_array_equal(colours[3:], np.tile(as_bytes(RESIDUAL), (47, 1)))
    assert scene.meshes[0].opacity == 1


@pytest.mark.parametrize("residuals", [np.zeros(3), np.full(50, np.nan)])
def test_residuals_that_do_not_fit_are_refused(residuals):
    with pytest.raises(ValueError, match="residuals have shape"):
        reconstruction_scene(BALL.vertices, BALL.faces, points=POINTS, residuals=residuals)


def test_the_farther_from_the_sensor_the_darker_a_point():
    colours = reconstruction_scene(BALL.vertices, BALL.faces, points=POINTS).points[0].colour.astype(int)
    assert (np.diff(colours[np.argsort(POINTS[:, 2])], axis=0) <= 0).all()
    assert colours.max() > 1.5 * colours.min()


def test_a_closed_sheet_of_points_is_thinned_out_evenly_with_its_residuals():
    sheet = np.random.default_rng(0).uniform([-0.1, -0.1, 0.5], [0.1, 0.1, 0.5], (30_000, 3))
    residuals = np.where(sheet[:, 0] > 0, 1.0, 0.0)
    cloud = reconstruction_scene(BALL.vertices, BALL.faces, points=sheet, residuals=residuals).points[0]
    assert 3800 < len(cloud.xyz) < 4200
    assert_allclose(cloud.xyz.mean(axis=0), [0, 0, 0.5], atol=0.01)
    assert_array_equal(cloud.colour[cloud.xyz[:, 0] > 0][0], as_bytes(RESIDUAL))
    assert_array_equal(cloud.colour[cloud.xyz[:, 0] < 0][0], as_bytes(OBSERVED))
    assert len(trajectories_scene(np.zeros((1, 1, 6, 3)), points=sheet).points[0].xyz) == len(cloud.xyz)


def test_no_observed_points_at_all():
    scene = reconstruction_scene(BALL.vertices, BALL.faces, points=np.zeros((0, 3)))
    assert len(scene.points[0].xyz) == 0


def test_a_reconstruction_without_points():
    scene = reconstruction_scene(BALL.vertices, BALL.faces)
    assert isinstance(scene, Scene)
    assert scene.points == ()


def test_a_gradient_ends_where_its_colours_are():
    assert_allclose(
        gradient((0, 0, 0), (1, 0.5, 0), [-1, 0, 0.5, 1, 2]), [[0] * 3, [0] * 3, [0.5, 0.25, 0], *[[1, 0.5, 0]] * 2]
    )
