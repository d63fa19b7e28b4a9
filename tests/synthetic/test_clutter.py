"""Clutter: what each scene adds, and that it leaves the hand in sight."""

from __future__ import annotations

import numpy as np
import pytest

from spf.hand.kinematics import pose_hand
from spf.synthetic import CLUTTER, SyntheticSession, SyntheticSettings, synthesise


def make(clutter: str, side: str = "right") -> SyntheticSession:
    return synthesise(SyntheticSettings(clutter=clutter, sensor="kinect2", side=side, frames=3, seed=3))


def others(session: SyntheticSession) -> np.ndarray:
    """Depths of all pixels that are not the hand's, metres."""
    depth = session.clean_depth(0)
    return depth[~session.hand_mask(0) & (depth < 5.0)]


def hand_depth(session: SyntheticSession) -> float:
    return float(np.median(session.clean_depth(0)[session.hand_mask(0)]))


@pytest.mark.parametrize("side", ["left", "right"])
@pytest.mark.parametrize("clutter", CLUTTER)
def test_most_of_the_hand_stays_in_sight(clutter: str, side: str) -> None:
    session = make(clutter, side)
    visible = session.hand_mask(0).sum()
    assert visible > 0.85 * make("none", side).hand_mask(0).sum()


def test_none_shows_the_hand_alone() -> None:
    assert len(others(make("none"))) == 0


def test_the_forearm_begins_at_the_wrist_and_is_as_thick() -> None:
    session = make("forearm")
    posed = pose_hand(session.hand, session.stage.trajectory.poses[0], session.stage.trajectory.orientations[0])
    depth, mask = session.clean_depth(0), session.hand_mask(0)
    v, u = np.nonzero(~mask & (depth < 5.0))
    points = session.camera.back_project(u, v, depth[v, u])
    from_wrist = points - posed.joints[0]
    assert np.linalg.norm(from_wrist, axis=1).min() < 0.03
    assert 0.15 < np.linalg.norm(from_wrist, axis=1).max() < 0.3
    along = from_wrist @ posed.frames[0, :, 2]
    assert (along > -0.02).all()  # all of it lies behind the wrist
    rows = np.unique(v)
    width = np.mean([np.ptp(u[v == row]) for row in rows[5:25]]) * hand_depth(session) / session.camera.fx
    assert 0.035 < width < 0.1


@pytest.mark.parametrize(("clutter", "nearest", "farthest"), [("body", 0.2, 0.7), ("face", 0.05, 0.45)])
def test_a_person_is_behind_the_hand(clutter: str, nearest: float, farthest: float) -> None:
    session, bare = make(clutter), make("forearm")
    behind = session.stage.clutter.background
    behind = behind[behind < 5.0] - hand_depth(bare)
    assert len(behind) > 1500
    assert nearest < behind.min() < behind.max() < farthest


def test_a_body_is_joined_to_the_hand_by_an_arm() -> None:
    """There are depths all the way from the hand to the trunk."""
    session = make("body")
    depths = others(session)
    filled, _ = np.histogram(depths, bins=np.arange(hand_depth(session) + 0.02, np.percentile(depths, 95), 0.02))
    assert (filled > 0).all()


def test_a_table_fills_the_picture_behind_the_hand() -> None:
    session = make("table")
    depth = session.clean_depth(0)
    assert (depth < 5.0).all()
    assert others(session).min() > hand_depth(session) - 0.15
    slope = np.diff(session.stage.clutter.background, axis=0)
    assert (slope < 0).all()  # nearer towards the bottom: the sensor looks down at it


def test_a_second_hand_is_another_hand_beside_it_and_moves() -> None:
    session = synthesise(SyntheticSettings(clutter="second_hand", sensor="kinect2", frames=30, seed=3))
    assert session.stage.clutter.second is not None
    other, moves = session.stage.clutter.second
    assert other.side == "left"
    gap = np.linalg.norm(moves.poses[:, :3] - session.stage.trajectory.poses[:, :3], axis=1)
    assert (gap > 0.08).all()
    assert np.abs(np.diff(moves.poses, axis=0)).max() > 1e-3
    assert len(others(session)) > 2000


@pytest.mark.parametrize("clutter", ["body", "face", "table"])
def test_what_stands_still_stands_still(clutter: str) -> None:
    session = make(clutter)
    background = session.stage.clutter.background
    for index in range(3):
        depth = session.clean_depth(index)
        assert (depth <= background).all()
        assert (depth == background).mean() > 0.8
