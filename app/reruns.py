"""Runs again: from a frame on, all of it, one frame; a run opened from disk; the particles of a frame computed once more."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from functools import partial

from app.controller import Controller
from app.lane import Lane, Origin
from app.results import Entry, entry_of
from app.shelf import Shelf, reopen
from app.state import State, warning_of
from spf.errors import StartError
from spf.manifest import read_manifest
from spf.progress import Report
from spf.runs import MANIFEST
from spf.sessions import Session
from spf.track import track_frame

__all__ = ["Reruns"]

_READYING = "Keeping what was tracked"
_SETTLED = 0.25  # s that a frame is shown before its particles are computed again


class Reruns:
    """What a visitor can do with runs, besides what the controller does frame by frame.

    Args:
        controller: of the page.
        shelf: of the server.
    """

    def __init__(self, controller: Controller, shelf: Shelf) -> None:
        self._state: State = controller.state
        self._controller, self._shelf = controller, shelf
        self._recalling: asyncio.Task[None] | None = None
        self._given_up: int | None = None  # frame whose particles the visitor did not want to wait for
        self._state.param.watch(self._recall_soon, ["revision", "task"])

    def cancel(self) -> None:
        """Give up what runs in the background, and compute no particles again before another frame is looked at."""
        self._given_up = self._state.frame
        if self._recalling is not None:
            self._recalling.cancel()
        self._controller.cancel()

    async def rerun(self, frame: int | None = None) -> None:
        """Track the chosen lane again with the present settings, from a frame (or its first) to the last one it had.

        What it had is kept as a run of its own.
        """
        state = self._state
        lane, goal = state.lane, state.lane.results.last
        if state.origin is None or goal is None:
            return
        self._controller.cancel()
        first = lane.begins(state.origin)
        begin = max(frame if frame is not None else first, first)
        if begin > goal:
            return
        async with self._controller.doing(_READYING) as wanted:
            if await self._ready(lane, begin) and wanted():
                self._begin_again(lane, begin)
                state.show(begin)
                await self._controller.reach(range(begin, goal + 1), [lane])

    async def again(self, *, other_seed: bool = False) -> None:
        """Track the frame shown once more in the chosen lane, with the present settings and the same or the next seed.

        What comes after it no longer follows from it: the run so far is kept as one of its own.
        """
        state, frame = self._state, self._state.frame
        if state.origin is None or state.lane.summary(frame) is None:
            return
        self._controller.cancel()
        lane = state.lane
        async with self._controller.doing(_READYING) as wanted:
            if await self._ready(lane, frame) and wanted():
                self._begin_again(lane, frame)
                await self._controller.once_more(frame, lane, other_seed=other_seed)

    def _begin_again(self, lane: Lane, frame: int) -> None:
        """Have another run that shares with this one what comes before a frame."""
        lane.results = lane.results.copy()
        lane.results.cut(frame)
        lane.fork()

    async def _ready(self, lane: Lane, frame: int) -> bool:
        """Keep what there is, and have the state before a frame in memory; False when that failed or was cancelled."""
        if not await self._controller.keeper.keep():
            return False
        state = self._state
        assert state.origin is not None
        if frame == lane.begins(state.origin):
            return True
        if lane.results.state(frame - 1) is None:
            await self._recall([lane], frame - 1)
        return lane.results.state(frame - 1) is not None

    # ---- runs from disk

    async def open(self, run: str, frame: int | None = None, *, beside: bool = False) -> None:
        """Open a run from disk, with its session; or beside what is shown, which then has to be of the same session.

        Args:
            run: name on the shelf.
            frame: to show; the first one when not given.
            beside: compare it with what is shown.
        """
        state, controller = self._state, self._controller
        controller.cancel()
        async with controller.doing("Opening the run"):
            if not await controller.keeper.keep():
                return
            session, work = await self._session_of(run)
            if session is not state.session:
                if beside and state.session is not None and state.session.fingerprint() != session.fingerprint():
                    raise StartError("That run is of another recording: compare runs of one session.")
                if not beside:
                    state.load(session, work[1])
            assert state.session is not None
            held, shelf = state.session, self._shelf
            read, results, origin = await controller.run(lambda report: reopen(shelf, run, held, report))
            if beside:
                free = next((lane for lane in state.lanes if lane.results.last is None), None)
                if free is None or len(state.lanes) < 2:
                    state.add_lane()
                    free = state.lane
                lane = free
            else:
                lane = state.lane
            label = str(read.manifest.get("name") or "")
            lane.take(run, read.plan, results, origin, label)
            first = origin if state.origin is None or not beside else state.origin
            state.param.update(origin=first, lane=lane, warning=warning_of(read.plan.start), rules=state.rules + 1)
            if beside:
                state.mode = "compare"
            state.show(min(frame if frame is not None else origin.start.frame, len(held) - 1))

    async def _session_of(self, run: str) -> tuple[Session, tuple[str, str]]:
        """Return the session of a run: the one shown if it is that, else opened again."""
        stored = read_manifest(self._shelf.path(run) / MANIFEST)["session"]
        uri, camera = str(stored["uri"]), str(stored["camera_file"] or "")
        held = self._state.session
        if held is not None and str(held.uri) == uri:
            return held, (uri, camera)
        opened: Session = await self._controller.run(partial(self._controller.opener, uri, camera or None))
        return opened, (uri, camera)

    # ---- particles that are no longer in memory

    def _missing(self) -> list[Lane]:
        state = self._state
        return [
            lane for lane in state.active if lane.summary(state.frame) is not None and lane.entry(state.frame) is None
        ]

    def _recall_soon(self, *_events: object) -> None:
        state = self._state
        if state.frame != self._given_up:
            self._given_up = None
        if state.busy or state.session is None or state.origin is None or not self._missing():
            return
        if self._given_up is not None:
            return
        if self._recalling is not None:
            self._recalling.cancel()
        self._recalling = asyncio.get_running_loop().create_task(self._recall_when_settled(state.frame))

    async def _recall_when_settled(self, frame: int) -> None:
        await asyncio.sleep(_SETTLED)
        if frame == self._state.frame and not self._state.busy:
            self._recalling = None  # from here on it is not to be given up by looking elsewhere
            await self._recall(self._missing(), frame)

    async def _recall(self, lanes: list[Lane], frame: int) -> None:
        """Compute everything of a frame again, as it was tracked."""
        state, controller = self._state, self._controller
        session, origin = state.session, state.origin
        assert session is not None
        assert origin is not None
        async with controller.doing(f"Computing the particles of frame {frame} again"):
            for lane in lanes:
                results = lane.results
                entry = await controller.run(_work(session, lane, frame, origin))
                results.recall(entry)
            state.revision += 1


def _work(session: Session, lane: Lane, frame: int, origin: Origin) -> Callable[[Report], Entry]:
    """Return the work that tracks a lane again from the nearest state, as it was tracked, to a frame."""
    first, tracking, before = lane.way_to(frame, origin)
    ways = {index: lane.results.summary(index) for index in range(first, frame + 1)}

    def work(report: Report) -> Entry:
        how, state = tracking, before
        for index in range(first, frame + 1):
            report("", 0.0)
            summary = ways[index]
            how = how if summary is None else summary.tracking
            after, result = track_frame(how, state, session[index], record=index == frame)
            if index == frame:
                return entry_of(result, after, how, state)
            state = after
        raise AssertionError("a frame is never before its first")

    return work
