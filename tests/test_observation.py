"""From a depth image to what the cost is compared with."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from spf.frame import Camera, Frame
from spf.hand.model import load_hand
from spf.observation import GRID_CELLS, OUTSIDE_RAMP, Observation, camera_numbers, observe
from tests.scenes import CAMERAS, PALM, REACH, draw_hand, frame_of, natural_pose

Array = NDArray[np.float64]
EMPTY, HAND, UNKNOWN = 0, 1, 2
CENTRE = np.array([0.01, -0.02, 0.5])


def rays(camera: Camera) -> tuple[Array, Array]:
    """Origin and direction (H, W, 3) of every pixel's ray; the direction's z is 1."""
    v, u = np.mgrid[: camera.height, : camera.width].astype(float)
    x, y = (u - camera.cx) / camera.fx, (v - camera.cy) / camera.fy
    zeros, ones = np.zeros_like(x), np.ones_like(x)
    if camera.model == "pinhole":
        return np.zeros((*x.shape, 3)), np.stack([x, y, ones], axis=-1)
    return np.stack([x, y, zeros], axis=-1), np.stack([zeros, zeros, ones], axis=-1)


def draw_sphere(camera: Camera, centre: Array = CENTRE, radius: float = 0.07) -> NDArray[np.float32]:
    origin, direction = rays(camera)
    away = origin - centre
    a, b = np.sum(direction**2, axis=-1), np.sum(direction * away, axis=-1)
    c = np.sum(away**2, axis=-1) - radius**2
    hit = b**2 - a * c
    return np.where(hit > 0, (-b - np.sqrt(np.maximum(hit, 0))) / a, 0).astype(np.float32)


def draw_plane(camera: Camera, normal: Array, offset: float) -> NDArray[np.float32]:
    """Depth of n·X + d = 0."""
    origin, direction = rays(camera)
    return (-(origin @ normal + offset) / (direction @ normal)).astype(np.float32)


def assert_sound(observation: Observation) -> None:
    """What every reader of an observation relies on."""
    arrays, size = observation.arrays, observation.depth.shape
    assert arrays.labels.shape == arrays.nearest.shape == size
    assert arrays.points.shape == arrays.normals.shape == (size[0] * size[1], 3)
    for part in (arrays.points, arrays.normals, arrays.grid_depth, arrays.grid_outside, observation.depth):
        assert np.isfinite(part).all()
    np.testing.assert_array_equal(np.flatnonzero(arrays.labels == HAND), arrays.pixels)
    np.testing.assert_array_equal(observation.depth > 0, arrays.labels == HAND)
    np.testing.assert_allclose(np.linalg.norm(arrays.normals, axis=1), 1, atol=1e-9)
    assert arrays.grid_depth.shape == arrays.grid_labels.shape == arrays.grid_outside.shape
    assert arrays.grid_depth.size <= 1.05 * GRID_CELLS + sum(arrays.grid_depth.shape)
    assert arrays.grid_count == (arrays.grid_labels == HAND).sum()
    assert ((arrays.grid_outside >= 0) & (arrays.grid_outside <= 1)).all()
    np.testing.assert_array_equal(arrays.camera, camera_numbers(observation.camera))
    if not observation.is_empty:
        assert (arrays.labels.reshape(-1)[arrays.nearest] == HAND).all()
        np.testing.assert_array_equal(arrays.nearest.reshape(-1)[arrays.pixels], arrays.pixels)


@pytest.mark.parametrize("camera", CAMERAS)
def test_points_and_normals_of_a_sphere(camera: str) -> None:
    observation = observe(frame_of(draw_sphere(CAMERAS[camera]), CAMERAS[camera]), CENTRE, 0.1)
    assert_sound(observation)
    points = observation.hand_points
    outward = (points - CENTRE) / 0.07
    normals = observation.arrays.normals[observation.arrays.pixels]
    view = points / np.linalg.norm(points, axis=1, keepdims=True)
    head_on = np.sum(outward * (view if camera == "pinhole" else [0, 0, 1]), axis=1) < -0.5
    assert head_on.sum() > 1000
    assert np.abs(np.linalg.norm(outward[head_on], axis=1) - 1).max() < 0.01  # 0.7 mm
    angle = np.degrees(np.arccos(np.clip(np.sum(outward * normals, axis=1), -1, 1)))
    assert np.median(angle[head_on]) < 3  # smoothing over 5×5 pixels flattens a ball a little
    assert angle[head_on].max() < 8
    facing = np.sum(normals * (points if camera == "pinhole" else [0, 0, 1]), axis=1)
    assert (facing < 0).all()  # towards the camera


@pytest.mark.parametrize("camera", CAMERAS)
def test_points_and_normals_of_a_slanted_plane_are_exact(camera: str) -> None:
    normal = np.array([0.3, -0.4, -1.0]) / np.linalg.norm([0.3, -0.4, -1.0])
    offset = float(-normal @ CENTRE)
    board = np.where(draw_sphere(CAMERAS[camera]) > 0, draw_plane(CAMERAS[camera], normal, offset), np.float32(0))
    observation = observe(frame_of(board, CAMERAS[camera]), CENTRE, 0.08)  # all of the plane would be a wall
    assert_sound(observation)
    rows, columns = np.unravel_index(observation.arrays.pixels, observation.depth.shape)
    middle = np.hypot(rows - rows.mean(), columns - columns.mean()) < 0.6 * (rows.max() - rows.min()) / 2
    assert np.abs(observation.hand_points[middle] @ normal + offset).max() < 2e-4
    found = observation.arrays.normals[observation.arrays.pixels][middle]
    assert np.degrees(np.arccos(np.clip(found @ normal, -1, 1))).max() < 1


def test_back_projection_of_the_crop_is_that_of_the_frame() -> None:
    camera = CAMERAS["pinhole"]
    observation = observe(frame_of(draw_sphere(camera), camera), CENTRE, 0.1)
    rows, columns = np.unravel_index(observation.arrays.pixels, observation.depth.shape)
    again = camera.back_project(columns + observation.left, rows + observation.top, observation.depth[rows, columns])
    np.testing.assert_allclose(observation.hand_points, again, atol=1e-7)


def test_beside_the_hand_the_nearest_hand_pixel_is_known() -> None:
    camera = CAMERAS["pinhole"]
    observation = observe(frame_of(draw_sphere(camera), camera), CENTRE, 0.1)
    height, width = observation.depth.shape
    hand = np.argwhere(observation.arrays.labels == HAND)
    for v, u in [(0, 0), (0, width - 1), (height - 1, width // 2), (height // 2, 0)]:
        assert observation.arrays.labels[v, u] == EMPTY
        found = np.array(np.unravel_index(observation.arrays.nearest[v, u], (height, width)))
        best = np.linalg.norm(hand - [v, u], axis=1).min()
        assert np.linalg.norm(found - [v, u]) <= 1.03 * best + 1e-9  # the transform's 5×5 mask is not quite exact


def test_the_cost_of_covering_a_cell_beside_the_hand_rises_to_one() -> None:
    camera = CAMERAS["pinhole"]
    arrays = observe(frame_of(draw_sphere(camera), camera), CENTRE, 0.1).arrays
    assert (arrays.grid_outside[arrays.grid_labels == HAND] == 0).all()
    assert arrays.grid_outside.max() == 1
    rising = arrays.grid_outside[(arrays.grid_labels == EMPTY) & (arrays.grid_outside < 1)]
    assert rising.size > 10
    assert rising.min() < 0.5
    assert pytest.approx(0.005) == OUTSIDE_RAMP


def test_an_empty_frame_is_an_empty_observation() -> None:
    camera = CAMERAS["pinhole"]
    for depth in (np.zeros((240, 320), np.float32), np.full((240, 320), 3.0, np.float32)):
        observation = observe(frame_of(depth, camera), CENTRE, 0.1)
        assert observation.is_empty
        assert observation.hand_points.shape == (0, 3)
        assert_sound(observation)


def test_a_centre_outside_the_image_sees_nothing() -> None:
    camera = CAMERAS["pinhole"]
    frame = frame_of(draw_sphere(camera), camera)
    for centre in ([5.0, 0.0, 0.5], [0.0, -5.0, 0.5], [0.0, 0.0, -0.5]):
        assert observe(frame, centre, 0.1).is_empty


@pytest.mark.parametrize("corner", [(-0.28, -0.2), (0.29, 0.2), (-0.29, 0.0)])
def test_a_hand_at_the_border_is_cut_there(corner: tuple[float, float]) -> None:
    camera = CAMERAS["pinhole"]
    centre = np.array([*corner, 0.5])
    observation = observe(frame_of(draw_sphere(camera, centre), camera), centre, 0.1)
    assert_sound(observation)
    assert not observation.is_empty
    height, width = observation.depth.shape
    assert 0 <= observation.left <= camera.width - width
    assert 0 <= observation.top <= camera.height - height
    assert observation.left == 0 or observation.left + width == camera.width


@pytest.mark.parametrize("camera", CAMERAS)
def test_the_crop_is_tight_around_the_hand(camera: str) -> None:
    depth = draw_hand(load_hand("right"), natural_pose(load_hand("right")), CAMERAS[camera])
    observation = observe(frame_of(depth, CAMERAS[camera]), PALM, REACH)
    assert_sound(observation)
    assert len(observation.arrays.pixels) == pytest.approx((depth > 0).sum(), rel=0.02)
    rows, columns = np.nonzero(observation.arrays.labels == HAND)
    height, width = observation.depth.shape
    assert rows.min() == columns.min() == 10
    assert (height - 1 - rows.max(), width - 1 - columns.max()) == (10, 10)


def test_what_lies_outside_the_sphere_is_left_out() -> None:
    camera = CAMERAS["pinhole"]
    wall = np.full((240, 320), 0.8, np.float32)
    sphere = draw_sphere(camera)
    observation = observe(frame_of(np.where(sphere > 0, sphere, wall), camera), CENTRE, 0.1)
    assert_sound(observation)
    assert np.abs(np.linalg.norm(observation.hand_points - CENTRE, axis=1)).max() < 0.1
    assert len(observation.arrays.pixels) == pytest.approx((sphere > 0).sum(), rel=0.02)


def test_a_plane_is_left_out() -> None:
    """A ball on a table: what is within the sphere is the ball."""
    camera = CAMERAS["pinhole"]
    normal = np.array([0.0, -0.6, -0.8])
    offset = float(-normal @ (CENTRE - 0.07 * normal))
    table, ball = draw_plane(camera, normal, offset), draw_sphere(camera)
    scene = np.where((ball > 0) & ((ball < table) | (table <= 0)), ball, np.maximum(table, 0))
    frame = frame_of(scene, camera)
    without = observe(frame, CENTRE, 0.12)
    assert_sound(without)
    height = without.hand_points @ normal + offset
    assert height.min() > 0.010
    assert np.abs(np.linalg.norm(without.hand_points - CENTRE, axis=1) - 0.07).max() < 0.004
    assert len(without.arrays.pixels) > 0.85 * len(observe(frame_of(ball, camera), CENTRE, 0.12).arrays.pixels)


def test_specks_are_no_part_of_the_hand() -> None:
    camera = CAMERAS["pinhole"]
    depth = draw_sphere(camera, radius=0.04)
    u, v = camera.project(CENTRE + np.array([0.08, 0.0, 0.0])).astype(int)
    assert not depth[v - 2 : v + 3, u - 2 : u + 3].any()
    depth[v - 2 : v + 3, u - 2 : u + 3] = 0.5  # 5×5 pixels: 0.9 cm²
    observation = observe(frame_of(depth, camera), CENTRE, 0.1)
    assert_sound(observation)
    assert observation.hand_points[:, 0].max() < CENTRE[0] + 0.05


def test_two_large_parts_are_both_kept() -> None:
    """Fingers cut off by a gap in the readings still belong to the hand."""
    camera = CAMERAS["pinhole"]
    depth = draw_sphere(camera)
    column = int(camera.project(CENTRE)[0])
    depth[:, column : column + 4] = 0
    observation = observe(frame_of(depth, camera), CENTRE, 0.1)
    assert_sound(observation)
    assert observation.hand_points[:, 0].min() < CENTRE[0] - 0.05
    assert observation.hand_points[:, 0].max() > CENTRE[0] + 0.05


def test_pinholes_are_filled() -> None:
    camera = CAMERAS["pinhole"]
    depth = draw_sphere(camera)
    whole = observe(frame_of(depth, camera), CENTRE, 0.1)
    inside = np.argwhere(draw_sphere(camera, radius=0.05) > 0)
    holes = inside[np.random.default_rng(0).choice(len(inside), 40, replace=False)]
    torn = depth.copy()
    torn[tuple(holes.T)] = 0
    observation = observe(frame_of(torn, camera), CENTRE, 0.1)
    assert_sound(observation)
    assert len(observation.arrays.pixels) >= len(whole.arrays.pixels) - 2
    distance = np.linalg.norm(observation.hand_points - CENTRE, axis=1)
    assert np.abs(distance - 0.07)[np.hypot(*(observation.hand_points - CENTRE).T[:2]) < 0.05].max() < 0.002


def test_a_surface_far_in_front_hides_the_hand() -> None:
    camera = CAMERAS["pinhole"]
    depth = draw_sphere(camera)
    column = int(camera.project(CENTRE)[0])
    depth[:, column:] = 0.2  # an occluder over half of the ball
    observation = observe(frame_of(depth, camera), CENTRE, 0.1)
    assert_sound(observation)
    labels = observation.arrays.labels
    assert (labels == UNKNOWN).any()
    assert (labels[:, column - observation.left :] == UNKNOWN).all()
    behind = depth.copy()
    behind[:, column:] = 1.5  # a wall behind it says that there is nothing
    assert not (observe(frame_of(behind, camera), CENTRE, 0.1).arrays.labels == UNKNOWN).any()


def test_noise_is_smoothed_but_edges_stay(rng: np.random.Generator) -> None:
    camera = CAMERAS["pinhole"]
    depth = draw_sphere(camera)
    noisy = np.where(depth > 0, depth + rng.normal(0, 0.002, depth.shape), 0).astype(np.float32)
    observation = observe(frame_of(noisy, camera), CENTRE, 0.1)
    window = slice(observation.top, observation.top + observation.depth.shape[0])
    across = slice(observation.left, observation.left + observation.depth.shape[1])
    seen = (observation.depth > 0) & (depth[window, across] > 0)
    error = observation.depth[seen] - depth[window, across][seen]
    assert error.std() < 0.0012
    edge = draw_sphere(camera)
    column = int(camera.project(CENTRE)[0])
    edge[:, column:] += np.where(edge[:, column:] > 0, 0.03, 0).astype(np.float32)  # a step as between two fingers
    stepped = observe(frame_of(edge, camera), CENTRE, 0.12)
    row = int(camera.project(CENTRE)[1]) - stepped.top
    jump = np.diff(stepped.depth[row, column - stepped.left - 3 : column - stepped.left + 3])
    assert jump.max() > 0.028


def test_frame_and_time_are_kept() -> None:
    camera = CAMERAS["pinhole"]
    frame = Frame(17, 0.56, draw_sphere(camera), camera)
    observation = observe(frame, CENTRE, 0.1)
    assert (observation.index, observation.time) == (17, 0.56)


def test_the_frame_is_not_changed() -> None:
    camera = CAMERAS["pinhole"]
    depth = draw_sphere(camera)
    depth[depth > 0] += np.float32(0.0)
    depth[118:121, 164] = 0
    kept = depth.copy()
    observe(frame_of(depth, camera), CENTRE, 5.0)  # a window as large as the frame
    np.testing.assert_array_equal(depth, kept)


def test_readings_that_are_no_number_are_no_surface() -> None:
    camera = CAMERAS["pinhole"]
    depth = draw_sphere(camera)
    depth[::7, ::5] = np.nan
    depth[3::11, 2::13] = np.inf
    observation = observe(frame_of(depth, camera), CENTRE, 0.1)
    assert_sound(observation)
    assert np.abs(np.linalg.norm(observation.hand_points - CENTRE, axis=1)[10:-10] - 0.07).max() < 0.01
