"""The Smart Particle Filter's step: its stages, its determinism, its weights (Fig. 6)."""

import numpy as np
import pytest

from spf.filters import smart
from spf.filters.step import start_at
from spf.frame import Frame
from spf.hand import HandShape
from spf.hand.kinematics import joints_of
from spf.initialise import Start
from spf.locate import reach_of
from spf.observation import observe
from spf.synthetic import SyntheticSettings, synthesise
from spf.track import begin, track_frame
from spf.trackers import PRESETS, TRACKERS, make_settings

_SETTINGS = smart.SpfSettings(rounds=4)


@pytest.fixture(scope="module")
def session():  # type: ignore[no-untyped-def]
    return synthesise(
        SyntheticSettings(motion="open_close", sensor="kinect2", frames=48, seed=3, absent_from=20, absent_frames=8)
    )


def _first(session):  # type: ignore[no-untyped-def]
    frame: Frame = session[0]
    hand = session.hand
    state = start_at(hand, frame.truth.pose, frame.truth.orientation, frame.time - 1 / 30, _SETTINGS.n)
    return hand, state, observe(frame, state.estimate[:3], reach_of(hand))


def test_a_step_tells_everything_that_happened(session) -> None:  # type: ignore[no-untyped-def]
    hand, state, observation = _first(session)
    _, info = smart.step(np.random.default_rng(0), state, observation, hand, _SETTINGS, record=True)
    n = _SETTINGS.n
    assert info.predicted.shape == info.optimised.shape == (n, hand.dofs)
    assert info.cost_before.shape == info.cost_after.shape == (n,)
    assert info.log_weights.shape == info.log_correction.shape == info.log_likelihood.shape == (2 * n,)
    assert np.exp(info.log_weights).sum() == pytest.approx(1.0)
    assert 1 <= info.ess <= 2 * n
    assert len(info.trajectories) == n
    for trace, predicted, optimised, origin in zip(
        info.trajectories, info.predicted, info.optimised, info.origins, strict=True
    ):
        assert origin == "recombined" or (trace.poses[0] == predicted).all()
        np.testing.assert_array_equal(trace.poses[-1], optimised)
    assert info.cost_after.mean() < info.cost_before.mean()


def test_drawn_samples_hold_the_hand_and_have_weights_of_their_own(session) -> None:  # type: ignore[no-untyped-def]
    hand, state, observation = _first(session)
    settings = _SETTINGS.replace(weighting="laplace")
    _, info = smart.step(np.random.default_rng(0), state, observation, hand, settings, record=True)
    assert np.isnan(info.window)
    assert np.exp(info.log_weights).sum() == pytest.approx(1.0)
    ends = np.array([trace.poses[-1] for trace in info.trajectories])
    assert (np.abs(info.optimised - ends).max(axis=1) > 1e-4).all()  # drawn around the optima, not the optima
    start = Start(
        0, session[0].truth.pose, session[0].truth.orientation, HandShape.from_dict(session.hand_shape), 0.2, 1.0
    )
    tracking, track = begin("spf", make_settings("spf").replace(weighting="laplace"), start, 0, time=session[0].time)
    for index in range(8):
        track, result = track_frame(tracking, track, session[index])
    assert np.linalg.norm(result.joints - session[7].truth.joints, axis=1).mean() < 0.012


def test_a_step_is_a_function_of_its_arguments(session) -> None:  # type: ignore[no-untyped-def]
    hand, state, observation = _first(session)
    first, second = (smart.step(np.random.default_rng(5), state, observation, hand, _SETTINGS)[0] for _ in range(2))
    np.testing.assert_array_equal(first.estimate, second.estimate)
    np.testing.assert_array_equal(first.particles.poses, second.particles.poses)


def test_recentring_changes_no_hand(session) -> None:  # type: ignore[no-untyped-def]
    hand, state, observation = _first(session)
    new, info = smart.step(np.random.default_rng(0), state, observation, hand, _SETTINGS)
    np.testing.assert_allclose(
        joints_of(hand, new.estimate, new.reference), joints_of(hand, info.estimate, info.reference), atol=1e-9
    )
    np.testing.assert_allclose(new.estimate[3:6], 0.0)
    np.testing.assert_allclose(new.reference @ new.reference.T, np.eye(3), atol=1e-12)


def test_without_correction_all_factors_are_one(session) -> None:  # type: ignore[no-untyped-def]
    hand, state, observation = _first(session)
    _, info = smart.step(np.random.default_rng(0), state, observation, hand, _SETTINGS.replace(correction=False))
    np.testing.assert_array_equal(info.log_correction, 0.0)


def test_a_tiny_window_takes_the_weight_off_the_optimised_samples(session) -> None:  # type: ignore[no-untyped-def]
    hand, state, observation = _first(session)
    wide, narrow = (
        smart.step(np.random.default_rng(0), state, observation, hand, _SETTINGS.replace(h=h))[1] for h in (50.0, 0.1)
    )
    assert wide.optimised_share > 0.5
    assert narrow.optimised_share < 0.01


@pytest.mark.parametrize("tracker", TRACKERS)
@pytest.mark.parametrize("preset", PRESETS)
def test_every_tracker_and_preset_tracks_a_few_frames(tracker: str, preset: str, session) -> None:  # type: ignore[no-untyped-def]
    truth = session[0].truth
    settings = make_settings(tracker, preset)
    hand, state, observation = _first(session)
    state = start_at(hand, truth.pose, truth.orientation, -1 / 30, getattr(settings, "n", 1))
    _, info = TRACKERS[tracker].step(np.random.default_rng(0), state, observation, hand, settings)
    error = np.linalg.norm(joints_of(hand, info.estimate, info.reference) - truth.joints, axis=1).mean()
    assert error < (0.03 if preset == "paper" else 0.012)


def test_a_hand_that_leaves_is_lost_and_one_that_comes_back_is_found(session) -> None:  # type: ignore[no-untyped-def]
    truth = session[0].truth
    start = Start(0, truth.pose, truth.orientation, HandShape.from_dict(session.hand_shape), 0.2, 1.0)
    tracking, state = begin("spf", smart.SpfSettings(), start, 0)
    results = []
    for frame in session:
        state, result = track_frame(tracking, state, frame)
        results.append(result)
    lost = [result.lost for result in results]
    assert not any(lost[:12])
    assert all(lost[20:28])
    assert any(result.recovered for result in results[28:])
    assert not lost[-1]
