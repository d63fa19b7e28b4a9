"""Keeps what a page tracks: each run in a folder of its own, soon after something was tracked, and when the page closes."""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Callable

from app.lane import Lane
from app.shelf import Shelf, plan_of_lane
from app.state import State
from spf.errors import SpfError

__all__ = ["Keeper"]

_SOON = 1.0  # s after which what was tracked is written
_OFTEN = 200  # frames after which a long run is written on the way
_LEAST = 2  # frames that make a run
_log = logging.getLogger(__name__)


class Keeper:
    """Writes the runs of a page.

    Args:
        state: of the page.
        shelf: where to; None keeps nothing.
    """

    def __init__(self, state: State, shelf: Shelf | None) -> None:
        self._state, self._shelf = state, shelf
        self._lock = asyncio.Lock()
        self._soon: asyncio.Task[None] | None = None

    def before_change(self, lane: Lane, frame: int) -> None:
        """A frame is about to be tracked: a run that was opened, or that loses frames by it, stays as it was kept."""
        if not lane.folder.owned or (lane.results.last is not None and frame <= lane.results.last):
            lane.fork()

    def keep_soon(self) -> None:
        """Write what is not on disk in a moment."""
        if self._shelf is not None and self._jobs() and (self._soon is None or self._soon.done()):
            self._soon = asyncio.get_running_loop().create_task(self._wait_and_keep())

    def keep_sometimes(self, frame: int) -> None:
        """Write on the way of a long run."""
        if frame % _OFTEN == 0:
            self.keep_soon()

    async def _wait_and_keep(self) -> None:
        await asyncio.sleep(_SOON)
        await self.keep()

    async def keep(self) -> bool:
        """Write what is not on disk yet.

        Returns:
            Whether it could be: else the state's error says why, and what was tracked is not to be dropped.
        """
        async with self._lock:
            for job in self._jobs():
                try:
                    await asyncio.to_thread(job)
                except SpfError as error:
                    self._state.error = str(error)
                    return False
                self._state.shelf += 1
        return True

    def close(self) -> None:
        """Write what is not on disk yet, at once: the page is gone."""
        for job in self._jobs():
            try:
                job()
            except SpfError as error:
                _log.error("A run could not be kept: %s", error)

    def _jobs(self) -> list[Callable[[], None]]:
        """What there is to write, fixed as it is now."""
        state, shelf = self._state, self._shelf
        if shelf is None or state.session is None or state.origin is None:
            return []
        jobs = []
        for lane in state.lanes:
            if lane.is_kept or len(lane.results.summaries) < _LEAST:
                continue
            jobs.append(self._job(lane, shelf))
        return jobs

    def _job(self, lane: Lane, shelf: Shelf) -> Callable[[], None]:
        state = self._state
        session, origin = state.session, state.origin
        assert session is not None
        assert origin is not None
        plan, results, last = plan_of_lane(lane, origin, state.init), lane.results.copy(), lane.results.last
        folder, title, tracker, camera = lane.folder, lane.label or lane.title, lane.tracker, state.camera

        def write() -> None:
            folder.run = folder.run or shelf.new(session.name, tracker)
            shelf.write(folder.run, title, plan, session, camera, results)
            folder.kept = (last or 0) + 1

        return write
