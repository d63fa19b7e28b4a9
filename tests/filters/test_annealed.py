"""The annealed particle filter: β, the survival rate of its layers, its noise and its lines of descent."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from spf.filters import annealed
from spf.filters.annealed import ApfSettings, annealing_exponent
from spf.filters.particles import ess, normalise
from spf.filters.step import State, StepInfo, start_at
from spf.locate import reach_of
from spf.observation import observe
from spf.synthetic import SyntheticSettings, synthesise


@given(
    st.lists(st.integers(-(10**6), 0), min_size=20, max_size=60, unique=True).map(np.array),
    st.floats(0.1, 0.9),
    st.floats(1e-4, 1e4),
)
def test_the_exponent_meets_the_survival_rate_whatever_the_scale(logs: np.ndarray, target: float, scale: float) -> None:
    beta = annealing_exponent(scale * logs, target)
    assert ess(normalise(beta * scale * logs)) / len(logs) == pytest.approx(target, rel=0.01)


def test_particles_that_are_all_equal_all_survive() -> None:
    beta = annealing_exponent(np.zeros(10), 0.5)
    assert np.isfinite(beta)
    assert ess(normalise(beta * np.zeros(10))) == pytest.approx(10.0)


@pytest.fixture(scope="module")
def stepped() -> tuple[State, StepInfo, ApfSettings]:
    session = synthesise(SyntheticSettings(motion="open_close", sensor="kinect2", frames=8, seed=3))
    frame = session[1]
    assert session[0].truth is not None
    settings = ApfSettings(n=100, layers=10, survival=0.5)
    state = start_at(session.hand, session[0].truth.pose, session[0].truth.orientation, session[0].time, settings.n)
    observation = observe(frame, state.estimate[:3], reach_of(session.hand))
    new, info = annealed.step(np.random.default_rng(0), state, observation, session.hand, settings, record=True)
    return new, info, settings


def test_every_layer_has_the_survival_rate_that_it_is_chosen_for(stepped: tuple[State, StepInfo, ApfSettings]) -> None:
    _, info, settings = stepped
    assert len(info.layers) == settings.layers
    for layer in info.layers:
        assert layer.survival == pytest.approx(settings.survival, rel=0.05)
    assert info.ess / settings.n == pytest.approx(settings.survival, rel=0.05)


def test_layers_get_sharper_and_their_noise_smaller(stepped: tuple[State, StepInfo, ApfSettings]) -> None:
    _, info, settings = stepped
    spreads = np.array([layer.spread for layer in info.layers])
    np.testing.assert_allclose(spreads, settings.survival ** (0.5 * np.arange(settings.layers)))
    assert info.layers[-1].exponent > info.layers[0].exponent


def test_annealing_lowers_the_cost(stepped: tuple[State, StepInfo, ApfSettings]) -> None:
    _, info, _ = stepped
    assert info.cost_after.mean() < info.cost_before.mean()  # of what the survivors descend from


def test_a_line_of_descent_leads_through_every_layer(stepped: tuple[State, StepInfo, ApfSettings]) -> None:
    _, info, settings = stepped
    for n in (0, 50, 99):
        line = info.trajectories[n]
        assert len(line.poses) == settings.layers
        assert line.costs[0] == info.cost_before[n]
        assert line.costs[-1] == info.cost_after[n]
    assert info.evaluations == settings.n * settings.layers + 1
