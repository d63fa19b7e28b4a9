"""Moving over the frames of a session: step, play, jump; what was not tracked yet is tracked on the way."""

from __future__ import annotations

import asyncio

from app import moves
from app.work import Wanted, Work

__all__ = ["Navigation"]


class Navigation(Work):
    """The work of a page, and the moves of its visitor over the frames."""

    async def step(self) -> None:
        """Go on by one frame: show it if it was tracked, else track it."""
        if not self.free():
            return
        async with self.doing("") as wanted:
            await self.advance(wanted)

    async def play(self) -> None:
        """Play what was tracked and go on tracking, until the end of the range or session or until paused; or in a loop."""
        state = self.state
        if state.session is None or not self.free():
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
            return False if is_over else await self.advance(wanted)
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
        if state.task and state.is_behind:
            self.look(state.frame + 1)
        else:
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
