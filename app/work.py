"""The work of one page: one thing at a time, said while it lasts, cancelled; and a frame tracked in some lanes."""

from __future__ import annotations

import asyncio
import logging
from collections.abc import AsyncIterator, Awaitable, Callable, Sequence
from contextlib import asynccontextmanager
from pathlib import Path
from typing import TypeVar

from app.clock import Clock
from app.keeper import Keeper
from app.lane import Lane
from app.results import Entry, entry_of
from app.runner import CancelledError, Runner
from app.state import State
from spf.errors import SpfError
from spf.frame import Frame
from spf.progress import Report
from spf.sessions import Session, open_session
from spf.track import Tracking, TrackState, track_frame

__all__ = ["Open", "Wanted", "Work"]

T = TypeVar("T")
Open = Callable[[str, str | None, Report], Session]
Wanted = Callable[[], bool]
Wait = Callable[[Report], None]
_log = logging.getLogger(__name__)


async def _at_once() -> None:
    """Wait for no picture: without a browser nobody draws one."""


def _ready(_report: Report) -> None:
    """Wait for no kernel: they are compiled when they are used."""


class Work:
    """Does work on one page's state, which can be shown after it, whatever went wrong.

    Args:
        state: of the page.
        runner: its worker.
        open_: opens a session by path and camera file, and reports meanwhile.
        drawn: waits until the browser has shown the latest frame, so that playing never piles up frames.
        kernels: waits in the worker until the kernels are compiled, and reports meanwhile.
        keeper: keeps what was tracked on disk; without it nothing is kept.
        allowed: returns the path of a file that a visitor has named, or raises an SpfError; without it all may be read.
    """

    def __init__(
        self,
        state: State,
        runner: Runner,
        open_: Open = open_session,
        drawn: Callable[[], Awaitable[None]] = _at_once,
        kernels: Wait = _ready,
        keeper: Keeper | None = None,
        allowed: Callable[[str], Path] = Path,
    ) -> None:
        self.state, self._runner, self.opener, self.drawn, self.kernels = state, runner, open_, drawn, kernels
        self.keeper, self.allowed = keeper or Keeper(state, None), allowed
        self._turn = 0  # counts what was cancelled, so that an action knows when it no longer is the one that runs
        self._advancing = asyncio.Lock()

    async def run(self, work: Callable[[Report], T]) -> T:
        """Do work in the page's worker, and show what it reports."""
        return await self._runner.run(work, self._watch)

    def _watch(self, text: str, share: float) -> None:
        self.state.param.update(task=text, share=min(max(share, 0.0), 1.0))

    def free(self) -> bool:
        """Return whether something can begin now; when it cannot, the visitor is told why.

        A page shows what cannot be done, but a click may be on its way when work begins.
        """
        self.state.answer = self.state.occupied
        return not self.state.answer

    @asynccontextmanager
    async def doing(self, task: str) -> AsyncIterator[Wanted]:
        """Say what is being done meanwhile, and afterwards in one sentence what went wrong.

        Yields:
            A function that tells whether it is still wanted: nobody has cancelled it.
        """
        state, turn = self.state, self._turn
        state.param.update(task=task, share=0.0, left="", error="", answer="")
        try:
            yield lambda: self._turn == turn
        except CancelledError:
            self.keeper.keep_soon()
            return  # whoever cancelled has set the state already, and may be doing something else by now
        except SpfError as error:
            state.error = str(error)
        except Exception as error:
            _log.exception("Unexpected error while %s", task or "tracking a frame")
            state.error = (
                f"Something unexpected went wrong ({type(error).__name__}: {error}); the server's log says more."
            )
        if self._turn == turn and task:  # else it may be somebody else's by now
            state.param.update(task="", share=0.0, left="", answer="")
        self.keeper.keep_soon()

    def cancel(self) -> None:
        """Give up what runs in the background; everything tracked so far stays."""
        self._turn += 1
        self._runner.cancel()
        self.state.param.update(playing=False, task="", share=0.0, left="", answer="")

    def close(self) -> None:
        """The page is gone."""
        self.cancel()
        self.keeper.close()
        self._runner.close()

    async def advance(self, wanted: Wanted) -> bool:
        """Show the next frame, tracking it if need be; False when there is none."""
        state = self.state
        async with self._advancing:  # clicks that come faster than frames are done one after the other
            if not wanted():
                raise CancelledError
            index, shown = state.next_frame, state.frame
            if index is None:
                return False
            await self.track(index, [lane for lane in state.active if lane.summary(index) is None], wanted)
            if state.frame == shown:  # nobody has looked elsewhere meanwhile
                state.show(index)
            return True

    async def track(self, index: int, lanes: list[Lane], wanted: Wanted, seed: int = 0) -> None:
        """Track a frame in some lanes, in all of them or in none; ``seed`` is added to theirs."""
        if not wanted():
            raise CancelledError
        state = self.state
        assert state.session is not None
        assert state.origin is not None
        lanes = [lane for lane in lanes if lane.begins(state.origin) <= index]
        if not lanes:
            return
        for lane in lanes:
            self.keeper.before_change(lane, index)
        plans = [
            (tracking._replace(seed=tracking.seed + seed), before)
            for tracking, before in (lane.before(index, state.origin) for lane in lanes)
        ]
        frame, entries = await self.run(_frame_work(state.session, index, plans))
        for lane, entry in zip(lanes, entries, strict=True):
            lane.results.add(entry, frame)

    async def reach(self, frames: range, lanes: Sequence[Lane] = ()) -> None:
        """Track frames in lanes (those shown) that have not, following with the page while it is at the last one tracked."""
        state, clock = self.state, Clock(len(frames))
        async with self.doing(f"Tracking to frame {frames[-1]}") as wanted:
            for done, index in enumerate(frames, 1):
                behind = [lane for lane in lanes or state.active if lane.summary(index) is None]
                await self.track(index, behind, wanted)
                state.show(index if state.frame in (index - 1, index) else state.frame)
                state.param.update(share=done / len(frames), left=clock.left(done))
                self.keeper.keep_sometimes(index)

    async def once_more(self, index: int, lane: Lane, *, other_seed: bool) -> None:
        """Track one frame in one lane, with its seed or the next."""
        async with self.doing(f"Tracking frame {index} again") as wanted:
            await self.track(index, [lane], wanted, seed=1 if other_seed else 0)
            self.state.show(index)


def _frame_work(
    session: Session, index: int, plans: list[tuple[Tracking, TrackState]]
) -> Callable[[Report], tuple[Frame, list[Entry]]]:
    """Return the work that tracks one frame in some lanes, one after the other so that each has the machine to itself."""

    def work(report: Report) -> tuple[Frame, list[Entry]]:
        frame, entries = session[index], []
        for tracking, before in plans:
            report("", 0.0)  # ends the work here if it was cancelled
            after, result = track_frame(tracking, before, frame, record=True)
            entries.append(entry_of(result, after, tracking, before))
        return frame, entries

    return work
