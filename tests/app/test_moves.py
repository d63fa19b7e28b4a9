"""Where a jump leads and what play shows, on results that are made up: no tracker runs."""

import numpy as np
import pytest

from app import moves
from app.clock import Clock
from app.lane import Origin
from app.results import Summary
from app.state import State
from app.views.transport import ranges
from spf.hand import HandShape
from spf.hand.shape import UNCHANGED
from spf.initialise import Start
from spf.sessions import open_session

ERRORS = [2.0, 3.0, 9.0, 4.0, 5.0, 2.0, 7.0, 1.0]
LOST = (2, 3, 6)


@pytest.fixture
def state(sample):
    """A page at frame 0 of a session, eight frames of which were tracked, three of them without a hand."""
    state = State()
    state.load(open_session(sample))
    shape = HandShape("right")
    state.begin(Origin(Start(0, shape.hand().neutral_pose(), np.eye(3), shape, 0.2, 0.2), 0.0, 0))
    for i, error in enumerate(ERRORS):
        lost = i in LOST
        nan = float("nan")
        state.lane.results._summaries[i] = Summary(
            i, np.zeros((21, 3)), lost, i in (4, 7), nan, nan, False, "", nan if lost else error / 10, nan,
            error / 1000, 0.1, UNCHANGED, None,
        )  # fmt: skip
    return state


def test_the_worst_frame_is_the_farthest_from_the_truth(state):
    assert moves.worst(state) == 2


def test_without_truth_the_worst_frame_explains_the_depth_worst(state):
    summaries = state.lane.results._summaries
    for i, summary in summaries.items():
        summaries[i] = summary._replace(error=float("nan"))
    assert moves.worst(state) == 4  # in 2 and 6 there is no hand to render


@pytest.mark.parametrize(("at", "found"), [(0, 2), (2, 6), (3, 6), (6, 2), (7, 2)])
def test_the_next_loss_is_where_one_begins_and_comes_round_again(state, at, found):
    state.show(at)
    assert moves.next_loss(state) == found


def test_there_may_be_no_loss(state):
    state.lane.clear()
    assert moves.next_loss(state) is None
    assert moves.worst(state) is None


@pytest.mark.parametrize(
    ("at", "stride", "span", "loop", "shown"),
    [
        (0, 1, (), False, 1),
        (0, 3, (), False, 3),
        (6, 5, (), False, 7),
        (7, 1, (), False, None),  # the next one has to be tracked
        (7, 1, (), True, 0),
        (2, 1, (1, 3), False, 3),
        (3, 1, (1, 3), False, None),
        (3, 1, (1, 3), True, 1),
        (6, 1, (1, 3), False, 1),  # from outside, play begins with the range
        (7, 1, (5, 100), False, None),  # the range goes beyond what was tracked
        (7, 1, (5, 100), True, 5),
    ],
)
def test_play_shows_what_was_tracked_within_its_range(state, at, stride, span, loop, shown):
    state.show(at)
    state.param.update(span=span, loop=loop)
    assert moves.played(state, stride) == shown


def test_home_and_end_lead_to_the_ends_of_the_range_or_of_what_was_tracked(state):
    assert (moves.first(state), moves.last(state)) == (0, 7)
    state.span = (2, 5)
    assert (moves.first(state), moves.last(state)) == (2, 5)


def test_a_range_stays_in_order_whichever_end_is_set(state):
    state.span_from(5)
    assert state.span == (5, 119)
    state.span_to(7)
    assert state.span == (5, 7)
    state.span_from(9)
    assert state.span == (9, 119)
    state.span_to(3)
    assert state.span == (0, 3)


def test_frames_in_a_row_are_ranges():
    assert ranges([0, 1, 2, 5, 7, 8]) == [[0, 2], [5, 5], [7, 8]]
    assert ranges([]) == []


def test_the_pace_skips_no_frame_without_a_rate():
    assert moves.Pace().due(0.0) == (1, 0.0)


def test_the_pace_counts_what_is_due(monkeypatch):
    now = [0.0]
    monkeypatch.setattr(moves.time, "monotonic", lambda: now[0])
    pace = moves.Pace()
    assert pace.due(10.0) == (1, pytest.approx(0.1))
    now[0] = 0.35  # drawing took a quarter of a second more than the wait
    count, wait = pace.due(10.0)
    assert (count, wait) == (2, 0.0)
    now[0] = 0.4
    assert pace.due(10.0) == (1, 0.0)  # half a frame was still owed


def test_the_time_left_is_told_once_it_is_known(monkeypatch):
    now = [0.0]
    monkeypatch.setattr("app.clock.time.monotonic", lambda: now[0])
    clock = Clock(100)
    now[0] = 1.0
    assert clock.left(2) == ""
    now[0] = 5.0
    assert clock.left(10) == "about 45 s left"
    now[0] = 50.0
    assert clock.left(10) == "about 8 min left"
