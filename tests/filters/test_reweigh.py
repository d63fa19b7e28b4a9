"""Samples of a frame weighed with other settings."""

from pathlib import Path

import numpy as np
import pytest

from spf.errors import SettingError
from spf.filters.reweigh import landscape, reweigh
from spf.locate import reach_of
from spf.observation import observe
from spf.prepare import prepare
from spf.sessions import open_session
from spf.track import begin, track_frame
from spf.trackers import TRACKERS, make_settings

SAMPLE = Path(__file__).parents[2] / "sessions" / "open-close.mcap"
SMALL = {"condensation": {"n": "20"}, "apf": {"n": "20", "layers": "3"}, "nbp": {"n": "20"}}


def second_frame(tracker, changes=None):
    """(arguments of reweigh but the new settings, settings) of the second frame of a sample."""
    session = open_session(SAMPLE)
    start = prepare(session, init="truth")
    settings = make_settings(tracker, "default", {**SMALL.get(tracker, {}), **(changes or {})})
    tracking, state = begin(tracker, settings, start, 3)
    before, _ = track_frame(tracking, state, session[0])
    _, result = track_frame(tracking, before, session[1])
    observation = observe(session[1], before.filter.estimate[:3], reach_of(tracking.hand))
    interval = session[1].time - session[0].time

    def again(other):
        rng = np.random.default_rng([3, 1])
        return reweigh(rng, tracking.hand, observation, result.info, settings, other, interval, tracking.spheres)

    return again, settings, result.info, (tracking.hand, observation)


@pytest.mark.parametrize("tracker", TRACKERS)
def test_with_its_own_settings_a_frame_has_its_own_weights(tracker):
    again, settings, info, _ = second_frame(tracker)
    other = again(settings)
    costs = () if info.layers else ("cost_before", "cost_after", "log_likelihood")
    for name in (*costs, "log_correction", "log_weights", "estimate", "ess"):
        np.testing.assert_allclose(getattr(other, name), getattr(info, name), rtol=1e-9, atol=1e-9, err_msg=name)


def test_a_wide_window_corrects_nothing_and_a_narrow_one_takes_the_optimised_samples_out():
    again, settings, info, _ = second_frame("spf")
    wide, narrow = again(settings.replace(h=100.0)), again(settings.replace(h=0.5))
    assert np.abs(wide.log_correction).max() < 0.05
    count = len(info.predicted)
    assert narrow.log_correction[count:].max() < info.log_correction[count:].max() < -0.01
    assert narrow.optimised_share < wide.optimised_share
    np.testing.assert_array_equal(narrow.cost_after, info.cost_after)  # h is no part of the cost


def test_the_weight_of_normals_changes_the_costs_and_n_changes_nothing():
    again, settings, info, _ = second_frame("spf")
    heavier = again(settings.replace(k=10.0))
    assert (heavier.cost_after > info.cost_after).all()
    np.testing.assert_allclose(again(settings.replace(n=9)).log_weights, info.log_weights, atol=1e-9)


def test_drawn_samples_are_refused_in_one_sentence():
    again, settings, _, _ = second_frame("spf")
    with pytest.raises(SettingError, match="tracked again"):
        again(settings.replace(weighting="laplace"))


def test_the_landscape_is_the_cost_at_every_place():
    _, settings, info, (hand, observation) = second_frame("spf")
    across = info.estimate[0] + np.linspace(-0.02, 0.02, 9), info.estimate[1] + np.linspace(-0.02, 0.02, 5)
    heights = landscape(np.random.default_rng([3, 1]), hand, observation, info, settings, (0, 1), across)
    assert heights.shape == (5, 9)
    assert heights[2, 4] == pytest.approx(info.estimate_cost, rel=1e-9)
    assert heights[2, 4] < min(heights[0, 0], heights[-1, -1])
