"""What is asked for while something else goes on is done, or answered in a sentence; nothing is dropped silently."""

import asyncio

import pytest

from app import moves
from app.keeper import Keeper
from app.reruns import Reruns
from app.shelf import Shelf
from app.state import State
from app.views.transport import Transport
from spf.sessions import open_session
from tests.app.test_controller import started


@pytest.fixture
def ready(page, sample, act):
    """A page with five frames tracked."""
    state, controller = page
    started(state, controller, sample, act)
    act(lambda: controller.jump(4))
    return state, controller


def during(ready, *wishes):
    """What the page answers to wishes that come as soon as frames are tracked again, from frame 4 to 7."""
    state, controller = ready

    async def both():
        transport = Transport(state, controller)
        work = asyncio.create_task(controller.reach(range(5, 8)))
        await asyncio.sleep(0)
        answers = []
        for wish in wishes:
            await transport._wish(wish)
            answers.append(state.answer)
        await work
        return answers

    return asyncio.run(both())


@pytest.mark.parametrize("kind", ["play", "step", "restart", "reach"])
def test_a_click_that_comes_just_when_work_begins_is_answered(ready, kind):
    state, _ = ready
    assert during(ready, {"kind": kind}) == ["“Tracking to frame 7” goes on: wait for its end, or cancel it."]
    assert (state.last, state.answer) == (7, "")  # the work went on, and its end takes the answer away


def test_what_was_tracked_is_looked_through_while_work_goes_on(ready):
    state, _ = ready
    answers = during(ready, {"kind": "first"}, {"kind": "step"}, {"kind": "back"})
    assert answers == ["", "", ""]
    assert (state.frame, state.last) == (0, 7)


def test_a_click_while_a_run_begins_again_is_answered_and_changes_nothing(ready, tmp_path, act):
    state, controller = ready
    controller.keeper = Keeper(state, Shelf(tmp_path))
    reruns = Reruns(controller, Shelf(tmp_path))

    async def both():
        work = asyncio.create_task(reruns.rerun(2))
        await asyncio.sleep(0)  # the run is being kept by now
        await controller.step()
        answer, last = state.answer, state.last
        await work
        return answer, last

    assert asyncio.run(both()) == ("“Keeping what was tracked” goes on: wait for its end, or cancel it.", 4)
    assert (state.last, state.task, state.answer) == (4, "", "")


def test_the_end_of_a_step_leaves_the_task_that_began_meanwhile(ready):
    state, controller = ready

    async def both():
        step = asyncio.create_task(controller.step())
        await asyncio.sleep(0)
        async with controller.doing("Making the report"):
            await step
            return state.task

    assert asyncio.run(both()) == "Making the report"
    assert (state.last, state.task) == (5, "")


@pytest.mark.parametrize("move", moves.MOVES)
def test_without_a_session_every_move_says_what_to_do(move):
    assert moves.hindered(State(), move) == "Open a session first."


@pytest.mark.parametrize(
    ("move", "why"),
    [
        ("step", "Press Start first."),
        ("play", "Press Start first."),
        ("back", "This is the first frame."),
        ("worst", "Nothing is tracked yet: press Start."),
        ("loss", "Nothing is tracked yet: press Start."),
        ("first", ""),
        ("loop", ""),
    ],
)
def test_before_start_a_move_says_what_is_missing(sample, move, why):
    state = State()
    state.load(open_session(sample))
    assert moves.hindered(state, move) == why


def test_a_move_that_leads_nowhere_says_so(ready):
    state, _ = ready
    assert moves.hindered(state, "loss") == "The hand was lost in none of the frames tracked."
    assert moves.hindered(state, "reach") == "This frame is tracked already."
    state.playing = True
    assert moves.hindered(state, "step") == "Frames are being played: pause first."
    assert moves.hindered(state, "play") == ""  # it pauses
