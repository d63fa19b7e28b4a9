"""The state of a page: settings, presets, what a step leads to, the view."""

import numpy as np
import pytest

from app.lane import Origin
from app.state import State
from app.views.settings_card import SettingsCard
from spf.hand import HandShape
from spf.initialise import Start
from spf.trackers import PRESETS, make_settings


@pytest.fixture
def state():
    return State()


def test_a_change_is_told_apart_from_the_preset_and_undone(state):
    state.change("k", 3.0)
    state.change("n", 8)
    assert state.lane.differences == {"k": (make_settings("spf").k, 3.0), "n": (4, 8)}
    assert state.lane.title == "Smart Particle Filter · k 3 · N 8"
    state.lane.back_to_preset()
    assert state.lane.settings == make_settings("spf")
    assert state.lane.differences == {}


def test_the_list_of_what_differs_uses_the_paper_s_symbols(state):
    card = SettingsCard(state)
    for name, value in {"mu": 0.05, "n": 8, "data_points": 300}.items():
        state.change(name, value)
    told = card._hint.object
    assert all(change in told for change in ("μ 0.02 → 0.05", "N 4 → 8", "data points ")), told


@pytest.mark.parametrize("preset", PRESETS)
def test_a_preset_brings_its_values(state, preset):
    state.change("h", 9.0)
    state.lane.preset = "paper" if preset == "default" else "default"
    state.lane.preset = preset
    assert state.lane.settings == make_settings("spf", preset)


def test_a_tracker_brings_its_own_settings(state):
    state.lane.tracker = "smd"
    assert state.lane.settings == make_settings("smd")


@pytest.mark.parametrize(("name", "value"), [("n", 0), ("k", float("nan")), ("mu", -1.0), ("nonsense", 1)])
def test_an_impossible_value_is_refused_in_one_sentence(state, name, value):
    before = state.lane.settings
    state.change(name, value)
    assert state.lane.settings == before
    assert name in state.error
    assert "\n" not in state.error


def test_a_refused_value_is_put_back_in_the_widgets(state):
    seen = []
    state.param.watch(lambda _event: seen.append(state.lane.settings), "rules")
    before = state.lane.settings
    state.change("n", 0)
    assert seen == [before]


def test_there_is_nowhere_to_step_without_a_start(state):
    assert state.next_frame is None
    assert not state.busy


def test_a_start_without_the_network_says_so(state, monkeypatch):
    shape = HandShape("right")
    start = Start(0, shape.hand().neutral_pose(), np.eye(3), shape, 0.2, 0.2)
    state.begin(Origin(start, 0.0, 0))
    assert state.warning == ""
    monkeypatch.setattr("app.state.available_network", lambda: (None, "The network is missing."))
    state.begin(Origin(start, 0.0, 0))
    assert state.warning == "The network is missing."


def test_the_view_adds_up_and_resets(state):
    state.orbit(0.2, -0.1, 2.0)
    state.orbit(0.2, 0.0, 1.0)
    assert (state.azimuth, state.elevation, state.zoom) == pytest.approx((0.4, -0.1, 2.0))
    state.orbit(0.0, 0.0, 1e6)
    assert state.zoom < 100
    state.reset_view()
    assert (state.azimuth, state.elevation, state.zoom) == (0.0, 0.0, 1.0)
