"""Every tracker keeps to the contract of a step, repeats itself with a seed, and holds a hand that moves slowly."""

from __future__ import annotations

import numpy as np
import pytest

from spf.filters.step import State, StepInfo, start_at
from spf.frame import Frame
from spf.hand import HandShape
from spf.hand.kinematics import joints_of
from spf.hand.model import Hand
from spf.initialise import Start, reach_of
from spf.observation import Observation, observe
from spf.settings import Settings
from spf.synthetic import SyntheticSession, SyntheticSettings, synthesise
from spf.track import begin, track_frame
from spf.trackers import PRESETS, TRACKERS, make_settings

#: Settings that make a frame of each tracker cheap.
CHEAP: dict[str, dict[str, str]] = {
    "spf": {"rounds": "3"},
    "smd": {"rounds": "3"},
    "gd": {"rounds": "3"},
    "bfgs": {"rounds": "1", "iterations": "5"},
    "powell": {"rounds": "1", "evaluations": "60"},
    "lm": {"rounds": "2"},
    "condensation": {"n": "40"},
    "apf": {"n": "30", "layers": "3"},
    "nbp": {"n": "20", "iterations": "2"},
}

#: Bound of the mean joint error, mm, after the frames of the slow session, from the truth and with the defaults.
HELD: dict[str, float] = {
    "spf": 8.0, "smd": 16.0, "gd": 16.0, "bfgs": 8.0, "powell": 8.0, "lm": 8.0, "condensation": 16.0, "apf": 20.0, "nbp": 16.0,
}  # fmt: skip
FRAMES = 5


@pytest.fixture(scope="module")
def session() -> SyntheticSession:
    return synthesise(SyntheticSettings(motion="open_close", sensor="kinect2", frames=48, seed=3, speed_mm=2.0))


def first_frame(session: SyntheticSession, settings: Settings) -> tuple[Hand, State, Observation, Frame]:
    frame, hand = session[0], session.hand
    assert frame.truth is not None
    assert frame.truth.pose is not None
    assert frame.truth.orientation is not None
    count = getattr(settings, "n", 1)
    state = start_at(hand, frame.truth.pose, frame.truth.orientation, frame.time - 1 / 30, count)
    return hand, state, observe(frame, state.estimate[:3], reach_of(hand)), frame


def one_step(session: SyntheticSession, name: str, seed: int = 0, *, record: bool = False) -> tuple[State, StepInfo]:
    settings = make_settings(name, changes=CHEAP[name])
    hand, state, observation, _ = first_frame(session, settings)
    return TRACKERS[name].step(np.random.default_rng(seed), state, observation, hand, settings, record=record)


@pytest.mark.parametrize("name", TRACKERS)
def test_a_step_keeps_to_the_contract(name: str, session: SyntheticSession) -> None:
    hand, (state, info) = session.hand, one_step(session, name, record=True)
    settings = make_settings(name, changes=CHEAP[name])
    n, m, dofs = len(info.predicted), len(info.optimised), hand.dofs
    assert n == getattr(settings, "n", 1) + info.origins.count("learned")
    assert m in (0, n)
    assert info.predicted.shape == (n, dofs)
    assert info.optimised.shape == (m, dofs)
    assert info.ancestors.shape == (n,)
    assert len(info.origins) == n
    assert info.cost_before.shape == (n,)
    assert info.cost_after.shape == (m,)
    samples = (info.golden, info.overlap, info.log_likelihood, info.log_correction, info.log_weights)
    assert {array.shape for array in samples} == {(n + m,)}
    assert np.exp(info.log_weights).sum() == pytest.approx(1.0)
    assert info.predicted_weights.sum() + info.optimised_weights.sum() == pytest.approx(1.0)
    assert info.optimised_share == pytest.approx(info.optimised_weights.sum())
    assert 1 - 1e-9 <= info.ess <= n + m + 1e-9
    assert info.evaluations > 0
    assert info.timings
    assert all(seconds >= 0 for seconds in info.timings.values())
    for poses in (info.predicted, info.optimised, info.estimate[None]):
        assert (poses >= hand.limits[:, 0] - 1e-9).all()
        assert (poses <= hand.limits[:, 1] + 1e-9).all()
    assert np.isfinite([info.estimate_cost, info.estimate_golden, info.estimate_log_likelihood]).all()
    assert 0 <= info.estimate_overlap <= 1
    poses = np.concatenate([info.predicted, info.optimised])
    np.testing.assert_allclose(info.estimate, np.exp(info.log_weights) @ poses, atol=1e-12)
    joints = joints_of(hand, info.estimate, info.reference)
    np.testing.assert_allclose(joints_of(hand, state.estimate, state.reference), joints, atol=1e-9)
    assert state.particles.poses.shape == state.particles.velocities.shape == (n + m, dofs)


@pytest.mark.parametrize("name", TRACKERS)
def test_trajectories_lead_from_the_predicted_to_the_optimised_samples(name: str, session: SyntheticSession) -> None:
    _, info = one_step(session, name, record=True)
    assert len(info.trajectories) == len(info.optimised)
    for n, (trajectory, optimised) in enumerate(zip(info.trajectories, info.optimised, strict=True)):
        assert len(trajectory.poses) == len(trajectory.costs) == len(trajectory.step_sizes)
        assert trajectory.step_sizes.shape == trajectory.poses.shape
        if info.origins[n] != "recombined":
            np.testing.assert_array_equal(trajectory.poses[0], info.predicted[n])
        np.testing.assert_array_equal(trajectory.poses[-1], optimised)
    _, silent = one_step(session, name)
    assert silent.trajectories == ()
    np.testing.assert_array_equal(silent.estimate, info.estimate)


@pytest.mark.parametrize("name", TRACKERS)
def test_a_step_is_a_function_of_its_arguments(name: str, session: SyntheticSession) -> None:
    (first, _), (again, _) = one_step(session, name, 5), one_step(session, name, 5)
    np.testing.assert_array_equal(first.estimate, again.estimate)
    np.testing.assert_array_equal(first.particles.poses, again.particles.poses)
    np.testing.assert_array_equal(first.particles.log_weights, again.particles.log_weights)
    other, _ = one_step(session, name, 6)
    assert (first.estimate != other.estimate).any()  # the pool of pixels is random for all


@pytest.mark.parametrize("name", TRACKERS)
def test_a_slow_hand_is_held(name: str, session: SyntheticSession) -> None:
    truth = session[0].truth
    assert truth is not None
    assert truth.pose is not None
    assert truth.orientation is not None
    assert session.hand_shape is not None
    start = Start(0, truth.pose, truth.orientation, HandShape.from_dict(session.hand_shape), 0.2, 1.0)
    tracking, state = begin(name, make_settings(name), start, 0, time=session[0].time)
    for index in range(FRAMES):
        frame = session[index]
        state, result = track_frame(tracking, state, frame)
        assert not result.lost
    assert frame.truth is not None
    assert 1e3 * np.linalg.norm(result.joints - frame.truth.joints, axis=1).mean() < HELD[name]


@pytest.mark.parametrize("preset", PRESETS)
@pytest.mark.parametrize("name", TRACKERS)
def test_settings_come_back_from_a_dictionary_and_from_text(name: str, preset: str) -> None:
    settings = make_settings(name, preset)
    assert TRACKERS[name].settings().replace(**settings.to_dict()) == settings
    as_text = {key: str(value) for key, value in settings.to_dict().items()}
    assert make_settings(name, changes=as_text) == settings


@pytest.mark.parametrize("name", TRACKERS)
def test_every_setting_says_what_it_is(name: str) -> None:
    infos = TRACKERS[name].settings.describe()
    for info in infos:
        assert info.meaning
        assert info.group
        assert info.kind in (bool, str) or (info.low is not None and info.high is not None)
        assert info.kind is not str or info.default in info.choices
    by_name = {info.name: info for info in infos}
    assert by_name[TRACKERS[name].cost].kind is int


@pytest.mark.parametrize("name", TRACKERS)
def test_the_first_step_needs_no_fitting_state(name: str, session: SyntheticSession) -> None:
    """A state with another number of particles, as after a change of settings or of the tracker, is taken."""
    settings = make_settings(name, changes=CHEAP[name])
    hand, state, observation, frame = first_frame(session, settings)
    other = start_at(hand, state.estimate, state.reference, frame.time - 1 / 30, 7)
    _, info = TRACKERS[name].step(np.random.default_rng(0), other, observation, hand, settings)
    assert len(info.predicted) == getattr(settings, "n", 1) + info.origins.count("learned")
