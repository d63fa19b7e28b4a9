"""Where in a frame a hand may be, and what is a table or a wall."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from spf.frame import Camera
from spf.hand.model import load_hand
from spf.segmentation import find_plane, find_regions
from spf.synthetic import SyntheticSettings, synthesise
from tests.scenes import CAMERAS, draw_hand, frame_of, natural_pose
from tests.test_observation import draw_plane, draw_sphere

Array = NDArray[np.float64]


def over(nearer: NDArray[np.float32], farther: NDArray[np.float32]) -> NDArray[np.float32]:
    return np.where((nearer > 0) & ((farther <= 0) | (nearer < farther)), nearer, farther)


@pytest.mark.parametrize("slope", [0.0, 35.0, 60.0])
@pytest.mark.parametrize("camera", [CAMERAS["pinhole"], CAMERAS["orthographic"]._replace(fx=400.0, fy=400.0)])
def test_a_table_under_noise_is_found_where_it_is(slope: float, camera: Camera, rng: np.random.Generator) -> None:
    down = np.radians(slope)
    normal = np.array([0.0, -np.sin(down), -np.cos(down)])
    offset = float(-normal @ np.array([0.0, 0.0, 0.6]))
    table = np.maximum(draw_plane(camera, normal, offset), 0)
    depth = over(draw_sphere(camera), np.where(table < 3.0, table, 0))
    depth = np.where(depth > 0, depth + rng.normal(scale=0.002, size=depth.shape), 0).astype(np.float32)
    plane = find_plane(frame_of(depth, camera))
    assert plane is not None
    assert np.degrees(np.arccos(min(plane[:3] @ normal, 1.0))) < 0.5
    assert abs(plane[:3] @ np.array([0.0, 0.0, 0.6]) + plane[3]) < 0.002


def test_no_table_is_seen_in_a_hand_nor_with_much_behind_it(rng: np.random.Generator) -> None:
    camera, hand = CAMERAS["pinhole"], load_hand("right")
    assert find_plane(frame_of(draw_hand(hand, natural_pose(hand), camera), camera)) is None
    board = np.full((camera.height, camera.width), 0.5, np.float32)
    behind = board[:, camera.width // 2 :]
    behind[:] = rng.uniform(1.0, 2.0, behind.shape)
    assert find_plane(frame_of(board, camera)) is None


def test_a_frame_without_readings_has_neither() -> None:
    camera = CAMERAS["pinhole"]
    frame = frame_of(np.zeros((camera.height, camera.width), np.float32), camera)
    assert find_plane(frame) is None
    assert find_regions(frame) == []


def test_what_is_on_a_table_is_a_region_and_the_table_is_none() -> None:
    session = synthesise(SyntheticSettings(clutter="table", sensor="realsense", frames=2, seed=3))
    frame = session[0]
    assert frame.truth is not None
    regions = find_regions(frame)
    assert len(regions) == 1
    assert np.linalg.norm(frame.truth.joints[0] - regions[0].centre) < regions[0].radius
    plane = find_plane(frame)
    assert plane is not None
    assert (regions[0].points @ plane[:3] + plane[3]).min() > 0.01
