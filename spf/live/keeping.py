"""A live run kept beside its recording, so that it can be repeated from it: the track and its manifest in a directory."""

from __future__ import annotations

from pathlib import Path
from types import TracebackType
from typing import Any, Self

import numpy as np

from spf.initialise import Start
from spf.live.tracking import LiveFrame, Request
from spf.manifest import live_manifest_of, manifest_of
from spf.runs import RunWriter
from spf.sessions import open_session
from spf.trackfile import Track

__all__ = ["LiveRun", "latency_facts"]


class LiveRun:
    """Keeps what is tracked of a feed that is recorded.

    Args:
        directory: of the run.
        recording: the file that is being recorded.
        uri: of the live source.
        request: how it is tracked.
        start: that it begins with.
        command: the exact command line.
        overwrite: replace a run that is there.

    Raises:
        RunError: there is a run already, or the directory cannot be made.
    """

    def __init__(
        self,
        directory: Path,
        recording: Path,
        uri: str,
        request: Request,
        start: Start,
        command: list[str],
        *,
        overwrite: bool = False,
    ) -> None:
        self.start = start
        self._recording, self._uri, self._request, self._command = recording, uri, request, command
        self._latencies: list[float] = []
        self._dropped = 0
        plan = request.plan(start, start.frame, start.frame)
        manifest = live_manifest_of(plan, recording, command) | {"live": self.facts()}
        self._writer = RunWriter(directory, manifest, start.shape.hand().dof_names, overwrite=overwrite)

    def add(self, tracked: LiveFrame) -> None:
        """Add the next tracked frame.

        Raises:
            RunError: the directory cannot be written to any more.
        """
        self._latencies.append(tracked.latency)
        self._dropped += tracked.dropped
        self._writer.add(tracked.result)

    def finish(self) -> None:
        """Describe the finished recording in the manifest; it has to be closed before.

        Raises:
            SessionError: the recording cannot be read.
        """
        frames = self._writer.track.frame
        first, last = (int(frames[0]), int(frames[-1]) + 1) if len(frames) else (0, 0)
        with open_session(self._recording) as session:
            plan = self._request.plan(self.start, first, last)
            self._writer.describe(manifest_of(plan, session, None, self._command) | {"live": self.facts()})

    @property
    def track(self) -> Track:
        """What was tracked until now."""
        return self._writer.track

    def facts(self) -> dict[str, Any]:
        """Return what is particular to a live run, ready for JSON."""
        return {"uri": self._uri, "dropped": self._dropped, **latency_facts(self._latencies)}

    def __enter__(self) -> Self:
        self._writer.__enter__()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._writer.__exit__(kind, error, trace)


def latency_facts(latencies: list[float]) -> dict[str, float | None]:
    """Return the median and the 95th percentile of latencies in s, as ms."""
    if not latencies:
        return {"latency_ms_median": None, "latency_ms_p95": None}
    middle, high = np.percentile(latencies, [50, 95]) * 1e3
    return {"latency_ms_median": round(float(middle), 1), "latency_ms_p95": round(float(high), 1)}
