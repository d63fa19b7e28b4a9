"""What a run keeps: bounded memory, losses, errors where there is truth."""

import gc

import numpy as np
import pytest

from app.budget import Budget
from app.results import Entry, Results, entry_of, joint_error
from spf.frame import Camera, Frame, Truth
from spf.observation import observe
from spf.synthetic import SyntheticSettings, synthesise
from spf.track import TrackedFrame

CAMERA = Camera(4, 3, 5.0, 5.0, 2.0, 1.5)


def frame(index, truth=None):
    return Frame(index, index / 30, np.zeros((3, 4), np.float32), CAMERA, truth=truth)


def entry(index, *, lost=False, size=10):
    joints = np.zeros((21, 3))
    result = TrackedFrame(
        index, index / 30, np.zeros(size), np.eye(3), joints, lost, False, 0.0, 2.0, 0.1, 0.9, 0.02, {}, None, None
    )
    return Entry(result, (), None, None, ())


def test_old_entries_go_before_memory_grows_and_their_summaries_stay():
    results = Results(Budget(200_000))
    for index in range(50):
        results.add(entry(index, size=1000), frame(index))
    kept = [index for index in range(50) if results.entry(index) is not None]
    assert kept == list(range(kept[0], 50))
    assert 10 < len(kept) < 25
    assert [summary.frame for summary in results.summaries] == list(range(50))


def test_a_frame_tracked_anew_drops_what_followed_it():
    results = Results()
    for index in (0, 1, 2, 3, 1):
        results.add(entry(index), frame(index))
    assert [summary.frame for summary in results.summaries] == [0, 1]
    assert results.last == 1
    assert results.entry(2) is None


def test_a_loss_is_told_by_its_first_frame():
    results = Results()
    for index, lost in enumerate((False, False, True, True, False)):
        results.add(entry(index, lost=lost), frame(index))
    assert [results.lost_since(index) for index in range(5)] == [None, None, 2, 2, None]


def test_joint_error_is_over_the_known_joints():
    joints = np.full((21, 3), np.nan)
    joints[:2] = [[0.003, 0.0, 0.004], [0.0, 0.0, 0.015]]
    assert joint_error(np.zeros((21, 3)), frame(0, Truth(joints))) == pytest.approx(0.010)
    assert np.isnan(joint_error(np.zeros((21, 3)), frame(0)))


def test_runs_share_their_memory_and_who_keeps_most_forgets_first():
    budget = Budget(300_000)
    short, long = Results(budget), Results(budget)
    for index in range(5):
        short.add(entry(index, size=1000), frame(index))
    for index in range(50):
        long.add(entry(index, size=1000), frame(index))
    assert short.kept_bytes + long.kept_bytes <= 300_000
    assert all(short.entry(index) is not None for index in range(5))
    assert long.entry(0) is None
    assert long.entry(49) is not None
    del long
    gc.collect()
    for index in range(5, 30):
        short.add(entry(index, size=1000), frame(index))
    assert short.entry(5) is not None


def test_what_was_seen_is_kept_small_and_whole():
    session = synthesise(SyntheticSettings(frames=1))
    truth = session[0].truth
    observation = observe(session[0], truth.joints.mean(axis=0), 0.15)
    result = entry(0).result._replace(observation=observation)
    seen = entry_of(result, (), None, ()).seen
    np.testing.assert_array_equal(seen.mask, observation.depth > 0)
    np.testing.assert_allclose(seen.points, observation.hand_points, atol=1e-6)
    assert seen.packed.nbytes + seen.depths.nbytes < 0.4 * observation.hand_points.astype(np.float32).nbytes
