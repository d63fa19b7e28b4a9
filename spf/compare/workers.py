"""Processes that track: each on one thread, so that the times of trackers that use threads and of others compare."""

from __future__ import annotations

import multiprocessing
import os
import signal
import time
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from contextlib import contextmanager
from multiprocessing.sharedctypes import Synchronized
from multiprocessing.synchronize import Event
from pathlib import Path
from typing import Any, NamedTuple, TypeVar

import numpy as np

from spf.evaluate import evaluate_run
from spf.manifest import Plan, manifest_of
from spf.runs import RunWriter, read_run, track_plan
from spf.sessions import open_session

__all__ = ["Job", "Workers", "open_workers", "seconds_per_frame", "track_and_measure"]

T = TypeVar("T")
Tick = Callable[[int], None]  # number of frames done
_POLL = 0.2  # s between two looks at the progress
_WARM = 2  # frames that load kernels and take more effort


class Job(NamedTuple):
    """A session to track.

    Attributes:
        uri, camera: of the session.
        plan: what to track it with.
        directory: of the run.
        command: the exact command line.
    """

    uri: str
    camera: Path | None
    plan: Plan
    directory: Path
    command: list[str]


class _Shared(NamedTuple):
    """What the processes share with their parent."""

    frames: Synchronized[int]
    stop: Event


_shared: list[_Shared] = []  # of this process, when it is a worker


def _begin(shared: _Shared) -> None:
    """Make this process a worker: one thread, and Ctrl-C is the parent's to handle."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    os.environ["SPF_THREADS"] = "1"
    _shared.append(shared)


class Workers:
    """A pool of processes.

    Args:
        pool: that runs them.
        shared: counter of frames done, and the event that ends the work.
    """

    def __init__(self, pool: ProcessPoolExecutor, shared: _Shared) -> None:
        self._pool, self._shared = pool, shared

    def map(
        self, function: Callable[..., T], arguments: Sequence[tuple[Any, ...]], tick: Tick
    ) -> Iterator[tuple[int, T]]:
        """Give (index, result) of every call as it is done; ``tick`` hears the number of frames done meanwhile."""
        self._shared.frames.value = 0
        futures: dict[Future[T], int] = {self._pool.submit(function, *given): i for i, given in enumerate(arguments)}
        waiting = set(futures)
        while waiting:
            done, waiting = wait(waiting, timeout=_POLL, return_when=FIRST_COMPLETED)
            tick(self._shared.frames.value)
            for future in done:
                yield futures[future], future.result()


@contextmanager
def open_workers(count: int) -> Iterator[Workers]:
    """Open a pool of processes; when it is left, work that is not begun is dropped, and what is begun ends early."""
    context = multiprocessing.get_context("spawn")
    shared = _Shared(context.Value("q", 0), context.Event())
    pool = ProcessPoolExecutor(count, mp_context=context, initializer=_begin, initargs=(shared,))
    try:
        yield Workers(pool, shared)
    finally:
        shared.stop.set()
        pool.shutdown(wait=True, cancel_futures=True)


def track_and_measure(job: Job) -> dict[str, Any] | None:
    """Track a session into a run's directory and measure it, in a worker; None when the work was ended early.

    Returns:
        What :func:`spf.evaluate.evaluate_run` gives, and the median of the processor's seconds per frame.
    """
    (shared,) = _shared
    seconds: list[float] = []
    with open_session(job.uri, job.camera) as session:
        manifest = manifest_of(job.plan, session, job.camera, job.command)
        with RunWriter(job.directory, manifest, job.plan.start.shape.hand().dof_names, overwrite=True) as writer:
            began = time.process_time()
            for result in track_plan(session, job.plan):
                seconds.append(time.process_time() - began)
                writer.add(result)
                with shared.frames.get_lock():
                    shared.frames.value += 1
                if shared.stop.is_set():
                    break
                began = time.process_time()
        if len(writer.track) < job.plan.last - job.plan.first:
            return None
        measures = evaluate_run(read_run(job.directory), session)
    tracked = seconds[job.plan.start.frame - job.plan.first :]
    return {**measures, "processor_seconds_per_frame_median": float(np.median(tracked))}


def seconds_per_frame(uri: str, camera: Path | None, plan: Plan) -> float:
    """Median of the processor's seconds that a frame of a plan takes, the first ones left out, in a worker."""
    with open_session(uri, camera) as session:
        seconds = [time.process_time()]
        for _ in track_plan(session, plan._replace(first=plan.start.frame)):
            seconds.append(time.process_time())
    return float(np.median(np.diff(seconds)[_WARM:]))
