"""What a visitor can do: open, start, step, play, pause, jump, restart, cancel; the page's worker does the work."""

from __future__ import annotations

import asyncio
import logging
from collections.abc import AsyncIterator, Awaitable, Callable, Sequence
from contextlib import asynccontextmanager
from pathlib import Path
from typing import TypeVar

from app import moves
from app.clock import Clock
from app.keeper import Keeper
from app.lane import Lane, Origin
from app.results import Entry, entry_of
from app.runner import CancelledError, Report, Runner
from app.state import State
from spf.errors import HandError, SpfError, StartError
from spf.frame import Frame
from spf.hand import read_hand_shape
from spf.prepare import prepare
from spf.sessions import Session, open_session
from spf.track import Tracking, TrackState, track_frame

__all__ = ["Controller"]

T = TypeVar("T")
Open = Callable[[str, str | None], Session]
Wanted = Callable[[], bool]
Wait = Callable[[Report], None]
_log = logging.getLogger(__name__)


async def _at_once() -> None:
    """Wait for no picture: without a browser nobody draws one."""


def _ready(_report: Report) -> None:
    """Wait for no kernel: they are compiled when they are used."""


class Controller:
    """Acts on one page's state. Every action ends with a state that can be shown, whatever went wrong.

    Args:
        state: of the page.
        runner: its worker.
        open_: opens a session by path and camera file.
        drawn: waits until the browser has shown the latest frame, so that playing never piles up frames.
        kernels: waits in the worker until the kernels are compiled, and reports meanwhile.
        keeper: keeps what was tracked on disk; without it nothing is kept.
    """

    def __init__(
        self,
        state: State,
        runner: Runner,
        open_: Open = open_session,
        drawn: Callable[[], Awaitable[None]] = _at_once,
        kernels: Wait = _ready,
        keeper: Keeper | None = None,
    ) -> None:
        self.state, self._runner, self.opener, self.drawn, self._kernels = state, runner, open_, drawn, kernels
        self.keeper = keeper or Keeper(state, None)
        self._turn = 0  # counts what was cancelled, so that an action knows when it no longer is the one that runs
        self._advancing = asyncio.Lock()

    async def open(self, uri: str, camera: str = "") -> None:
        """Open a session; the one before stays when it cannot be."""
        self.cancel()
        async with self.doing("Opening the session"):
            if not uri.strip():
                raise StartError("Type the path of a session first: a file or a folder.")
            session = await self.run(lambda _report: self.opener(uri.strip(), camera.strip() or None))
            if await self.keeper.keep():
                self.state.load(session, camera.strip())

    async def start(self) -> None:
        """Find the first pose as chosen and track the first frame."""
        self.cancel()
        async with self.doing("Finding the first pose") as wanted:
            origin = await self.run(self._preparation())
            if not await self.keeper.keep():
                return
            self.state.begin(origin)
            await self._advance(wanted)

    def _preparation(self) -> Callable[[Report], Origin]:
        """Return the work of Start, with everything that was chosen until now."""
        state, kernels = self.state, self._kernels
        session, seed = state.session, state.seed
        init = _chosen_file(state.pose_file, "pose") if state.init == "file" else state.init
        hand_file = _chosen_file(state.hand_file, "hand") if state.shape == "file" else None
        if session is None:
            raise StartError("Choose a session first.")

        def work(report: Report) -> Origin:
            kernels(report)
            shape = read_hand_shape(hand_file) if hand_file else None
            start = prepare(session, init=init, shape=shape, seed=seed, progress=report)
            return Origin(start, float(session.times[start.frame]), seed)

        return work

    # ---- moving over the frames

    async def step(self) -> None:
        """Go on by one frame: show it if it was tracked, else track it."""
        if self.state.busy:
            return
        async with self.doing("") as wanted:
            await self._advance(wanted)

    async def play(self) -> None:
        """Play what was tracked and go on tracking, until the end of the range or session or until paused; or in a loop."""
        state = self.state
        if state.busy or state.session is None:
            return
        if state.next_frame is None or (state.span and state.frame >= state.span[1]):
            if state.last is None:
                return
            state.show(moves.first(state))
        state.playing, pace = True, moves.Pace()
        async with self.doing("") as wanted:
            try:
                while state.playing and await self._onward(wanted, pace):
                    await self.drawn()
            finally:
                if wanted():
                    state.playing = False

    async def _onward(self, wanted: Wanted, pace: moves.Pace) -> bool:
        """Show the next frame of play; False when there is none."""
        state = self.state
        assert state.session is not None
        times = state.session.times
        stride, wait = pace.due(state.speed * (len(times) - 1) / max(float(times[-1]), 1e-3))
        index = moves.played(state, stride)
        if index is None:
            is_over = state.loop or (state.span and state.frame >= state.span[1])
            return False if is_over else await self._advance(wanted)
        await asyncio.sleep(wait)
        if not wanted() or not state.playing:
            return False
        state.show(index)
        return True

    def pause(self) -> None:
        """Stop after the frame in flight."""
        self.state.playing = False

    def look(self, frame: int) -> None:
        """Show a frame, tracked or not; what runs in the background goes on, but play stops."""
        state = self.state
        if state.session is None or frame == state.frame:
            return
        state.playing = False
        state.show(min(max(frame, 0), len(state.session) - 1))

    async def forward(self) -> None:
        """Show the next frame, tracking it if it comes right after what was tracked."""
        state = self.state
        if state.task and state.last is not None and state.frame < state.last:
            self.look(state.frame + 1)
        elif not state.playing:
            await self.step()

    def back(self) -> None:
        """Show the frame before."""
        self.look(self.state.frame - 1)

    def first(self) -> None:
        """Show the first frame of the range or of what was tracked."""
        self.look(moves.first(self.state))

    def last(self) -> None:
        """Show the last frame that was tracked."""
        self.look(moves.last(self.state))

    def worst(self) -> None:
        """Show the worst frame."""
        frame = moves.worst(self.state)
        if frame is not None:
            self.look(frame)

    def next_loss(self) -> None:
        """Show where the hand is lost next."""
        frame = moves.next_loss(self.state)
        if frame is not None:
            self.look(frame)

    async def jump(self, frame: int) -> None:
        """Show a frame; one beyond what was tracked is tracked forward to, if there is a start."""
        state = self.state
        if state.session is None or (frame == state.frame and state.is_tracked):
            return
        self.cancel()
        last = state.last
        if last is None or frame <= last:
            state.show(frame)
            return
        state.show(last)
        await self.reach(range(last + 1, frame + 1))

    async def restart(self) -> None:
        """Go back to the first frame of the run and track it anew with the present settings."""
        state = self.state
        if state.origin is None:
            return
        self.cancel()
        async with self.doing("") as wanted:
            if not await self.keeper.keep():
                return
            state.rewind()
            await self._advance(wanted)

    async def show_mode(self, mode: str) -> None:
        """Show one tracker, or compare several, at the frame that is shown."""
        self.state.show_mode(mode)
        await self._catch_up()

    async def add_lane(self) -> None:
        """Compare with one more tracker, from the same start to the frame that is shown."""
        self.state.add_lane()
        await self._catch_up()

    async def choose(self, lane: Lane) -> None:
        """Choose the lane whose settings are edited, and that is shown alone."""
        self.state.choose(lane)
        await self._catch_up()

    async def remove_lane(self, lane: Lane) -> None:
        """Compare without a lane."""
        self.cancel()
        self.state.remove_lane(lane)

    async def _catch_up(self) -> None:
        """Have every lane shown track as far as the frame shown, which is the same in all of them."""
        state = self.state
        if state.origin is None or state.is_tracked or state.frame < state.origin.start.frame:
            return
        self.cancel()
        first = state.origin.start.frame if state.last is None else state.last + 1
        await self.reach(range(first, state.frame + 1))

    async def reach(self, frames: range, lanes: Sequence[Lane] = ()) -> None:
        """Track frames in lanes (those shown) that have not, following with the page while it is at the last one tracked."""
        state, clock = self.state, Clock(len(frames))
        async with self.doing(f"Tracking to frame {frames[-1]}") as wanted:
            for done, index in enumerate(frames, 1):
                shown = state.frame
                behind = [lane for lane in lanes or state.active if lane.summary(index) is None]
                await self.track(index, behind, wanted)
                state.show(index if shown in (index - 1, index) else state.frame)
                state.param.update(share=done / len(frames), left=clock.left(done))
                self.keeper.keep_sometimes(index)

    async def once_more(self, index: int, lane: Lane, *, other_seed: bool) -> None:
        """Track one frame in one lane, with its seed or the next."""
        async with self.doing(f"Tracking frame {index} again") as wanted:
            await self.track(index, [lane], wanted, seed=1 if other_seed else 0)
            self.state.show(index)

    def cancel(self) -> None:
        """Give up what runs in the background; everything tracked so far stays."""
        self._turn += 1
        self._runner.cancel()
        self.state.param.update(playing=False, task="", share=0.0, left="")

    def close(self) -> None:
        """The page is gone."""
        self.cancel()
        self.keeper.close()
        self._runner.close()

    async def _advance(self, wanted: Wanted) -> bool:
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

    async def run(self, work: Callable[[Report], T]) -> T:
        """Do work in the page's worker, and show what it reports."""
        return await self._runner.run(work, self._watch)

    def _watch(self, text: str, share: float) -> None:
        self.state.param.update(task=text, share=min(max(share, 0.0), 1.0))

    @asynccontextmanager
    async def doing(self, task: str) -> AsyncIterator[Wanted]:
        """Say what is being done meanwhile, and afterwards in one sentence what went wrong.

        Yields:
            A function that tells whether it is still wanted: nobody has cancelled it.
        """
        state, turn = self.state, self._turn
        state.param.update(task=task, share=0.0, left="", error="")
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
        if self._turn == turn:
            state.param.update(task="", share=0.0, left="")
        self.keeper.keep_soon()


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


def _chosen_file(path: str, what: str) -> str:
    if not path.strip():
        raise HandError(f"Type the path of a {what} file first.")
    if not Path(path.strip()).is_file():
        raise HandError(f"There is no {what} file {path.strip()}: check its path.")
    return path.strip()
