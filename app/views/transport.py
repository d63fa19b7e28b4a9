"""The time line with its buttons and keys: it shows what every lane has tracked, and passes on what the visitor wants."""

from __future__ import annotations

import asyncio
import inspect
import math
from collections.abc import Callable
from itertools import groupby
from typing import Any

import numpy as np
import panel_material_ui as pmu

from app import moves
from app.controller import Controller
from app.lane import Lane
from app.results import Summary
from app.state import State
from app.views.follower import Follower
from app.views.plots import CALM
from app.views.time_line import TimeLine

__all__ = ["Transport", "ranges"]

_ROOM = 1.1  # of the chart above its highest value
_PICTURES_FIRST = 0.1  # s that the time line waits for pictures while playing, where none are being drawn
_USUAL = 97.0  # percentage of the values that the chart has to hold


class Transport(Follower):
    """The part under the heading: what is shown is at once at the frame, what was tracked follows while playing."""

    def __init__(self, state: State, controller: Controller) -> None:
        super().__init__(state, None, also=("session", "origin", "mode", "lanes", "lane"))
        self._controller = controller
        self.line = TimeLine(self._wish, sizing_mode="stretch_width", margin=(4, 10, 6, 10))
        self.panel = pmu.Column(self.line, sizing_mode="stretch_width", margin=0)
        self._late: asyncio.TimerHandle | None = None  # points at the latest
        state.param.watch(self._moved, ["frame", "revision"])
        state.param.watch(
            self._point,
            ["sending", "session", "task", "playing", "origin", "mode", "lanes", "lane", "span", "loop", "speed", "dark"],
        )  # fmt: skip
        self._point()
        self.draw()

    # ---- what the visitor wants

    async def _wish(self, wish: dict[str, Any]) -> None:
        state, controller, kind = self.state, self._controller, wish["kind"]
        # A click may be on its way when a move becomes impossible, and a key is always there.
        state.answer = moves.hindered(state, kind) if kind in moves.MOVES else ""
        if state.answer:
            return
        actions: dict[str, Callable[[], object]] = {
            "play": controller.pause if state.playing else controller.play,
            "step": controller.forward, "back": controller.back, "first": controller.first, "last": controller.last,
            "worst": controller.worst, "loss": controller.next_loss, "restart": controller.restart,
            "reach": lambda: controller.jump(state.frame),
            "look": lambda: controller.look(int(wish["frame"])),
            "loop": lambda: state.param.update(loop=not state.loop),
            "speed": lambda: state.param.update(speed=float(wish["value"])),
            "start": lambda: state.span_from(state.frame), "end": lambda: state.span_to(state.frame),
            "span": lambda: state.param.update(
                span=(int(wish["start"]), int(wish["end"])) if "start" in wish else ()
            ),
        }  # fmt: skip
        done = actions[kind]()
        if inspect.isawaitable(done):
            await done

    # ---- what the state says

    def _moved(self, *_events: Any) -> None:
        """Point at the frame at once; while playing together with its pictures, where there are any."""
        if not self.state.playing:
            self._point()
        elif self._late is None:
            self._late = asyncio.get_running_loop().call_later(_PICTURES_FIRST, self._point_late)

    def _point_late(self) -> None:
        self._late = None
        if not self.state.awaited:  # there are none in this tab; those that are drawn bring us along
            self._point()

    def _point(self, *_events: Any) -> None:
        """Say where we are and what can be done: at every frame."""
        state = self.state
        if self._late is not None:
            self._late.cancel()
            self._late = None
        self.line.param.update(
            count=0 if state.session is None else len(state.session), frame=state.pictured_frame, playing=state.playing,
            span=list(state.span), loop=state.loop, speed=state.speed, readout=self._readout(), dark=state.dark,
            can=[move for move in moves.MOVES if not moves.hindered(state, move)],
        )  # fmt: skip

    def _readout(self) -> str:
        state = self.state
        if state.session is None:
            return "No session is open."
        frame, last = state.pictured_frame, state.last
        summaries = [lane.summary(frame) for lane in state.active]
        tracked = "not tracked" if last is None else f"tracked to {last}"
        took = f" · {1000 * sum(s.seconds for s in summaries if s is not None):.0f} ms" if any(summaries) else ""
        lost = state.lane.loss(frame) if state.mode == "one" else ""
        what = f"<span class='lost'>{lost}</span>" if lost else f"{tracked}{took}"
        return f"<b>Frame {frame}</b> of {len(state.session) - 1} · {what}"

    def draw(self) -> None:
        """Show what was tracked: seldom while playing."""
        state = self.state
        lanes, value, unit = state.active, _golden, "golden energy"
        if state.session is not None and state.session.has_truth:
            value, unit = _error, "mm"
        known = [v for lane in lanes for s in lane.results.summaries if (v := value(s)) is not None]
        top = _rounded(_ROOM * float(np.percentile(known, _USUAL))) if known else 0.0
        self.line.param.update(lanes=[_row(lane, value, alone=len(lanes) == 1) for lane in lanes], top=top, unit=unit)


def _error(summary: Summary) -> float | None:
    return round(1000 * summary.error, 1) if math.isfinite(summary.error) else None


def _golden(summary: Summary) -> float | None:
    return round(summary.golden, 3) if math.isfinite(summary.golden) else None


def _row(lane: Lane, value: Callable[[Summary], float | None], *, alone: bool) -> dict[str, Any]:
    summaries = lane.results.summaries
    return {
        "colour": "#5b86ad" if alone else lane.colour or CALM,
        "first": summaries[0].frame if summaries else 0,
        "values": [value(summary) for summary in summaries],
        "tracked": ranges([summary.frame for summary in summaries]),
        "lost": ranges([summary.frame for summary in summaries if summary.lost]),
        "found": ranges([summary.frame for summary in summaries if summary.recovered]),
    }


def ranges(frames: list[int]) -> list[list[int]]:
    """Return the ranges [first, last] that frames, in their order, make."""
    runs = [[f for _, f in run] for _, run in groupby(enumerate(frames), lambda pair: pair[1] - pair[0])]
    return [[run[0], run[-1]] for run in runs]


def _rounded(top: float) -> float:
    """The least round number that is not less: 1, 2, 3, 5 or 8 of a decimal place."""
    if top <= 0:
        return 1.0
    unit = 10.0 ** math.floor(math.log10(top))
    return next((round(m * unit, 6) for m in (1, 2, 3, 5, 8) if m * unit >= top), round(10 * unit, 6))
