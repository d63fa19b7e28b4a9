"""A live sensor behind the page: connected, tracked with the newest frame winning, recorded; it knows no widget."""

from __future__ import annotations

import threading
import time
from collections import deque
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from app.folders import allowed_source
from app.state import warning_of
from spf.errors import SessionError, SpfError
from spf.frame import Frame
from spf.initialise import Doubted
from spf.live import Feed, FeedState, Recording, open_live
from spf.live.tracking import Request, find_live_start, follow
from spf.progress import Report

__all__ = ["Live", "LiveFacts", "LivePicture"]

_LATELY = 150  # tracked frames that the latency is of
_REMEDIES: dict[Doubted, str] = {
    "pose": "Disconnect and connect again with an open hand before the camera.",
    "side": "If it is the other one, disconnect, choose it under Hand shown and connect again.",
}


class LivePicture(NamedTuple):
    """What is seen now.

    Attributes:
        number: of the capture, so that a picture is not drawn twice.
        frame: the depth.
        joints: (21, 3) m of the tracked hand, None while there is none.
    """

    number: int
    frame: Frame
    joints: NDArray[np.float64] | None


class LiveFacts(NamedTuple):
    """How it stands.

    Attributes:
        doing: in words.
        feed: of the sensor.
        recording: None while none is made.
        tracked_rate: frames tracked per second, lately; 0 while none is.
        latency_ms: median and 95th percentile from capture to estimate, lately; None before the first.
        dropped: frames that were not tracked because newer ones were there.
        lost: frames tracked in which the hand was lost.
        warning: what may be wrong with the start, or "".
        error: why nothing is tracked any more, or "".
    """

    doing: str
    feed: FeedState
    recording: Recording | None
    tracked_rate: float
    latency_ms: tuple[float, float] | None
    dropped: int
    lost: int
    warning: str
    error: str


class Live:
    """One live sensor being tracked.

    Args:
        uri: of the sensor.
        request: how it is tracked.
        kernels: waits until the kernels are compiled.

    Raises:
        OutsideError: it replays a recording that a page may not open.
        SensorError: the URI is wrong, or what it needs is not installed. A sensor that is missing is waited for.
    """

    def __init__(self, uri: str, request: Request, kernels: Callable[[Report], None] = lambda _report: None) -> None:
        self._request, self._kernels = request, kernels
        self._feed = Feed(open_live(allowed_source(uri)), wait=True).start()
        self._stop = threading.Event()
        self._doing, self._warning, self._error = "Connecting", "", ""
        self._picture: LivePicture | None = None
        self._lately: deque[tuple[float, float]] = deque(maxlen=_LATELY)  # (when estimated, latency), s
        self._dropped = self._lost = 0
        self._thread = threading.Thread(target=self._track, name="live tracking", daemon=True)
        self._thread.start()

    @property
    def facts(self) -> LiveFacts:
        """How it stands now."""
        feed, lately = self._feed.state, list(self._lately)
        span = lately[-1][0] - lately[0][0] if len(lately) > 1 else 0.0
        percentiles = np.percentile([latency for _, latency in lately], [50, 95]) * 1e3 if lately else None
        return LiveFacts(
            self._doing_now(feed),
            feed,
            self._feed.recording,
            (len(lately) - 1) / span if span > 0 else 0.0,
            None if percentiles is None else (float(percentiles[0]), float(percentiles[1])),
            self._dropped,
            self._lost,
            self._warning,
            self._error,
        )

    @property
    def picture(self) -> LivePicture | None:
        """What is seen now: the last tracked frame, or the newest one while no hand is tracked yet."""
        if self._picture is not None:
            return self._picture
        taken = self._feed.newest(timeout=0.0)
        return None if taken is None else LivePicture(taken.index, taken.frame(), None)

    def _doing_now(self, feed: FeedState) -> str:
        if self._error or feed.failed:
            return "Stopped"
        if feed.ended:
            return "The source has ended"
        return self._doing if feed.connected else "Connecting"

    def record(self, path: Path) -> None:
        """Record every frame from the next one on; blocks until it is there.

        Raises:
            SessionError: the file exists, cannot be made or the disk is full.
            SensorError: the sensor gives no more frames.
        """
        if not self._feed.state.connected:
            raise SessionError(
                "Nothing can be recorded before the sensor is connected: wait until its picture is there."
            )
        path.parent.mkdir(parents=True, exist_ok=True)
        self._feed.record(path, side=self._request.side)
        self._feed.recording_began()

    def note(self, text: str) -> bool:
        """Set a marker, with a text if there is one; returns whether a recording is being made."""
        return self._feed.note("note" if text else "marker", text)

    def stop_recording(self) -> Recording | None:
        """End the recording, whole; blocks until it is written."""
        return self._feed.stop_recording()

    def close(self) -> Recording | None:
        """Disconnect; a recording is ended whole, and returned."""
        self._stop.set()
        recording = self._feed.stop_recording()
        self._feed.stop()
        self._thread.join()
        return recording

    def _track(self) -> None:
        try:
            self._kernels(self._report)
            start = find_live_start(self._feed, self._request, self._report, self._stop.is_set)
            if start is None:
                return
            self._warning = warning_of(start, _REMEDIES)
            for tracked in follow(self._feed, self._request, start, self._stop.is_set):
                result = tracked.result
                self._doing = "Lost, searching" if result.lost else "Tracking"
                self._lately.append((time.monotonic(), tracked.latency))
                self._dropped += tracked.dropped
                self._lost += result.lost
                joints = None if result.lost else result.joints
                self._picture = LivePicture(tracked.taken.index, tracked.frame, joints)
        except SpfError as error:
            self._error = str(error)
        except Exception as error:  # a fault of the program, which would end this thread unseen; the recording goes on
            self._error = f"Tracking has failed ({type(error).__name__}: {error}); a recording goes on. Connect again."
            raise

    def _report(self, text: str, _share: float) -> None:
        if text:
            self._doing = text
