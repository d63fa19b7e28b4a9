"""What a visitor can do: open, start, step, play, pause, jump, restart, cancel; the page's worker does the work."""

from __future__ import annotations

import asyncio
import logging
from collections.abc import AsyncIterator, Awaitable, Callable
from contextlib import asynccontextmanager
from pathlib import Path
from typing import TypeVar

from app.results import Entry, thinned
from app.runner import CancelledError, Report, Runner
from app.state import Origin, State
from spf.errors import HandError, SpfError, StartError
from spf.frame import Frame
from spf.hand import read_hand_shape
from spf.prepare import prepare
from spf.sessions import Session, open_session
from spf.track import Tracking, TrackState, begin, track_frame

__all__ = ["Controller"]

T = TypeVar("T")
Open = Callable[[str, str | None], Session]
Wanted = Callable[[], bool]
_log = logging.getLogger(__name__)


async def _at_once() -> None:
    """Wait for no picture: without a browser nobody draws one."""


class Controller:
    """Acts on one page's state. Every action ends with a state that can be shown, whatever went wrong.

    Args:
        state: of the page.
        runner: its worker.
        open_: opens a session by path and camera file.
        drawn: waits until the browser has shown the latest frame, so that playing never piles up frames.
    """

    def __init__(
        self,
        state: State,
        runner: Runner,
        open_: Open = open_session,
        drawn: Callable[[], Awaitable[None]] = _at_once,
    ) -> None:
        self.state, self._runner, self._open, self.drawn = state, runner, open_, drawn
        self._turn = 0  # counts what was cancelled, so that an action knows when it no longer is the one that runs
        self._advancing = asyncio.Lock()

    async def open(self, uri: str, camera: str = "") -> None:
        """Open a session; the one before stays when it cannot be."""
        self.cancel()
        async with self._doing("Opening the session"):
            if not uri.strip():
                raise StartError("Type the path of a session first: a file or a folder.")
            session = await self._run(lambda _report: self._open(uri.strip(), camera.strip() or None))
            self.state.load(session)

    async def start(self) -> None:
        """Find the first pose as chosen and track the first frame."""
        self.cancel()
        async with self._doing("Finding the first pose") as wanted:
            self.state.begin(await self._run(self._preparation()))
            await self._advance(wanted)

    def _preparation(self) -> Callable[[Report], Origin]:
        """Return the work of Start, with everything that was chosen until now."""
        state = self.state
        session, tracker, settings, seed = state.session, state.tracker, state.settings, state.seed
        init = _chosen_file(state.pose_file, "pose") if state.init == "file" else state.init
        hand_file = _chosen_file(state.hand_file, "hand") if state.shape == "file" else None
        if session is None:
            raise StartError("Choose a session first.")

        def work(report: Report) -> Origin:
            shape = read_hand_shape(hand_file) if hand_file else None
            start = prepare(session, init=init, shape=shape, seed=seed, progress=report)
            return Origin(start, *begin(tracker, settings, start, seed, time=float(session.times[start.frame])))

        return work

    async def step(self) -> None:
        """Go on by one frame: track it, or show it again if it was tracked with the present settings."""
        if self.state.busy:
            return
        async with self._doing("") as wanted:
            await self._advance(wanted)

    async def play(self) -> None:
        """Step until the end of the session or until paused."""
        state = self.state
        if state.busy or state.next_frame is None:
            return
        state.playing = True
        async with self._doing("") as wanted:
            try:
                while state.playing and await self._advance(wanted):
                    await self.drawn()
            finally:
                if wanted():
                    state.playing = False

    def pause(self) -> None:
        """Stop after the frame in flight."""
        self.state.playing = False

    async def jump(self, frame: int) -> None:
        """Show a frame; one beyond what was tracked is tracked forward to, if there is a start."""
        state = self.state
        if state.session is None or frame == state.frame:
            return
        self.cancel()
        last = state.results.last
        if last is None or frame <= last:
            state.show(frame)
            return
        async with self._doing(f"Tracking to frame {frame}") as wanted:
            state.show(last)
            while state.frame < frame and await self._advance(wanted):
                state.share = (state.frame - last) / (frame - last)

    async def restart(self) -> None:
        """Go back to the first frame of the run and track it anew with the present settings."""
        state = self.state
        if state.origin is None:
            return
        self.cancel()
        async with self._doing("") as wanted:
            state.begin(state.origin)
            await self._advance(wanted)

    def cancel(self) -> None:
        """Give up what runs in the background; everything tracked so far stays."""
        self._turn += 1
        self._runner.cancel()
        self.state.param.update(playing=False, task="", share=0.0)

    def close(self) -> None:
        """The page is gone."""
        self.cancel()
        self._runner.close()

    async def _advance(self, wanted: Wanted) -> bool:
        """Show the next frame, tracking it if need be; False when there is none."""
        state = self.state
        async with self._advancing:  # clicks that come faster than frames are done one after the other
            if not wanted():
                raise CancelledError
            index = state.next_frame
            if index is None:
                return False
            if not state.is_current(index):
                tracking, before = self._before(index)
                entry, frame = await self._run(_frame_work(state.session, index, tracking, before))
                state.results.add(entry, frame)
            state.show(index)
            return True

    def _before(self, index: int) -> tuple[Tracking, TrackState]:
        """Return how a frame is to be tracked now, and the tracker's state before it."""
        state, origin = self.state, self.state.origin
        assert origin is not None
        tracking = origin.tracking._replace(tracker=state.tracker, settings=state.settings)
        if index == origin.start.frame:
            assert state.session is not None
            time = float(state.session.times[index])
            return begin(state.tracker, state.settings, origin.start, origin.tracking.seed, time=time)
        entry = state.results.entry(index - 1)
        if entry is None:
            raise StartError(
                f"The particles of frame {index - 1} are no longer in memory: go on from the last tracked frame, "
                "or restart."
            )
        return tracking, entry.state

    async def _run(self, work: Callable[[Report], T]) -> T:
        return await self._runner.run(work, self._watch)

    def _watch(self, text: str, share: float) -> None:
        self.state.param.update(task=text, share=min(max(share, 0.0), 1.0))

    @asynccontextmanager
    async def _doing(self, task: str) -> AsyncIterator[Wanted]:
        """Say what is being done meanwhile, and afterwards in one sentence what went wrong.

        Yields:
            A function that tells whether it is still wanted: nobody has cancelled it.
        """
        state, turn = self.state, self._turn
        state.param.update(task=task, share=0.0, error="")
        try:
            yield lambda: self._turn == turn
        except CancelledError:
            return  # whoever cancelled has set the state already, and may be doing something else by now
        except SpfError as error:
            state.error = str(error)
        except Exception as error:
            _log.exception("Unexpected error while %s", task or "tracking a frame")
            state.error = (
                f"Something unexpected went wrong ({type(error).__name__}: {error}); the server's log says more."
            )
        if self._turn == turn:
            state.param.update(task="", share=0.0)


def _frame_work(
    session: Session | None, index: int, tracking: Tracking, before: TrackState
) -> Callable[[Report], tuple[Entry, Frame]]:
    """Return the work that tracks one frame."""
    assert session is not None

    def work(_report: Report) -> tuple[Entry, Frame]:
        frame = session[index]
        after, result = track_frame(tracking, before, frame, record=True)
        return Entry(thinned(result), after, tracking), frame

    return work


def _chosen_file(path: str, what: str) -> str:
    if not path.strip():
        raise HandError(f"Type the path of a {what} file first.")
    if not Path(path.strip()).is_file():
        raise HandError(f"There is no {what} file {path.strip()}: check its path.")
    return path.strip()
