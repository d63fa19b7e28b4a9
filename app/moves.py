"""Where a jump leads, and which frame play shows next: decided from the state alone."""

from __future__ import annotations

import math
import time

import numpy as np

from app.results import Summary
from app.state import State

__all__ = ["MOVES", "Pace", "first", "hindered", "last", "next_loss", "played", "worst"]

#: What a visitor can ask the time line for, besides a frame, a range or a speed.
MOVES = ("play", "step", "back", "first", "last", "worst", "loss", "start", "end", "loop", "restart", "reach")


def first(state: State) -> int:
    """The first frame of the range, else the first one that was tracked, else that of the session."""
    if state.span:
        return state.span[0]
    return 0 if state.origin is None or state.last is None else state.origin.start.frame


def last(state: State) -> int:
    """The last frame that was tracked, within the range; the one that is shown before anything was tracked."""
    if state.last is None:
        return state.frame
    return min(state.last, state.span[1]) if state.span and state.span[1] >= first(state) else state.last


def worst(state: State) -> int | None:
    """The frame in which a lane shown is farthest from the truth, or explains the depth worst where there is no truth."""
    summaries = [summary for lane in state.active for summary in lane.results.summaries]
    has_truth = any(math.isfinite(summary.error) for summary in summaries)

    def badness(summary: Summary) -> float:
        return float(np.nan_to_num(summary.error if has_truth else summary.golden, nan=-1.0))

    found = max(summaries, key=badness, default=None)
    return None if found is None else found.frame


def next_loss(state: State) -> int | None:
    """The next frame, after the one shown and then from the beginning, in which a lane shown loses the hand."""
    starts = sorted(
        {
            summary.frame
            for lane in state.active
            for summary in lane.results.summaries
            if summary.lost and lane.results.lost_since(summary.frame) == summary.frame
        }
    )
    return next((frame for frame in starts if frame > state.frame), starts[0] if starts else None)


def played(state: State, stride: int) -> int | None:
    """The frame that play shows next among those that were tracked; None when it has to track one, or is at its end.

    Args:
        state: of the page.
        stride: frames to go on by.
    """
    if state.last is None:
        return None
    begin, end = first(state), last(state)
    if state.span and not begin <= state.frame <= state.span[1]:
        return begin if begin <= state.last else None
    if state.frame < end:
        return min(state.frame + stride, end)
    return begin if state.loop else None


def hindered(state: State, move: str) -> str:
    """Return why a move cannot be made now, in one sentence; nothing when it can.

    Args:
        state: of the page.
        move: one of MOVES.
    """
    if state.session is None:
        return "Open a session first."
    if move == "back":
        return "" if state.frame > 0 else "This is the first frame."
    if move in ("last", "worst", "loss") and state.last is None:
        return "Nothing is tracked yet: press Start."
    if move == "loss" and not any(summary.lost for lane in state.active for summary in lane.results.summaries):
        return "The hand was lost in none of the frames tracked."
    return _hindered_work(state, move) if move in ("play", "step", "restart", "reach") else ""


def _hindered_work(state: State, move: str) -> str:
    """Return why a move that may have to track cannot be made now."""
    if state.playing and move == "play":
        return ""  # it pauses
    if state.playing or (state.task and not (move == "step" and state.is_behind)):
        return state.occupied
    if state.origin is None:
        return "Press Start first."
    if move == "step" and state.next_frame is None:
        return "This is the last frame."
    if move == "reach" and (state.last is None or state.frame <= state.last):
        return "This frame is tracked already."
    return ""


class Pace:
    """How many frames are due when play goes on, at the speed of the recording times a factor."""

    def __init__(self) -> None:
        self._then = time.monotonic()
        self._owed = 0.0

    def due(self, rate: float) -> tuple[int, float]:
        """Return the frames to go on by now, and the seconds to wait before.

        Args:
            rate: frames a second; 0 for one after the other, as fast as they are drawn.
        """
        now = time.monotonic()
        self._owed, self._then = self._owed + (now - self._then) * rate, now
        if rate == 0.0:
            return 1, 0.0
        if self._owed >= 1.0:
            count = int(self._owed)
            self._owed -= count
            return count, 0.0
        wait = (1.0 - self._owed) / rate
        self._owed, self._then = 0.0, now + wait
        return 1, wait
