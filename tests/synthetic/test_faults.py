"""Faults of Fig. 2: a phalanx goes missing, a finger is pushed into the scene, and nothing else changes."""

from __future__ import annotations

import numpy as np
import pytest

from spf.hand.kinematics import pose_hand
from spf.synthetic import SyntheticSession, SyntheticSettings, synthesise
from spf.synthetic.faults import Fault, apply_fault, draw_fault

THUMB_DISTAL, MIDDLE_PROXIMAL = 3, 7


@pytest.fixture(scope="module")
def session() -> SyntheticSession:
    return synthesise(SyntheticSettings(sensor="ideal", motion="count", frames=2, variation=0.0))


def before_and_after(session: SyntheticSession, fault: Fault) -> tuple[np.ndarray, np.ndarray]:
    trajectory = session.stage.trajectory
    posed = pose_hand(session.hand, trajectory.poses[0], trajectory.orientations[0])
    clean = session.clean_depth(0)
    return clean, apply_fault(fault, clean, session.hand, posed, session.camera)


@pytest.mark.parametrize("bone", [THUMB_DISTAL, MIDDLE_PROXIMAL])
def test_a_missing_phalanx_leaves_a_hole_of_its_size(session: SyntheticSession, bone: int) -> None:
    clean, faulty = before_and_after(session, Fault(missing=bone))
    changed = faulty != clean
    assert (faulty[changed] == 0).all()
    points = session.camera.back_project(*np.nonzero(changed)[::-1], clean[changed])
    middle = session.stage.trajectory.poses[0], session.stage.trajectory.orientations[0]
    joint = pose_hand(session.hand, *middle).frames[bone, :, 3]
    assert 100 < changed.sum() < 4000
    assert np.linalg.norm(points - joint, axis=1).max() < 0.065


def test_a_pushed_finger_goes_back_most_at_its_tip(session: SyntheticSession) -> None:
    clean, faulty = before_and_after(session, Fault(pushed=1, depth=0.05))
    change = faulty - clean
    moved = change > 0
    assert (change >= 0).all()
    assert 0.045 < change[moved].max() <= 0.0501
    assert change[moved].min() < 0.01
    assert moved.sum() > 500


def test_both_faults_can_hit_at_once(session: SyntheticSession) -> None:
    clean, faulty = before_and_after(session, Fault(missing=THUMB_DISTAL, pushed=2, depth=0.03))
    assert (faulty[faulty < clean] == 0).all()
    assert (faulty > clean).any()


def test_no_fault_changes_nothing(session: SyntheticSession) -> None:
    clean, faulty = before_and_after(session, Fault())
    np.testing.assert_array_equal(faulty, clean)


@pytest.mark.parametrize(("missing", "pushed"), [(0.25, 0.2), (0.0, 0.7), (1.0, 0.0)])
def test_faults_hit_their_fraction_of_the_frames(missing: float, pushed: float) -> None:
    faults = [draw_fault(7, frame, missing, pushed) for frame in range(8 * 1000)]
    assert np.mean([fault.missing >= 0 for fault in faults]) == pytest.approx(missing, abs=0.04)
    assert np.mean([fault.pushed >= 0 for fault in faults]) == pytest.approx(pushed, abs=0.04)


def test_a_fault_lasts_for_a_stretch_of_frames() -> None:
    stretch = {draw_fault(7, frame, 1.0, 1.0) for frame in range(16, 24)}
    assert len(stretch) == 1
    assert stretch != {draw_fault(7, 24, 1.0, 1.0)}


def test_a_session_shows_its_faults() -> None:
    """With a missing phalanx in every frame, hand pixels are missing before the sensor sees them."""
    settings = SyntheticSettings(sensor="ideal", motion="count", frames=2)
    whole, faulty = synthesise(settings), synthesise(settings.replace(missing_phalanx=1.0, seed=0))
    lost = (whole.clean_depth(0) > 0) & (faulty.clean_depth(0) == 0)
    assert lost.any()
    assert whole.hand_mask(0)[lost].all()
