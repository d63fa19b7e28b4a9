"""Several trackers on one session: always at the same frame, from one start, each with its own settings."""

import asyncio

import numpy as np
import pytest

import app.work
from app.lane import Lane
from app.state import COLOURS
from app.views.costs import Costs
from app.views.curves import ERROR, ESS, Curves
from app.views.lanes_card import LanesCard
from app.views.scenes import SCENES, reconstruction_of
from app.views.settings_card import SettingsCard
from app.views.table import measures
from app.views.weights import Weights
from spf.errors import StartError
from spf.trackers import TRACKERS


@pytest.fixture
def compared(page, sample, act):
    """A page that compares a quick SPF with a quick single tracker, at the first frame."""
    state, controller = page
    act(lambda: controller.open(sample), lambda: controller.show_mode("compare"))
    for lane in state.lanes:
        lane.change("rounds", 1)  # quick: what is tracked does not matter here
    act(controller.start)
    assert state.error == ""
    return state, controller


def tracked(state):
    """The frames that each lane has."""
    return [[summary.frame for summary in lane.results.summaries] for lane in state.lanes]


def test_comparing_begins_with_two_different_trackers(page, act):
    state, controller = page
    act(lambda: controller.show_mode("compare"))
    assert len({lane.tracker for lane in state.lanes}) == len(state.lanes) == 2
    assert len({lane.colour for lane in state.lanes}) == 2


def test_all_lanes_begin_at_one_start_and_are_at_one_frame(compared, act):
    state, controller = compared
    act(controller.step, controller.step)
    assert state.frame == 2
    assert tracked(state) == [[0, 1, 2], [0, 1, 2]]
    first, second = (lane.entry(2).tracking for lane in state.lanes)
    assert first.start is second.start
    assert first.seed == second.seed
    assert first.tracker != second.tracker


def test_lanes_with_the_same_settings_track_the_same(compared, act):
    state, controller = compared
    state.lanes[1].tracker = state.lanes[0].tracker
    state.lanes[1].settings = state.lanes[0].settings
    act(controller.restart, controller.step)
    first, second = (lane.entry(1).result.pose for lane in state.lanes)
    assert np.array_equal(first, second)


def test_a_frame_that_one_lane_cannot_track_is_in_none(compared, act, monkeypatch):
    state, controller = compared
    real = app.work.track_frame

    def broken(tracking, before, frame, *, record):
        if tracking.tracker == state.lanes[1].tracker:
            raise StartError("This one cannot.")
        return real(tracking, before, frame, record=record)

    monkeypatch.setattr(app.work, "track_frame", broken)
    act(controller.step)
    assert (state.error, state.frame, state.busy) == ("This one cannot.", 0, False)
    assert tracked(state) == [[0], [0]]


def test_a_lane_that_is_added_catches_up_with_the_frame_shown(compared, act):
    state, controller = compared
    act(lambda: controller.jump(3), controller.add_lane)
    assert state.frame == 3
    assert tracked(state) == [[0, 1, 2, 3]] * 3
    assert state.lane is state.lanes[2]


def test_catching_up_can_be_cancelled_and_a_step_goes_on_from_what_all_have(compared, act):
    state, controller = compared
    act(lambda: controller.jump(3))

    def cancel_at_half(event):
        if event.new >= 0.5:
            controller.cancel()

    watcher = state.param.watch(cancel_at_half, "share")
    act(controller.add_lane)
    state.param.unwatch(watcher)
    assert not state.busy
    assert state.last == 1
    assert tracked(state)[:2] == [[0, 1, 2, 3]] * 2
    act(controller.step)
    assert state.frame == state.last == 2


def test_jump_and_restart_act_on_all_lanes(compared, act):
    state, controller = compared
    act(lambda: controller.jump(3), lambda: controller.jump(1))
    assert state.frame == 1
    assert tracked(state) == [[0, 1, 2, 3]] * 2
    act(controller.restart)
    assert state.frame == 0
    assert tracked(state) == [[0]] * 2


def test_a_change_of_one_lane_leaves_what_another_has_tracked(compared, act):
    state, controller = compared
    act(controller.step)
    kept, other = state.lanes
    stored = kept.entry(1)
    state.choose(other)
    state.change("k", 2.0)
    act(controller.step)
    assert kept.entry(1) is stored
    assert tracked(state) == [[0, 1, 2]] * 2
    assert other.is_mixed
    assert not kept.is_mixed


def test_one_tracker_that_went_on_alone_is_caught_up_with(compared, act):
    state, controller = compared
    first = state.lanes[0]
    act(lambda: controller.choose(first), lambda: controller.show_mode("one"), lambda: controller.jump(2))
    assert tracked(state) == [[0, 1, 2], [0]]
    act(lambda: controller.show_mode("compare"))
    assert tracked(state) == [[0, 1, 2], [0, 1, 2]]
    assert state.frame == 2


def test_there_are_two_to_four_lanes(compared, act):
    state, controller = compared
    act(controller.add_lane, controller.add_lane, controller.add_lane)
    assert [lane.colour for lane in state.lanes] == list(COLOURS)
    act(lambda: controller.remove_lane(state.lanes[1]))
    assert [lane.colour for lane in state.lanes] == [COLOURS[i] for i in (0, 2, 3)]
    act(*[lambda: controller.remove_lane(state.lanes[0])] * 3)
    assert len(state.lanes) == 2
    assert state.lane in state.lanes


def test_playing_keeps_the_lanes_together(compared, act):
    state, controller = compared
    shown = []

    async def drawn():
        shown.append([lane.results.last for lane in state.lanes])
        if len(shown) == 3:
            controller.pause()

    controller.drawn = drawn
    act(controller.play)
    assert shown == [[1, 1], [2, 2], [3, 3]]


def test_the_table_measures_the_frames_that_all_have(compared, act):
    state, controller = compared
    act(lambda: controller.jump(2))
    lane = state.lanes[0]
    errors = [1000 * summary.error for summary in lane.results.summaries]
    assert measures(lane, 1)[0] == pytest.approx(np.mean(errors[:2]))
    assert measures(lane, 2)[0] == pytest.approx(np.mean(errors))
    assert measures(lane, 2)[2:4] == (0, 0)
    assert np.isnan(measures(lane, None)[0])


def test_each_lane_has_its_line_whichever_was_removed(compared, act):
    state, controller = compared
    curves = Curves(state, ERROR, "compare")
    act(controller.add_lane, lambda: controller.remove_lane(state.lanes[1]), controller.step)
    curves.draw()
    assert [len(source.data["frame"]) for source in curves.lines.values()] == [2, 0, 2, 0]
    assert list(curves.lines) == list(COLOURS)


@pytest.mark.parametrize("tracker", TRACKERS)
def test_every_tracker_can_be_shown(page, sample, act, tracker):
    state, controller = page
    state.lane.tracker = tracker
    settings, parts = SettingsCard(state), [Costs(state), Weights(state), Curves(state, ESS)]
    act(lambda: controller.open(sample), controller.start, controller.step)
    assert state.error == ""
    for part in parts:
        part.draw()
    assert len(parts[0].source.data["before"]) == len(state.entry.result.info.predicted)
    assert SCENES["particles"](state.entry) is not None
    assert reconstruction_of(state.entry) is not None
    assert (SCENES["trajectories"](state.entry) is not None) == bool(state.entry.result.info.trajectories)
    assert settings.panel is not None


def test_the_settings_card_follows_the_chosen_lane(page):
    state, controller = page
    LanesCard(state, controller)
    card = SettingsCard(state)
    state.change("n", 9)
    state.show_mode("compare")
    state.lane.tracker = "smd"
    assert set(card._fields) == {"k", "mu"}
    state.choose(state.lanes[0])
    assert card._fields["n"].value == 9
    card._fields["n"].value = 5
    assert state.lanes[0].settings.n == 5


def test_a_lane_is_told_by_its_tracker_preset_and_changes():
    lane = Lane("spf")
    lane.preset = "paper"
    lane.change("n", 8)
    assert lane.title == "Smart Particle Filter · paper · N 8"


def test_faster_clicks_than_frames_leave_the_lanes_together(compared):
    state, controller = compared

    async def at_once():
        await asyncio.gather(controller.step(), controller.add_lane(), controller.step())

    asyncio.run(at_once())
    assert state.last == state.frame
    assert len({lane.results.last for lane in state.lanes}) == 1
