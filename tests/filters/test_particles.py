"""Weights, effective sample size, resampling and dynamics."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.special import logsumexp

from spf.filters.dynamics import DynamicsSettings, drift, noise_scale, predict
from spf.filters.particles import ess, log_sum_exp, normalise, weighted_mean
from spf.filters.resampling import SCHEMES, ResamplingSettings, resample, resample_when_needed, systematic
from spf.hand import load_hand

_LOGS = st.lists(st.floats(-800, 800), min_size=1, max_size=30).map(np.array)


@given(_LOGS, st.floats(-1e3, 1e3))
def test_weights_do_not_depend_on_a_constant(logs: np.ndarray, constant: float) -> None:
    np.testing.assert_allclose(np.exp(normalise(logs)), np.exp(normalise(logs + constant)), atol=1e-9)


@given(_LOGS)
def test_the_effective_sample_size_lies_between_1_and_n(logs: np.ndarray) -> None:
    assert 1 - 1e-9 <= ess(normalise(logs)) <= len(logs) + 1e-6


@given(st.lists(_LOGS.map(lambda logs: np.resize(logs, 5)), min_size=1, max_size=4).map(np.array))
def test_sums_of_exponentials_are_scipys(logs: np.ndarray) -> None:
    np.testing.assert_allclose(log_sum_exp(logs), logsumexp(logs, axis=1), rtol=1e-12, atol=1e-12)


def test_a_sum_of_vanishing_exponentials_vanishes() -> None:
    np.testing.assert_array_equal(log_sum_exp(np.array([[-np.inf, -np.inf], [-np.inf, 0.0]])), [-np.inf, 0.0])


def test_equal_weights_have_full_effective_size() -> None:
    np.testing.assert_allclose(ess(normalise(np.zeros(7))), 7.0)


def test_weights_that_all_vanish_become_equal() -> None:
    np.testing.assert_allclose(np.exp(normalise(np.full(4, -np.inf))), 0.25)


@given(_LOGS, st.integers(0, 2**31))
def test_systematic_resampling_draws_each_its_floor_or_its_ceiling(logs: np.ndarray, seed: int) -> None:
    log_weights = normalise(logs)
    count = 50
    drawn = np.bincount(systematic(log_weights, count, np.random.default_rng(seed)), minlength=len(logs))
    expected = count * np.exp(log_weights)
    assert (drawn >= np.floor(expected - 1e-6)).all()
    assert (drawn <= np.ceil(expected + 1e-6)).all()


@given(_LOGS, st.integers(0, 2**31))
def test_residual_resampling_draws_each_at_least_its_floor(logs: np.ndarray, seed: int) -> None:
    log_weights = normalise(logs)
    ancestors = SCHEMES["residual"](log_weights, 50, np.random.default_rng(seed))
    assert len(ancestors) == 50
    drawn = np.bincount(ancestors, minlength=len(logs))
    assert (drawn >= np.floor(50 * np.exp(log_weights) - 1e-6)).all()


@pytest.mark.parametrize("scheme", SCHEMES)
def test_resampling_is_unbiased(scheme: str, rng: np.random.Generator) -> None:
    log_weights = normalise(np.log([0.05, 0.15, 0.8]))
    settings = ResamplingSettings(resampling=scheme)
    drawn = sum(np.bincount(resample(log_weights, 4, settings, rng), minlength=3) for _ in range(4000))
    np.testing.assert_allclose(drawn / 16000, [0.05, 0.15, 0.8], atol=0.01)


@pytest.mark.parametrize("scheme", SCHEMES)
def test_ancestors_are_ascending_indices_and_none_has_no_weight(scheme: str, rng: np.random.Generator) -> None:
    log_weights = normalise(np.array([-np.inf, 0.0, -np.inf, 1.0, -np.inf]))
    for count in (1, 3, 40):
        ancestors = SCHEMES[scheme](log_weights, count, rng)
        assert len(ancestors) == count
        assert (np.diff(ancestors) >= 0).all()
        assert set(ancestors.tolist()) <= {1, 3}


def test_a_set_is_resampled_when_its_effective_size_is_small_or_its_size_is_another(rng: np.random.Generator) -> None:
    settings = ResamplingSettings()
    even, one = normalise(np.array([0.0, 0.1, -0.1, 0.0])), normalise(np.array([0.0, -50.0, -50.0, -50.0]))
    kept, carried = resample_when_needed(even, 4, settings, 0.5, rng)
    np.testing.assert_array_equal(kept, np.arange(4))
    np.testing.assert_array_equal(carried, even)
    for log_weights, count, below in ((one, 4, 0.5), (even, 6, 0.5), (even, 4, 1.0)):
        drawn, carried = resample_when_needed(log_weights, count, settings, below, rng)
        assert len(drawn) == count
        np.testing.assert_allclose(carried, -np.log(count))


def test_the_mean_is_weighted() -> None:
    np.testing.assert_allclose(weighted_mean(np.array([[0.0], [4.0]]), np.log([0.25, 0.75])), [3.0])


def test_prediction_moves_by_velocity_and_noise_within_the_limits(rng: np.random.Generator) -> None:
    hand, settings = load_hand("right"), DynamicsSettings(dynamics="first-order")
    poses = np.tile(hand.neutral_pose(), (4000, 1))
    velocities = np.zeros_like(poses)
    velocities[:, 0] = 0.3
    moved = predict(hand, drift(hand, poses, velocities, 1 / 30, settings), 1 / 30, settings, rng)
    scale = noise_scale(hand, settings, 1 / 30)
    np.testing.assert_allclose(moved[:, :3].mean(axis=0), [0.01, 0.0, 0.0], atol=5e-4)
    np.testing.assert_allclose(moved[:, :6].std(axis=0), scale[:6], rtol=0.06)
    assert (moved <= hand.limits[:, 1]).all()
    assert (moved >= hand.limits[:, 0]).all()
    np.testing.assert_allclose(noise_scale(hand, settings, 4 / 30), 2 * scale)


@pytest.mark.parametrize(("dynamics", "kept"), [("first-order", 1.0), ("damped", 0.3), ("random-walk", 0.0)])
def test_the_dynamics_keep_their_share_of_the_velocity(dynamics: str, kept: float) -> None:
    hand, settings = load_hand("right"), DynamicsSettings(dynamics=dynamics, velocity=0.3)
    poses, velocities = hand.neutral_pose()[None], np.zeros((1, hand.dofs))
    velocities[0, :6] = 0.6
    moved = drift(hand, poses, velocities, 0.5, settings)
    np.testing.assert_allclose((moved - hand.constrain(poses))[0, :6], 0.3 * kept, atol=1e-12)
