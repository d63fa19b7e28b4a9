"""Sensor models: the noise is the noise declared, and each imperfection does what it says."""

from __future__ import annotations

import numpy as np
import pytest

from spf.frame import Camera
from spf.synthetic.sensors import SENSORS, Sensor, measure, noise_sd

CLEAN = Sensor(
    meaning="nothing wrong",
    camera=Camera(200, 150, 200.0, 200.0, 99.5, 74.5),
    fps=30.0,
    depth_unit=0.0001,
    near=0.2,
    far=2.0,
    distance=0.5,
)


def wall(sensor: Sensor, z: float) -> np.ndarray:
    return np.full((sensor.camera.height, sensor.camera.width), z, np.float32)


def block(sensor: Sensor, near: float = 0.5, far: float = 0.0) -> np.ndarray:
    """A square in the middle, in front of a wall or of nothing."""
    depth = wall(sensor, far)
    depth[50:100, 70:130] = near
    return depth


def metres(sensor: Sensor, depth: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    return measure(sensor, depth, rng) * sensor.depth_unit


@pytest.mark.parametrize("name", SENSORS)
class TestEverySensor:
    def test_noise_is_as_declared(self, name: str, rng: np.random.Generator) -> None:
        sensor = SENSORS[name]._replace(disparity_step=0.0, depth_unit=0.0001)
        for z in np.linspace(sensor.near, sensor.far, 5)[1:-1]:
            seen = metres(sensor, wall(sensor, z), rng)
            errors = seen[seen > 0] - z
            declared = float(noise_sd(sensor, np.float32(z)))
            assert errors.std() == pytest.approx(declared, rel=0.05, abs=5e-5)
            assert abs(errors.mean()) < 0.05 * declared + 5e-5

    def test_the_same_generator_takes_the_same_picture(self, name: str) -> None:
        sensor = SENSORS[name]
        depth = wall(sensor, sensor.distance)
        depth[:, :40] = 0.0
        first, again = (measure(sensor, depth, np.random.default_rng(3)) for _ in range(2))
        np.testing.assert_array_equal(first, again)
        assert first.dtype == np.uint16
        if name != "ideal":
            assert (first != measure(sensor, depth, np.random.default_rng(4))).any()

    def test_out_of_range_is_no_reading(self, name: str, rng: np.random.Generator) -> None:
        sensor = SENSORS[name]
        assert not measure(sensor, wall(sensor, 0.9 * sensor.near), rng).any()
        assert not measure(sensor, wall(sensor, 1.1 * sensor.far), rng).any()
        assert not measure(sensor, wall(sensor, 0.0), rng).any()
        assert not measure(sensor, wall(sensor, 1e9), rng).any()

    def test_the_usual_distance_is_in_its_range(self, name: str) -> None:
        sensor = SENSORS[name]
        assert sensor.near < sensor.distance < sensor.far
        assert sensor.far / sensor.depth_unit <= np.iinfo(np.uint16).max


def test_time_of_flight_noise_of_a_senz3d_is_three_to_eight_millimetres() -> None:
    sensor = SENSORS["senz3d"]
    assert 0.003 <= noise_sd(sensor, np.float32(0.3)) <= noise_sd(sensor, np.float32(0.6)) <= 0.0085


def test_a_clean_sensor_rounds_to_counts(rng: np.random.Generator) -> None:
    seen = measure(CLEAN, wall(CLEAN, 0.50004), rng)
    assert (seen == 5000).all()


def test_grain_keeps_the_variance_and_correlates_neighbours(rng: np.random.Generator) -> None:
    sensor = CLEAN._replace(noise_floor=0.004, grain=5, grainy=0.8)
    errors = metres(sensor, wall(sensor, 0.5), rng) - 0.5
    assert errors.std() == pytest.approx(0.004, rel=0.06)
    neighbours = np.corrcoef(errors[:, :-1].ravel(), errors[:, 1:].ravel())[0, 1]
    assert neighbours == pytest.approx(0.8 * 4.0 / 5.0, abs=0.06)  # a box of 5 shares 4 of 5 columns with the next


def test_ragged_edges_move_only_pixels_near_the_edge(rng: np.random.Generator) -> None:
    sensor, depth = CLEAN._replace(ragged=1.0), block(CLEAN)
    changed = metres(sensor, depth, rng) != metres(CLEAN, depth, rng)
    assert changed.sum() > 20
    assert not changed[56:94, 76:124].any()
    changed[44:106, 64:136] = False
    assert not changed.any()


def test_flying_pixels_lie_between_the_surfaces(rng: np.random.Generator) -> None:
    sensor, depth = CLEAN._replace(flying=0.6), block(CLEAN, 0.5, 0.9)
    seen = metres(sensor, depth, rng)
    between = (seen > 0.502) & (seen < 0.898)
    edge = np.zeros_like(between)
    edge[50:100, 70:130] = True
    edge[51:99, 71:129] = False
    assert 0.5 < between[edge].mean() < 0.65
    assert not between[~edge].any()


def test_flying_pixels_beside_nothing_are_a_little_too_far(rng: np.random.Generator) -> None:
    sensor, depth = CLEAN._replace(flying=1.0), block(CLEAN)
    seen = metres(sensor, depth, rng)
    beyond = seen[50:100, 70:130] - 0.5
    assert 0.01 < beyond[0].max() <= 0.0401
    assert np.abs(beyond[2:-2, 2:-2]).max() < 1e-4


def test_a_stereo_sensor_shadows_one_side_by_the_jump_in_disparity(rng: np.random.Generator) -> None:
    sensor = CLEAN._replace(baseline=0.05)
    near, far = 0.5, 1.0
    seen = metres(sensor, block(sensor, near, far), rng)
    width = sensor.camera.fx * sensor.baseline * (1.0 / near - 1.0 / far)  # 10 pixels
    lost = np.flatnonzero(seen[75] == 0.0)
    assert len(lost) == pytest.approx(width, abs=1)
    assert lost.max() == 69  # the band ends where the nearer surface begins
    assert (seen[20] > 0).all()


def test_disparity_comes_in_steps(rng: np.random.Generator) -> None:
    sensor = CLEAN._replace(baseline=0.05, disparity_step=0.125)
    ramp = np.tile(np.linspace(0.8, 0.9, 200, dtype=np.float32), (150, 1))
    depths = np.unique(measure(sensor, ramp, rng)) * sensor.depth_unit
    steps = sensor.camera.fx * sensor.baseline / depths / 0.125
    assert len(depths) < 20
    np.testing.assert_allclose(steps, np.rint(steps), atol=0.02)


def test_surfaces_that_are_too_steep_are_mostly_lost(rng: np.random.Generator) -> None:
    sensor = CLEAN._replace(steepest=2.0)
    gentle, steep = (
        np.tile((0.5 + slope * (np.arange(200) - 100) * 0.5 / 200.0).astype(np.float32), (150, 1))
        for slope in (0.3, 6.0)
    )
    assert (metres(sensor, gentle, rng) > 0).all()
    middle = metres(sensor, steep, rng)[2:-2, 96:104]
    assert 0.2 < (middle > 0).mean() < 0.4


@pytest.mark.parametrize("fraction", [0.02, 0.1, 0.3])
def test_holes_take_their_fraction_of_what_is_seen(fraction: float, rng: np.random.Generator) -> None:
    depth = block(CLEAN)
    seen = measure(CLEAN._replace(holes=fraction), depth, rng)
    assert (seen[depth > 0] == 0).mean() == pytest.approx(fraction, abs=0.005)
    assert not seen[depth == 0].any()


def test_measuring_a_crop_of_the_picture_puts_it_back_where_it_was(rng: np.random.Generator) -> None:
    depth = wall(CLEAN, 0.0)
    depth[0, 0] = depth[149, 199] = 0.5
    depth[140, 3] = 0.7
    np.testing.assert_allclose(metres(CLEAN, depth, rng), depth, atol=1e-4)
