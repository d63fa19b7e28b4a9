"""The hand's shape is refined while it is tracked: towards the truth where it was wrong, hardly where it was right."""

import numpy as np
import pytest

from spf.hand import HandShape
from spf.hand.kinematics import joints_of
from spf.hand.shape import SHAPE_PARAMETERS, UNCHANGED, percent_of, varied
from spf.prepare import prepare
from spf.refine import agreement, modelled, refined, unrefined
from spf.shape_equations import View, _products
from spf.statefile import read_states, write_states
from spf.synthetic import SyntheticSettings, synthesise
from spf.track import begin, reshaped, track_frame
from spf.trackers import make_settings

FRAMES = 150


def change_of(**logs):
    change = np.zeros(len(SHAPE_PARAMETERS))
    for name, value in logs.items():
        change[SHAPE_PARAMETERS.index(name)] = value
    return change


@pytest.fixture(scope="module")
def session():
    return synthesise(SyntheticSettings(frames=FRAMES, seed=5, motion="wave", clutter="none"))


def tracked(session, change, **settings):
    """Track a session from its true pose with its true shape changed; the frames, and the state after each."""
    start = prepare(session, init="truth")
    start = start._replace(shape=varied(start.shape, change))
    tracking, state = begin("spf", make_settings("spf").replace(**settings), start, 0)
    frames, states = [], []
    for frame in session:
        state, result = track_frame(tracking, state, frame)
        frames.append(result)
        states.append(state)
    return tracking, frames, states


def error_mm(session, frames, last=50):
    return np.mean([np.linalg.norm(r.joints - session.truth(r.index).joints, axis=1) for r in frames[-last:]]) * 1e3


@pytest.fixture(scope="module")
def wrong():
    """Fingers that are too short and a thumb that is too long."""
    return change_of(thumb=0.1, index=-0.15, middle=-0.15, ring=-0.12, little=-0.15)


@pytest.fixture(scope="module")
def refined_run(session, wrong):
    return tracked(session, wrong)


def test_a_wrong_shape_comes_nearer_to_the_true_one(session, wrong, refined_run):
    _, frames, _ = refined_run
    lengths = slice(1, 6)
    left = (wrong + frames[-1].shape_change)[lengths]
    assert np.linalg.norm(left) < 0.7 * np.linalg.norm(wrong[lengths])
    _, as_it_was, _ = tracked(session, wrong, refine_shape=False)
    assert not any(result.shape_change.any() for result in as_it_was)
    assert error_mm(session, frames) < 0.9 * error_mm(session, as_it_was)


def test_the_true_shape_stays(session):
    _, frames, _ = tracked(session, UNCHANGED)
    assert np.abs(frames[-1].shape_change).max() < 0.05


def test_joints_are_those_of_the_hand_of_their_frame(refined_run):
    tracking, frames, _ = refined_run
    last = frames[-1]
    hand = reshaped(tracking, last.shape_change).hand
    np.testing.assert_allclose(joints_of(hand, last.pose, last.reference), last.joints, atol=1e-12)
    assert np.abs(joints_of(tracking.hand, last.pose, last.reference) - last.joints).max() > 1e-3


def test_a_frame_is_tracked_again_from_a_state_that_was_kept(session, refined_run, tmp_path):
    tracking, frames, states = refined_run
    write_states({index: states[index] for index in (30, 90, 91)}, tmp_path / "states.npz")
    kept = read_states(tmp_path / "states.npz")
    assert kept[90].refinement.gains == states[90].refinement.gains
    for index in (30, 90):
        _, again = track_frame(tracking, kept[index], session[index + 1])
        np.testing.assert_array_equal(again.pose, frames[index + 1].pose)
        np.testing.assert_array_equal(again.shape_change, frames[index + 1].shape_change)


@pytest.fixture(scope="module")
def plain_run(session):
    """With the true shape, which is not refined."""
    return tracked(session, UNCHANGED, refine_shape=False)


@pytest.fixture(scope="module")
def views(plain_run):
    """Views of tracked poses, with the true shape."""
    _, frames, _ = plain_run
    return [View(frames[i].observation, frames[i].pose, frames[i].reference) for i in (20, 30, 40)]


def judged(views, shape, candidate):
    refinement = unrefined()._replace(candidate=candidate)
    for index, view in enumerate(views):
        refinement = refined(refinement, shape, view, 1.0, [index])
    return refinement


def test_a_candidate_that_explains_less_is_refused(session, views):
    shape = HandShape.from_dict(session.hand_shape)
    refinement = judged(views, shape, change_of(index=0.25, middle=0.25, ring=0.25))
    np.testing.assert_array_equal(refinement.change, UNCHANGED)
    assert refinement.share == 0.5
    assert refinement.gains == ()


def test_a_candidate_that_explains_more_is_taken(session, views):
    wrong = change_of(index=0.25, middle=0.25, ring=0.25)
    refinement = judged(views, varied(HandShape.from_dict(session.hand_shape), wrong), -wrong)
    np.testing.assert_array_equal(refinement.change, -wrong)
    assert refinement.share == 1.0


def test_views_say_in_which_direction_the_shape_is_wrong(session, views):
    wrong = change_of(index=-0.2)
    shape = varied(HandShape.from_dict(session.hand_shape), wrong)
    refinement = unrefined()
    for index, view in enumerate(views):
        refinement = refined(refinement, shape, view, 1.0, [index])._replace(candidate=UNCHANGED, change=UNCHANGED)
    likeliest = np.linalg.solve(refinement.information, refinement.vector)
    assert likeliest[SHAPE_PARAMETERS.index("index")] > 0.02


def test_samples_that_disagree_are_no_view(plain_run):
    tracking, frames, _ = plain_run
    info = frames[30].info
    assert agreement(tracking.hand, info) > 0.2
    scattered = info.optimised.copy()
    scattered[:, 0] += np.linspace(-0.05, 0.05, len(scattered))
    assert agreement(tracking.hand, info._replace(optimised=scattered, predicted=scattered)) == 0.0


def test_the_products_in_pieces_are_the_products(rng):
    for count in (1, 128, 700):
        rows = rng.normal(size=(count, 36))
        np.testing.assert_allclose(_products(rows), rows.T @ rows, rtol=1e-9, atol=1e-9)


def test_the_papers_filter_refines_nothing():
    assert make_settings("spf").refine_shape
    assert not make_settings("spf", "paper").refine_shape


def test_a_shape_varies_by_factors():
    shape = HandShape("left", scale=0.9, lengths=tuple(np.linspace(0.9, 1.1, 15)), palm_width=1.1)
    varied_shape = varied(shape, change_of(scale=0.1, middle=np.log(1.2), palm_width=-0.1, finger_thickness=0.05))
    assert varied_shape.scale == pytest.approx(0.9 * np.exp(0.1))
    ratios = np.array(varied_shape.lengths) / np.array(shape.lengths)
    np.testing.assert_allclose(ratios.reshape(5, 3), [[1.0] * 3, [1.0] * 3, [1.2] * 3, [1.0] * 3, [1.0] * 3])
    assert varied_shape.palm_width == pytest.approx(1.1 * np.exp(-0.1))
    assert (varied_shape.palm_thickness, varied_shape.side) == (shape.palm_thickness, "left")
    assert varied(shape, UNCHANGED) == shape
    assert modelled(shape)[0] is modelled(varied(shape, UNCHANGED))[0]


def test_changes_are_told_in_per_cent():
    said = percent_of(np.stack([UNCHANGED, change_of(scale=np.log(1.05), index=0.2, ring=-0.2)]))
    np.testing.assert_allclose(said["size"], [0.0, 5.0])
    np.testing.assert_allclose(said["length of the fingers"], [0.0, 0.0], atol=1e-12)
