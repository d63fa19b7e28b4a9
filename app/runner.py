"""The worker of one page: a thread of its own, one piece of work in flight, with progress and cancel."""

from __future__ import annotations

import asyncio
import threading
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from typing import TypeVar

from spf.progress import Report

__all__ = ["CancelledError", "Runner"]

T = TypeVar("T")
_LOOK = 0.1  # s between two looks at the progress


class CancelledError(Exception):
    """The user cancelled the work; it is no error to be shown."""


class _Job:
    """Progress and cancellation of one piece of work; the worker writes the one and reads the other."""

    def __init__(self) -> None:
        self.cancelled = threading.Event()
        self.progress: tuple[str, float] | None = None

    def report(self, text: str, share: float) -> None:
        """Say what is being done, if anything is to be said; ends the work here if it was cancelled meanwhile."""
        if self.cancelled.is_set():
            raise CancelledError
        if text:
            self.progress = (text, share)


class Runner:
    """Runs work beside the event loop, one piece after the other."""

    def __init__(self) -> None:
        self._thread = self._new_thread()
        self._job: _Job | None = None

    @staticmethod
    def _new_thread() -> ThreadPoolExecutor:
        return ThreadPoolExecutor(max_workers=1, thread_name_prefix="spf-page")

    async def run(self, work: Callable[[Report], T], watch: Report | None = None) -> T:
        """Run work in the thread and wait for it without blocking the event loop.

        Args:
            work: called with a function that reports (what is being done, share done).
            watch: called in the event loop with the latest report.

        Returns:
            What the work returned.

        Raises:
            CancelledError: :meth:`cancel` was called; the thread may finish its last bit, nobody waits for it.
        """
        job = self._job = _Job()
        future = asyncio.get_running_loop().run_in_executor(self._thread, work, job.report)
        seen = None
        while not future.done():
            await asyncio.wait({future}, timeout=_LOOK)
            if job.cancelled.is_set():
                future.add_done_callback(_forget)
                raise CancelledError
            if watch is not None and job.progress is not None and job.progress != seen:
                seen = job.progress
                watch(*seen)
        return future.result()

    def cancel(self) -> None:
        """Give up the work in flight; new work need not wait for it."""
        if self._job is not None:
            self._job.cancelled.set()
            self._job = None
            self._thread.shutdown(wait=False, cancel_futures=True)
            self._thread = self._new_thread()

    def close(self) -> None:
        """Give up the work in flight and end the thread."""
        self.cancel()
        self._thread.shutdown(wait=False)


def _forget(future: asyncio.Future[T]) -> None:
    """Look at how cancelled work ended, so that asyncio does not complain that nobody did."""
    if not future.cancelled():
        future.exception()
