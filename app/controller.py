"""What a visitor can do: open, start, restart, compare; moving over the frames is in :mod:`app.navigation`."""

from __future__ import annotations

from collections.abc import Callable

from app.clock import Clock
from app.lane import Lane, Origin
from app.navigation import Navigation
from spf.errors import HandError, StartError
from spf.hand import read_hand_shape
from spf.prepare import prepare
from spf.progress import Report
from spf.sessions import Session

__all__ = ["Controller"]


_SHARES = 100  # parts of a session's opening that the time left is told from


def _name(uri: str) -> str:
    """Return what a session is called while it is opened: its file or folder."""
    return uri.strip().rstrip("/").rpartition("/")[2] or "the session"


class Controller(Navigation):
    """Acts on one page's state. Every action ends with a state that can be shown, whatever went wrong."""

    async def open(self, uri: str, camera: str = "") -> None:
        """Open a session; the one before stays when it cannot be."""
        self.cancel()
        async with self.doing(f"Opening {_name(uri)}"):
            if not uri.strip():
                raise StartError("Type the path of a session first: a file or a folder.")
            session = await self.run(self._opening(uri.strip(), camera.strip() or None))
            if await self.keeper.keep():
                self.state.load(session, camera.strip())

    def _opening(self, uri: str, camera: str | None) -> Callable[[Report], Session]:
        """Return the work of opening, which says what is opened and how long that still takes."""
        clock = Clock(_SHARES)

        def work(report: Report) -> Session:
            def told(text: str, share: float) -> None:
                left = clock.left(int(share * _SHARES))
                report(" · ".join(part for part in (f"{_name(uri)}: {text}", left) if part), share)

            return self.opener(uri, camera, told)

        return work

    async def start(self) -> None:
        """Find the first pose as chosen and track the first frame."""
        self.cancel()
        async with self.doing("Finding the first pose") as wanted:
            origin = await self.run(self._preparation())
            if not await self.keeper.keep():
                return
            self.state.begin(origin)
            await self.advance(wanted)

    def _preparation(self) -> Callable[[Report], Origin]:
        """Return the work of Start, with everything that was chosen until now."""
        state, kernels = self.state, self.kernels
        session, seed = state.session, state.seed
        init = self._chosen_file(state.pose_file, "pose") if state.init == "file" else state.init
        hand_file = self._chosen_file(state.hand_file, "hand") if state.shape == "file" else None
        if session is None:
            raise StartError("Choose a session first.")

        def work(report: Report) -> Origin:
            kernels(report)
            shape = read_hand_shape(hand_file) if hand_file else None
            start = prepare(session, init=init, shape=shape, seed=seed, progress=report)
            return Origin(start, float(session.times[start.frame]), seed)

        return work

    def _chosen_file(self, path: str, what: str) -> str:
        if not path.strip():
            raise HandError(f"Type the path of a {what} file first.")
        chosen = self.allowed(path.strip())
        if not chosen.is_file():
            raise HandError(f"There is no {what} file {path.strip()}: check its path.")
        return str(chosen)

    async def restart(self) -> None:
        """Go back to the first frame of the run and track it anew with the present settings."""
        state = self.state
        if state.origin is None:
            return
        self.cancel()
        async with self.doing("Beginning again") as wanted:
            if not await self.keeper.keep():
                return
            state.rewind()
            await self.advance(wanted)

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
