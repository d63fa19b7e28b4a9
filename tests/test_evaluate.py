"""The measures of a run, against small cases worked out by hand."""

import dataclasses

import numpy as np
import pytest

from spf.evaluate import agreement_with_depth, count_losses, evaluate_run, joint_errors, measure_joints
from spf.evaluate.depth_agreement import surface_distances
from spf.frame import JOINT_NAMES
from spf.hand import load_hand
from spf.hand.kinematics import pose_hand
from spf.joint_definitions import corrected_joints, nearest_joints, offset_axes, offsets_of, relative_offsets
from spf.manifest import Plan, manifest_of
from spf.prepare import prepare
from spf.runs import Run
from spf.synthetic import SyntheticSettings, synthesise
from spf.track import TrackedFrame
from spf.trackers import make_settings
from spf.trackfile import row_of, track_of


def errors_of(*frames):
    """(N, 21) m from one error in mm a frame, the same at all joints."""
    return np.array(frames, dtype=float)[:, None] * 1e-3 * np.ones(21)


def test_measures_of_constant_errors():
    measures = measure_joints(errors_of(10, 25, 35, 60))
    assert measures.frames == 4
    assert measures.mean == pytest.approx(0.0325)
    assert measures.median == pytest.approx(0.030)
    assert measures.fingertips == measures.palm == pytest.approx(0.0325)
    assert measures.frames_under == {20: 0.25, 30: 0.5, 40: 0.75}
    assert measures.joints_curve[[0, 9, 10, 25, 59, 60, 80]].tolist() == [0, 0, 0.25, 0.5, 0.75, 1.0, 1.0]
    np.testing.assert_array_equal(measures.joints_curve, measures.frames_curve)
    # steps at 10, 25 and 35 mm: trapezoids give each step half a millimetre more
    assert measures.area == pytest.approx(0.25 * ((50 - 10 + 0.5) + (50 - 25 + 0.5) + (50 - 35 + 0.5)) / 50)


def test_one_bad_joint_spoils_the_frame_and_not_the_mean():
    errors = errors_of(0, 0)
    tip = JOINT_NAMES.index("index_tip")
    errors[1, tip] = 0.042
    measures = measure_joints(errors)
    assert measures.mean == pytest.approx(0.001)
    assert measures.fingertips == pytest.approx(0.0042)
    assert measures.palm == 0.0
    assert measures.median == 0.0
    assert measures.per_joint[tip] == pytest.approx(0.021)
    assert measures.frames_under == {20: 0.5, 30: 0.5, 40: 0.5}
    assert measures.joints_curve[41] == pytest.approx(41 / 42)
    assert measures.frames_curve[41] == 0.5


def test_joints_and_frames_without_truth_are_left_out():
    truth = np.zeros((3, 21, 3))
    truth[1] = np.nan
    truth[2, 5:] = np.nan
    joints = np.zeros((3, 21, 3))
    joints[:, :, 2] = [[0.01], [0.5], [0.02]]
    measures = measure_joints(joint_errors(joints, truth))
    assert measures.frames == 2
    assert measures.mean == pytest.approx((21 * 0.01 + 5 * 0.02) / 26)
    assert measures.frames_under[20] == 0.5


def test_no_truth_at_all_measures_nothing():
    measures = measure_joints(np.full((4, 21), np.nan))
    assert measures.frames == 0
    assert np.isnan([measures.mean, measures.median, measures.area, measures.frames_under[20]]).all()


@pytest.mark.parametrize(
    ("flags", "losses", "frames_lost", "recoveries", "mean"),
    [
        ("......", 0, 0, 0, None),
        ("..xx..", 1, 2, 1, 2.0),
        (".x..xxx.", 2, 4, 2, 2.0),
        ("..xxxx", 1, 4, 0, None),
        ("xx....", 0, 2, 0, None),
        ("xx.x.x", 2, 4, 1, 1.0),
        ("xxxx", 0, 4, 0, None),
    ],
)
def test_losses(flags, losses, frames_lost, recoveries, mean):
    found = count_losses(np.array([flag == "x" for flag in flags]))
    assert found[:3] == (losses, frames_lost, recoveries)
    assert np.isnan(found.frames_to_recover) if mean is None else found.frames_to_recover == mean


def test_distances_to_a_triangle():
    vertices = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0]])
    faces = np.array([[0, 1, 2]], np.int32)
    points = np.array([[0.2, 0.2, 0.5], [-3, -4, 0], [2, 0, 0], [1, 1, 0], [0.25, 0.25, 0]])
    expected = [0.5, 5.0, 1.0, np.sqrt(0.5), 0.0]
    np.testing.assert_allclose(surface_distances(points, vertices, faces), expected, atol=1e-12)


@pytest.fixture(scope="module")
def clean():
    """Frames of a hand alone, seen without a sensor's faults."""
    settings = SyntheticSettings(
        frames=6, clutter="none", ragged=0.0, holes=0.0, missing_phalanx=0.0, pushed_finger=0.0
    )
    return synthesise(settings)


def test_the_true_pose_agrees_with_its_depth(clean):
    frame = clean[0]
    good = agreement_with_depth(clean.hand, frame.truth.pose, frame.truth.orientation, frame)
    assert good.silhouette_iou > 0.9
    assert good.data_to_model < 0.003


def test_a_shifted_pose_agrees_less(clean):
    frame = clean[0]
    pose = frame.truth.pose.copy()
    pose[2] += 0.01  # away from the camera, where its silhouette hardly changes
    behind = agreement_with_depth(clean.hand, pose, frame.truth.orientation, frame)
    assert 0.004 < behind.data_to_model < 0.012
    pose[0] += 0.04
    beside = agreement_with_depth(clean.hand, pose, frame.truth.orientation, frame)
    assert beside.silhouette_iou < 0.6


def test_a_pose_where_nothing_is_has_no_overlap(clean):
    frame = clean[0]
    pose = frame.truth.pose.copy()
    pose[2] += 1.0
    away = agreement_with_depth(clean.hand, pose, frame.truth.orientation, frame)
    assert away.silhouette_iou == 0.0
    assert np.isnan(away.data_to_model)


@pytest.mark.parametrize("side", ["left", "right"])
def test_offsets_are_found_again_on_any_hand(side, rng):
    hand = load_hand(side).scaled(0.7)
    pose = hand.constrain(0.2 * rng.normal(size=hand.dofs))
    posed = pose_hand(hand, pose)
    offsets = 0.05 * rng.normal(size=(21, 3))
    marked = corrected_joints(hand, posed, offsets)
    np.testing.assert_allclose(relative_offsets(hand, posed, marked), offsets, atol=1e-6)  # the mesh file holds float32
    lengths = np.linalg.norm(marked - posed.joints, axis=1)
    np.testing.assert_allclose(lengths, hand.length * np.linalg.norm(offsets, axis=1), rtol=1e-5)


def test_offsets_of_a_left_hand_are_the_mirror_image():
    offsets = np.zeros((21, 3))
    offsets[:, 0] = 0.1
    moved = {}
    for side in ("left", "right"):
        hand = load_hand(side)
        posed = pose_hand(hand, hand.neutral_pose())
        moved[side] = corrected_joints(hand, posed, offsets)[0] - posed.joints[0]
    np.testing.assert_allclose(moved["left"] * [-1, 1, 1], moved["right"], atol=1e-3)


def test_constant_offsets_are_found_from_a_track_whatever_else_is_wrong(rng):
    hand = load_hand("left")
    posed = [pose_hand(hand, pose) for pose in hand.constrain(0.2 * rng.normal(size=(9, hand.dofs)))]
    offsets = 0.05 * rng.normal(size=(21, 3))
    marked = np.stack([corrected_joints(hand, each, offsets) for each in posed])
    axes, joints = (np.stack(part) for part in zip(*((offset_axes(hand, p), p.joints) for p in posed), strict=True))
    truth = marked.copy()
    truth[2] += 0.5  # one frame in which another thing was tracked
    truth[5, 3], truth[:, 8] = np.nan, np.nan
    found = nearest_joints(axes, joints, truth, np.ones(9, bool))
    marked[:, 8] = joints[:, 8]  # is never known
    np.testing.assert_allclose(found, marked, atol=1e-6)


def test_the_models_own_joints_need_no_correction_and_unknown_ones_have_none():
    assert not offsets_of("model").any()
    assert offsets_of("somebody's") is None


def perfect_run(session, lost=()):
    """A run whose track is the truth."""
    start = prepare(session, init="truth")
    plan = Plan("spf", "default", make_settings("spf"), 0, "truth", 0, len(session), start)
    results = []
    for frame in session:
        truth = frame.truth
        results.append(
            TrackedFrame(
                frame.index,
                frame.time,
                truth.pose,
                truth.orientation,
                truth.joints,
                frame.index in lost,
                False,
                -1.0,
                2.0,
                0.1,
                0.9,
                0.02,
                {},
                None,
                None,
            )
        )
    manifest = manifest_of(plan, session, None, ["test"])
    return Run(manifest, plan, track_of([row_of(result) for result in results], session.hand.dof_names))


def test_the_truth_itself_has_no_error(clean):
    measures = evaluate_run(perfect_run(clean, lost=(3,)), clean)
    assert measures["frames"] == 6
    assert measures["mean_joint_error_mm"] == pytest.approx(0.0, abs=1e-9)
    assert measures["mean_joint_error_raw_mm"] == pytest.approx(0.0, abs=1e-9)
    assert measures["frames_max_error_under_mm"] == {"20": 1.0, "30": 1.0, "40": 1.0}
    assert measures["auc_0_50mm"] == pytest.approx(1.0)
    assert (measures["losses"], measures["frames_lost"], measures["recoveries"]) == (1, 1, 1)
    assert measures["seconds_per_frame_median"] == pytest.approx(0.02)
    assert measures["ess_median"] == 2.0
    assert measures["silhouette_iou"] > 0.9
    assert measures["frames_iou_over_60"] == pytest.approx(5 / 6)
    assert measures["evaluations_per_frame"] is None


def test_a_definition_without_offsets_is_said_to_be_raw(clean):
    run = perfect_run(clean)
    other = dataclasses.replace(clean, joint_definition="nyu")
    measures = evaluate_run(run, other)
    assert measures["mean_joint_error_mm"] == measures["mean_joint_error_raw_mm"]
    assert measures["mean_joint_error_own_offsets_mm"] == pytest.approx(0.0, abs=1e-6)
    assert measures["correction"].startswith("none fitted")


def test_without_truth_the_depth_is_all_there_is(clean):
    run = perfect_run(clean)
    other = dataclasses.replace(clean, has_truth=False)
    measures = evaluate_run(run, other)
    assert "mean_joint_error_mm" not in measures
    assert measures["mean_data_to_model_mm"] < 3.0
