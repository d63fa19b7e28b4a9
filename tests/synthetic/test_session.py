"""Synthetic sessions: the same bytes for the same settings, truth that is true, a hand that leaves and comes back."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from spf.errors import SettingError
from spf.hand import HandShape
from spf.hand.kinematics import joints_of
from spf.sessions import open_session, write_session
from spf.synthetic import SENSORS, SHAPES, SyntheticSession, SyntheticSettings, synthesise


def make(**settings: object) -> SyntheticSession:
    return synthesise(SyntheticSettings(frames=6).replace(**settings))


class TestRepeatability:
    def test_same_settings_same_bytes(self) -> None:
        assert make(clutter="body").fingerprint() == make(clutter="body").fingerprint()

    def test_other_seed_other_bytes(self) -> None:
        assert make(seed=1).fingerprint() != make(seed=2).fingerprint()

    def test_frames_don_t_depend_on_the_order_in_which_they_are_asked_for(self) -> None:
        forwards, backwards = make(sensor="realsense"), make(sensor="realsense")
        later = {index: backwards.raw_depth(index) for index in (5, 2, 0)}
        for index in range(6):
            depth = forwards.raw_depth(index)
            if index in later:
                np.testing.assert_array_equal(depth, later[index])

    def test_noise_differs_from_frame_to_frame(self) -> None:
        """The motion is the same in both: only the sensor's noise can differ."""
        session = make(sensor="kinect2", speed_mm=0.5)
        still = session.clean_depth(0)
        clean_change = np.abs(np.where(still < 5, session.clean_depth(1) - still, 0.0))
        seen_change = session[1].depth - session[0].depth
        where = (clean_change < 1e-3) & (session[0].depth > 0) & (session[1].depth > 0)
        assert seen_change[where].std() > 1e-3


class TestTruth:
    @pytest.mark.parametrize("side", ["left", "right"])
    @pytest.mark.parametrize("sensor", SENSORS)
    def test_joints_project_onto_the_hand(self, sensor: str, side: str) -> None:
        """Every joint lies on a pixel of the hand, behind its skin by about half a finger's thickness."""
        session = make(
            sensor=sensor, side=side, motion="open_close", clutter="forearm", missing_phalanx=0, pushed_finger=0
        )
        for index in range(0, 6, 2):
            mask, depth = session.hand_mask(index), session.clean_depth(index)
            truth = session.truth(index)
            assert truth is not None
            u, v = np.rint(session.camera.project(truth.joints)).astype(int).T
            inside = (u >= 0) & (u < session.camera.width) & (v >= 0) & (v < session.camera.height)
            inside[0] = False  # the wrist joint may be under the forearm
            assert mask[v[inside], u[inside]].mean() > 0.95
            behind = (truth.joints[:, 2] - depth[np.clip(v, 0, None), np.clip(u, 0, None)])[inside]
            assert np.median(behind) == pytest.approx(0.008, abs=0.006)

    def test_joints_are_those_of_its_pose_in_its_hand(self) -> None:
        session = make(shape="random", seed=9, side="left")
        hand = HandShape.from_dict(session.hand_shape or {}).hand()
        truth = session[3].truth
        assert truth is not None
        np.testing.assert_array_equal(truth.joints, joints_of(hand, truth.pose, truth.orientation))

    def test_survives_the_native_format(self, tmp_path: Path) -> None:
        session = make(sensor="structured_light", side="left", shape="child")
        write_session(session, tmp_path / "session.mcap")
        again = open_session(tmp_path / "session.mcap")
        assert again.fingerprint() == session.fingerprint()
        assert (again.side, again.hand_shape, again.camera) == (session.side, session.hand_shape, session.camera)
        for frame, expected in zip(again, session, strict=True):
            assert frame.truth is not None
            assert expected.truth is not None
            np.testing.assert_array_equal(frame.truth.pose, expected.truth.pose)
            np.testing.assert_array_equal(frame.truth.orientation, expected.truth.orientation)
            np.testing.assert_allclose(frame.truth.joints, expected.truth.joints, atol=1e-12)


class TestSettings:
    @pytest.mark.parametrize("side", ["left", "right"])
    def test_the_thumb_is_on_its_side(self, side: str) -> None:
        """Palm to the sensor: the right hand's thumb points to the right of the image."""
        truth = make(side=side, variation=0.0).truth(0)
        assert truth is not None
        thumb_tip, palm = truth.joints[4], truth.joints[9]
        assert (thumb_tip[0] > palm[0]) == (side == "right")

    def test_left_and_right_move_alike(self) -> None:
        """Same seed: the left hand mirrors the right one, up to what the two meshes differ."""
        for motion in ("count", "point"):
            right, left = (make(motion=motion, side=side).truth(2) for side in ("right", "left"))
            assert right is not None
            assert left is not None
            centre = SENSORS["senz3d"].distance * 0.002
            np.testing.assert_allclose(left.joints * (-1.0, 1.0, 1.0), right.joints, atol=0.006 + centre)

    def test_it_is_held_where_it_is_told(self) -> None:
        session = make(distance=0.6, yaw=np.pi, variation=0.0, motion="count", speed_mm=1.0)
        truth = session.truth(0)
        assert truth is not None
        assert truth.joints[:, 2].mean() == pytest.approx(0.6, abs=0.05)
        palm_normal = truth.orientation @ (0.0, -1.0, 0.0)  # away from the sensor when it is turned by half
        assert palm_normal[2] > 0.9

    @pytest.mark.parametrize("shape", [*SHAPES, "random"])
    def test_every_shape_makes_a_hand(self, shape: str) -> None:
        session = make(shape=shape, seed=4)
        assert session.hand_mask(0).sum() > 1000

    def test_shapes_differ_in_size(self) -> None:
        assert make(shape="child").hand.length < 0.8 * make(shape="large").hand.length

    def test_an_own_shape_wins(self) -> None:
        session = synthesise(SyntheticSettings(frames=2), shape=HandShape("left", scale=0.8))
        assert (session.side, session.settings.side) == ("left", "left")
        assert session.hand.length == pytest.approx(0.8 * make().hand.length, rel=0.02)

    def test_times_are_the_sensor_s(self) -> None:
        assert make(sensor="structured_light").times[1] == pytest.approx(1 / 12.5)

    def test_faults_can_be_switched_off_and_up(self) -> None:
        sensor = make(
            sensor="structured_light", holes=0.0, ragged=0.0, missing_phalanx=0.0, pushed_finger=1.0
        ).stage.sensor
        assert (sensor.holes, sensor.ragged, sensor.missing_phalanx, sensor.pushed_finger) == (0, 0, 0, 1)
        assert sensor.noise_floor == SENSORS["structured_light"].noise_floor

    @pytest.mark.parametrize(
        ("wrong", "says"),
        [
            ({"motion": "juggle"}, "motion"),
            ({"frames": 0}, "frames"),
            ({"speed_mm": float("nan")}, "speed_mm"),
            ({"holes": 2.0}, "holes"),
            ({"clutter": "zoo"}, "clutter"),
        ],
    )
    def test_a_wrong_setting_is_named(self, wrong: dict[str, object], says: str) -> None:
        with pytest.raises(SettingError, match=says):
            make(**wrong)

    def test_a_hand_out_of_the_sensor_s_range_is_refused(self) -> None:
        with pytest.raises(SettingError, match="out of the range of kinect2"):
            make(sensor="kinect2", distance=0.2)


@pytest.fixture(scope="module")
def session() -> SyntheticSession:
    """Sixty frames, of which 20 to 34 are without the hand."""
    return synthesise(SyntheticSettings(frames=60, absent_from=20, absent_frames=15, clutter="face", sensor="kinect2"))


class TestAbsence:
    def test_hand_and_truth_are_gone_for_exactly_that_long(self, session: SyntheticSession) -> None:
        gone = [session.truth(index) is None for index in range(60)]
        assert gone == [20 <= index < 35 for index in range(60)]
        assert not any(session.hand_mask(index).any() for index in range(20, 35))

    def test_what_else_is_there_stays(self, session: SyntheticSession) -> None:
        assert (session[27].depth > 0).sum() > 500
        np.testing.assert_array_equal(session.clean_depth(27), session.clean_depth(28))

    def test_it_leaves_and_comes_back_through_the_side(self, session: SyntheticSession) -> None:
        seen = np.array([session.hand_mask(index).sum() for index in range(60)])
        assert seen[8] > 2000
        assert seen[50] > 2000
        assert seen[19] == 0
        assert seen[35] == 0
        partly = session.hand_mask(int(np.flatnonzero(seen[:20] > 0)[-1]))
        assert np.flatnonzero(partly.any(axis=0)).max() == session.camera.width - 1  # a right hand leaves to the right
