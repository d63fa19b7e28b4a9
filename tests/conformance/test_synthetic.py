"""Every motion in front of every sensor keeps to what a session is."""

from __future__ import annotations

import numpy as np
import pytest

from spf.synthetic import MOTIONS, SENSORS, SyntheticSettings, synthesise


@pytest.mark.parametrize("sensor", SENSORS)
@pytest.mark.parametrize("motion", MOTIONS)
def test_a_synthetic_session_is_a_session(motion: str, sensor: str) -> None:
    session = synthesise(SyntheticSettings(motion=motion, sensor=sensor, frames=40, seed=6))
    model = SENSORS[sensor]
    assert len(session) == 40
    assert session.has_truth
    assert session.joint_definition == "model"
    assert (np.diff(session.times_ns) > 0).all()
    for index in (0, 17, -1):
        frame = session[index]
        assert frame.depth.shape == (model.camera.height, model.camera.width)
        assert frame.depth.dtype == np.float32
        read = frame.depth[frame.depth > 0]
        assert read.min() >= model.near - model.depth_unit
        assert read.max() <= model.far + model.depth_unit
        assert frame.truth is not None
        assert frame.truth.joints.shape == (21, 3)
        hand = session.hand_mask(frame.index)
        assert hand.sum() > 1000
        assert (frame.depth[hand] > 0).mean() > 0.6  # the sensor sees most of the hand
