"""A focal length that cannot be is told by the hand; one that can be is believed."""

from __future__ import annotations

import numpy as np
import pytest

from spf.frame import Camera, Frame, Truth
from spf.hand.kinematics import joints_of
from spf.hand.shape import HandShape
from spf.initialise import Start, find_start
from spf.lens import Through, as_seen, as_stated, is_believable, lens_of, lenses_for, seen_through, unlikelihood
from spf.manifest import Plan
from spf.prepare import SessionFrames
from spf.runs import track_plan
from spf.sessions import open_session
from spf.trackers import make_settings

CAMERA = Camera(320, 240, 220.0, 225.0, 160.0, 120.0)


def _frame(joints: np.ndarray) -> Frame:
    return Frame(0, 0.0, np.zeros((240, 320), np.float32), CAMERA, truth=Truth(joints))


def test_the_pixels_and_depths_of_the_truth_stay():
    joints = np.random.default_rng(0).normal(size=(21, 3)) * 0.05 + [0.02, 0.01, 0.6]
    seen = seen_through(_frame(joints), 1.4)
    assert seen.camera.fx == pytest.approx(1.4 * CAMERA.fx)
    assert seen.truth is not None
    np.testing.assert_allclose(seen.camera.project(seen.truth.joints), CAMERA.project(joints))
    np.testing.assert_allclose(as_stated(seen.truth.joints, 1.4), joints)
    np.testing.assert_allclose(as_seen(joints, 1.4), seen.truth.joints)


def test_frames_are_seen_through_a_lens_one_by_one_and_in_parts():
    frames = Through([_frame(np.full((21, 3), float(i))) for i in range(4)], 2.0)
    assert len(frames[1:3]) == 2
    assert frames[1:3][0].truth.joints[0, 0] == 0.5
    assert frames[1:3][0].camera.fy == 450.0


def test_a_believable_hand_is_never_doubted():
    assert is_believable(HandShape("right").hand().length)
    assert is_believable(HandShape("right", scale=1.2).hand().length)
    assert not is_believable(HandShape("right", scale=1.43).hand().length)


@pytest.mark.parametrize(
    ("goldens", "least", "most"),
    [
        ((0.35, 0.28, 0.25, 0.25, 0.25), 1.3, 1.5),  # explained much better through a lens
        ((0.20, 0.20, 0.20, 0.20, 0.20), 1.3, 1.5),  # too long to be true, and as well explained otherwise
        ((0.20, 0.33, 0.36, 0.40, 0.45), 1.0, 1.0),  # a giant's hand that the stated camera explains
    ],
)
def test_the_likeliest_lens(goldens: tuple[float, ...], least: float, most: float):
    lenses = (1.0, *lenses_for(0.255))
    assert least <= lens_of(lenses, [0.255 / lens for lens in lenses], goldens) <= most


def test_a_large_hand_is_no_reason_to_doubt_the_camera():
    lenses = (1.0, *lenses_for(0.224))
    assert lens_of(lenses, [0.224 / lens for lens in lenses], [0.20] * 5) == 1.0


def test_a_start_mends_a_focal_length_that_is_a_third_too_short():
    session = open_session("sessions/open-close.mcap")
    wrong = Through(SessionFrames(session), 1 / 1.5)
    start = find_start(wrong, np.random.default_rng(1), side="right")
    assert start.shape.lens == pytest.approx(1.5, rel=0.15)
    assert "cm long" in start.remark
    truth = wrong[start.frame].truth
    assert truth is not None
    joints = as_stated(joints_of(start.shape.hand(), start.pose, start.reference), start.shape.lens)
    assert np.linalg.norm(joints - truth.joints, axis=1).mean() < 0.025  # m, in the stated camera


def test_frames_before_the_first_pose_show_it_in_the_stated_camera_too():
    session, shape = open_session("sessions/open-close.mcap"), HandShape("right", lens=1.2)
    pose = shape.hand().neutral_pose()
    pose[:3] = 0.05, 0.02, 0.5
    start = Start(1, pose, np.eye(3), shape, 0.2, 1.0)
    result = next(track_plan(session, Plan("spf", "default", make_settings("spf"), 0, "auto", 0, 2, start)))
    assert (result.index, result.lost) == (0, True)
    np.testing.assert_allclose(result.joints, as_stated(joints_of(shape.hand(), pose), 1.2))


def test_a_length_is_the_less_likely_the_farther_from_the_usual_but_no_faster_than_evenly_far_away():
    usual, long, longer, longest = unlikelihood(np.array([0.187, 0.205, 0.247, 0.307]))
    assert usual == 0.0 < long < longer < longest
    assert (longest - longer) / 0.06 == pytest.approx(2.0 / 0.012)
    assert unlikelihood(np.array([0.175]))[0] == pytest.approx(0.5)
