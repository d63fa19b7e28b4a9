"""The numbered sessions: the same number is the same session, whatever is asked for beside it, and all are dealt evenly."""

from __future__ import annotations

import numpy as np
import pytest

from benchmarks.holds.kidnaps import kidnapped
from benchmarks.holds.sessions import KINDS, SENSORS, SHAPES, recordings, session_settings, synthetic
from spf.segmentation import find_plane
from spf.synthetic import MOTIONS, synthesise
from spf.synthetic import SENSORS as ALL_SENSORS


def test_a_session_is_its_number_whatever_else_is_asked_for():
    many = {source.number: source for source in synthetic("fast", 0, 20, 60)}
    (alone,) = synthetic("fast", 17, 1, 60)
    assert alone == many[17]
    assert session_settings("fast", 17, 60) == session_settings("fast", 17, 60)
    assert session_settings("fast", 17, 60) != session_settings("fast", 18, 60)
    assert session_settings("fast", 17, 60).seed != session_settings("slow", 17, 60).seed


def test_motions_sensors_and_shapes_are_dealt_evenly():
    chosen = [session_settings("medium", number, 60) for number in range(45)]
    assert {motion: sum(s.motion == motion for s in chosen) for motion in MOTIONS} == dict.fromkeys(MOTIONS, 5)
    pairs = {(s.sensor, s.shape) for s in chosen[:15]}
    assert pairs == {(sensor, shape) for sensor in SENSORS for shape in SHAPES}
    assert {s.side for s in chosen} == {"left", "right"}
    assert len({s.seed for s in chosen}) == len(chosen)


def test_every_motion_is_seen_by_every_sensor():
    chosen = [session_settings("every", number, 60) for number in range(45)]
    assert {(s.motion, s.sensor) for s in chosen} == {(motion, sensor) for motion in MOTIONS for sensor in ALL_SENSORS}


@pytest.mark.parametrize("kind", KINDS)
def test_every_kind_can_be_made_at_its_speed(kind):
    settings = session_settings(kind, 0, 20)
    assert settings.speed_mm == KINDS[kind].speed_mm
    assert settings.clutter == KINDS[kind].clutter
    session = synthesise(settings)
    assert (session[0].depth > 0).any()
    assert session.is_absent(11) == KINDS[kind].away


def test_a_recording_is_named_by_its_folder_and_may_bring_a_camera():
    sources = recordings("some/where/P4,camera.json", 3, 100)
    assert [source.seed for source in sources] == [0, 1, 2]
    assert {(s.kind, s.path, s.camera, s.synthetic) for s in sources} == {("P4", "some/where/P4", "camera.json", False)}
    assert recordings("P4", 1, 100)[0].camera is None


def test_a_kidnapped_hand_jumps_and_turns_once_and_stays_in_view():
    session = synthesise(session_settings("medium", 0, 12))
    other = kidnapped(session, 6, np.random.default_rng(0))
    before, after = session.stage.trajectory, other.stage.trajectory
    np.testing.assert_array_equal(after.poses[:6], before.poses[:6])
    jumps = np.linalg.norm(after.poses[6:, :3] - before.poses[6:, :3], axis=1)
    np.testing.assert_allclose(jumps, 0.14)
    turns = after.orientations[6:] @ before.orientations[6:].transpose(0, 2, 1)
    angles = np.degrees(np.arccos((np.trace(turns, axis1=1, axis2=2) - 1.0) / 2.0))
    np.testing.assert_allclose(angles, 150.0)
    np.testing.assert_array_equal(after.poses[:, 6:], before.poses[:, 6:])
    assert other.hand_mask(6).sum() > 0.4 * session.hand_mask(5).sum()


def test_a_kidnapped_hand_is_wholly_in_the_view_and_the_sensor_sees_it():
    for kind, number in (("table", 417), ("second_hand", 410)):  # half out of the view, and nearer than the sensor sees
        session = synthesise(session_settings(kind, number, 30))
        other = kidnapped(session, 15, np.random.default_rng([number, 11]))
        for index in range(15, 30):
            u, v = other.camera.project(other[index].truth.joints).T
            assert 0.0 < u.min() < u.max() < other.camera.width
            assert 0.0 < v.min() < v.max() < other.camera.height
        seen = [(one.hand_mask(index) & (one[index].depth > 0.0)).sum() for one, index in ((session, 14), (other, 15))]
        assert seen[1] > 0.4 * seen[0]


def test_a_kidnapped_hand_is_not_put_into_a_table():
    for number in (116, 408):  # with the first jump that is in the view it would be
        session = kidnapped(synthesise(session_settings("table", number, 30)), 15, np.random.default_rng([number, 11]))
        plane = find_plane(session[0])
        for index in range(15, 30, 3):
            assert (session[index].truth.joints @ plane[:3] + plane[3]).min() > 0.005
