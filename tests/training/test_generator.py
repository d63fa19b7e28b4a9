"""The generator: the same every time, and its answers agree with its pictures."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from spf.hand.model import load_hand
from spf.kernels.samples import draw_samples
from spf.kernels.sensing import FAULTS, Pools, sense
from spf.learned.layout import ARTICULATED, CROP_SIZE, EXTENT_PER_LENGTH
from spf.training.articulations import draw_articulations
from spf.training.generator import Generator
from spf.training.scenes import draw_scenes, other_faces
from spf.training.shapes import make_shapes, size_of

SHAPES = 12
NO_FAULTS = dict.fromkeys(FAULTS, 0.0) | {"grain": 4.0, "hole_size": 4.0, "steepest": 1e6, "step": 1e-4}


@pytest.fixture(scope="module")
def generator() -> Generator:
    return Generator(5, SHAPES)


def test_a_number_and_a_seed_give_the_same_batch(generator):
    first, again = generator.batch(3, 16), Generator(5, SHAPES).batch(3, 16)
    for name, array in first._asdict().items():
        np.testing.assert_array_equal(array, getattr(again, name), err_msg=name)
    assert np.abs(first.crops - generator.batch(4, 16).crops).max() > 0.1
    assert np.abs(first.crops - Generator(6, SHAPES).batch(3, 16).crops).max() > 0.1


def test_batches_are_well_formed(generator):
    batch = generator.batch(0, 300)
    assert batch.crops.shape == (300, CROP_SIZE, CROP_SIZE)
    assert np.isfinite(batch.crops).all()
    assert batch.crops.min() >= -1.0
    assert batch.crops.max() <= 1.0
    np.testing.assert_allclose(
        batch.rotations @ batch.rotations.transpose(0, 2, 1), np.tile(np.eye(3), (300, 1, 1)), atol=1e-5
    )
    np.testing.assert_allclose(np.linalg.det(batch.rotations), 1.0, atol=1e-5)
    limits = load_hand("right").limits[list(ARTICULATED)]
    assert (batch.angles >= limits[:, 0] - 1e-6).all()
    assert (batch.angles <= limits[:, 1] + 1e-6).all()
    assert 0.75 < batch.present.mean() < 0.95
    assert 0.7 < batch.right.mean() < 0.9
    usual = -np.log(EXTENT_PER_LENGTH)
    assert np.abs(batch.log_sizes - usual).max() < 0.6


def test_around_an_elbow_there_is_no_hand_and_something_is_seen():
    scenes = draw_scenes(np.random.default_rng(3), 400, make_shapes(SHAPES, 1), left_share=0.0)
    kernel, elbow = scenes.kernel, scenes.kernel.drawn & ~scenes.present
    assert 20 < elbow.sum() < 60
    assert not scenes.present[~kernel.drawn].any()
    middle = np.stack([np.zeros(400), np.zeros(400), kernel.away], axis=1)
    apart = np.linalg.norm(kernel.poses[:, :3] - middle, axis=1) / kernel.extents
    assert apart[elbow].min() > 0.5
    assert apart[scenes.present].max() < 0.6
    nearest = np.linalg.norm(kernel.others - middle[:, None], axis=2).min(axis=1) / kernel.extents
    assert nearest[elbow].max() < 0.4


def test_the_other_hand_is_farther_from_the_middle_than_the_one_to_be_found():
    table = make_shapes(SHAPES, 1)
    scenes = draw_scenes(np.random.default_rng(3), 400, table, left_share=0.0)
    kernel = scenes.kernel
    skins = kernel.others[:, -table.left.shape[1] :]
    second = skins[..., 2].max(axis=1) > 0.0
    assert 30 < second.sum() < 90
    assert not second[~scenes.present].any()
    middle = np.stack([np.zeros(400), np.zeros(400), kernel.away], axis=1)
    own = kernel.poses[:, :3] + np.einsum("nij,j->ni", kernel.orientations, np.array([-0.005, -0.005, -0.035]))
    apart = [np.linalg.norm(at - middle, axis=1) / kernel.extents for at in (skins.mean(axis=1), own)]
    assert (apart[0] - apart[1])[second].min() > 0.0


def test_joints_lie_under_the_skin_that_the_crop_shows():
    """Without noise and other things, a joint's pixel shows skin, which is not far behind it and mostly in front."""
    table = make_shapes(SHAPES, 1)
    scenes = draw_scenes(np.random.default_rng(2), 200, table, left_share=0.0).kernel
    scenes = scenes._replace(
        drawn=np.ones(200, bool),
        others=np.full_like(scenes.others, -1.0),
        planes=np.zeros_like(scenes.planes),
        faults=np.tile([NO_FAULTS[name] for name in FAULTS], (200, 1)),
    )
    arrays = table.arrays._replace(
        faces=np.concatenate([table.arrays.faces, other_faces(table.arrays.faces, len(table.arrays.skin.vertices))])
    )
    pools = Pools(np.zeros(1024, np.float32), np.full(1024, 0.5, np.float32))
    crops, joints = np.empty((200, CROP_SIZE, CROP_SIZE), np.float32), np.empty((200, 21, 3))
    draw_samples(arrays, scenes, pools, crops, joints)
    away, extents = scenes.away[:, None], scenes.extents[:, None]
    pixel = (joints[..., :2] / joints[..., 2:] * away[..., None] / extents[..., None] + 0.5) * CROP_SIZE
    inside = (pixel > 1).all(axis=-1) & (pixel < CROP_SIZE - 1).all(axis=-1)
    inside &= np.abs(joints[..., 2] - away) < 0.47 * extents
    n, j = np.nonzero(inside)
    u, v = pixel[n, j].astype(int).T
    skin = away[n, 0] + crops[n, v, u] * 0.5 * extents[n, 0]
    shown = crops[n, v, u] < 1.0
    assert inside.mean() > 0.7
    assert shown.mean() > 0.95
    deeper = (joints[n, j, 2] - skin)[shown]  # the joint behind the skin
    assert (deeper > -0.012).mean() > 0.97
    assert 0.002 < np.median(deeper) < 0.03


def test_a_mirrored_sample_shows_the_mirrored_crop(generator):
    plain, flipped = generator.batch(7, 40, left_share=0.0), generator.batch(7, 40, left_share=1.0)
    np.testing.assert_array_equal(flipped.crops, plain.crops[:, :, ::-1])
    assert (plain.right == 1.0).all()
    assert (flipped.right == 0.0).all()
    np.testing.assert_array_equal(flipped.points, plain.points * np.array([-1.0, 1.0, 1.0], np.float32))


def test_size_is_relative_to_the_bundled_hand():
    hand = load_hand("right")
    assert size_of(hand) == pytest.approx(1.0)
    assert size_of(hand.scaled(1.3)) == pytest.approx(1.3)


def test_articulations_use_the_whole_range(rng):
    drawn = np.degrees(draw_articulations(rng, 4000))
    limits = np.degrees(load_hand("right").limits[6:26])
    assert (drawn >= limits[:, 0] - 1e-9).all()
    assert (drawn <= limits[:, 1] + 1e-9).all()
    for entry in (5, 7):  # MP and PIP of the index finger
        low, high = np.percentile(drawn[:, entry], [3, 97])
        assert low < 5.0
        assert high > 85.0
    assert np.percentile(drawn[:, 4], 97) > 18.0  # abduction


def test_a_sensor_that_blooms_widens_a_hand_by_a_pixel():
    clean = np.zeros((20, 20), np.float32)
    clean[:, 12:] = 0.9
    clean[6:14, 6:14] = 0.5
    seen = [np.empty_like(clean) for _ in range(3)]
    pools = Pools(np.zeros(1024, np.float32), np.linspace(0.0, 1.0, 1024, endpoint=False, dtype=np.float32))
    for picture, bloom in zip(seen, (0.0, 0.5, 1.0), strict=True):
        faults = np.array([(NO_FAULTS | {"bloom": bloom})[name] for name in FAULTS])
        sense(clean, 20.0, faults, pools, 0, np.empty_like(clean), picture)
    hand = [np.isclose(picture, 0.5, atol=1e-3) for picture in seen]
    grown = cv2.dilate((clean == 0.5).astype(np.uint8), cv2.getStructuringElement(cv2.MORPH_CROSS, (3, 3))) > 0
    np.testing.assert_array_equal(hand[0], clean == 0.5)
    np.testing.assert_array_equal(hand[2], grown)
    assert hand[0].sum() < hand[1].sum() < hand[2].sum()
