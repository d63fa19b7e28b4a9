"""One sensor thread: every capture to the recorder, the newest one to whoever tracks; a lost sensor is connected to again."""

from __future__ import annotations

import threading
import time
from collections import deque
from collections.abc import Callable
from pathlib import Path
from typing import Self

from spf.errors import SensorError, SessionError
from spf.live.feed_state import CONNECTING, FeedState, Taken
from spf.live.recorder import Recorder, Recording
from spf.live.source import About, Capture, LiveSource
from spf.sessions import Side

__all__ = ["Feed"]

_RETRY = 1.0  # s between two attempts to connect
_RATE_OVER = 60  # captures that the rate is measured over


class Feed:
    """Runs a live source in a thread.

    Args:
        source: the sensor.
        wait: whether a sensor that is not there at first is waited for; else that ends the feed, with its message.
        retry: seconds between two attempts to connect.
        send: called with every capture, by the sensor's thread.
    """

    def __init__(
        self,
        source: LiveSource,
        *,
        wait: bool = False,
        retry: float = _RETRY,
        send: Callable[[About, Capture], None] | None = None,
    ) -> None:
        self._send = send
        self._source, self._wait, self._retry = source, wait, retry
        self._changed = threading.Condition()
        self._stop = threading.Event()
        self._state = FeedState(None, False, CONNECTING, 0, 0, 0, 0.0, 0, False, False)
        self._newest: Taken | None = None
        self._recorder: Recorder | None = None
        self._record: Callable[[About, Capture], Recorder] | None = None
        self._record_error: SessionError | None = None
        self._shift_ns: int | None = None  # from the sensor's time stamps to ns since the first capture
        self._number: int | None = None
        self._arrivals: deque[float] = deque(maxlen=_RATE_OVER)
        self._failure: Exception | None = None
        self._thread = threading.Thread(target=self._run, name="sensor", daemon=True)

    def start(self) -> Self:
        """Start the thread."""
        self._thread.start()
        return self

    def stop(self) -> None:
        """End the thread, the sensor and a recording that is being made."""
        self._stop.set()
        self._thread.join()
        self.stop_recording()

    def __enter__(self) -> Self:
        return self.start()

    def __exit__(self, *_: object) -> None:
        self.stop()

    @property
    def state(self) -> FeedState:
        """How it stands now."""
        with self._changed:
            return self._state

    def opened(self, timeout: float | None = None) -> bool:
        """Wait until the sensor was open once, or cannot be; returns whether that came in time (s)."""
        with self._changed:
            return self._changed.wait_for(lambda: self._state.about is not None or self._state.ended, timeout)

    def about(self) -> About:
        """Wait until the sensor was open once, and return what it is.

        Raises:
            SensorError: it cannot be opened and is not waited for.
        """
        self.opened()
        with self._changed:
            if self._state.about is None:
                raise SensorError(self._state.message)
            return self._state.about

    def newest(self, after: int = -1, timeout: float = 1.0) -> Taken | None:
        """Wait for a capture with an index above ``after`` and return the newest; None when none came in time.

        It is the same one for all who ask: what they did not come to is left out.
        """
        with self._changed:
            self._changed.wait_for(
                lambda: self._failure or self._state.ended or (self._newest and self._newest.index > after), timeout
            )
            if self._failure is not None:
                raise self._failure
            return self._newest if self._newest is not None and self._newest.index > after else None

    def record(
        self,
        path: Path,
        *,
        side: Side | None = None,
        overwrite: bool = False,
        acknowledge: Callable[[int], None] | None = None,
    ) -> None:
        """Record every capture from the next one on, see :class:`Recorder`; :meth:`recording_began` says whether it can."""

        def make(about: About, first: Capture) -> Recorder:
            return Recorder(path, about, first, side=side, overwrite=overwrite, acknowledge=acknowledge)

        with self._changed:
            self._record, self._record_error = make, None

    def recording_began(self, timeout: float | None = None) -> bool:
        """Wait until the recording that was asked for has its first frame; returns whether that came in time (s).

        Raises:
            SessionError: the file cannot be made.
            SensorError: the sensor gives no more frames.
        """
        with self._changed:
            in_time = self._changed.wait_for(lambda: self._record is None or self._state.ended, timeout)
            if self._record_error is not None:
                raise self._record_error
            if self._failure is not None:
                raise self._failure
            if in_time and self._record is not None:
                raise SensorError(self._state.message)
            return in_time

    def stop_recording(self) -> Recording | None:
        """End the recording, whole; returns how it stands, None if there is none."""
        with self._changed:
            recorder, self._recorder, self._record = self._recorder, None, None
        return None if recorder is None else recorder.close()

    def note(self, kind: str, text: str) -> bool:
        """Put a marker, note or event into the recording; returns whether one is being made that takes it."""
        with self._changed:
            return self._recorder is not None and self._recorder.note(kind, text)

    @property
    def recording(self) -> Recording | None:
        """How the recording stands; None if there is none."""
        with self._changed:
            return None if self._recorder is None else self._recorder.state

    def _run(self) -> None:
        try:
            while not self._stop.is_set() and self._connect():
                if self._follow():
                    break
                self._stop.wait(self._retry)
        except Exception as error:  # a fault of the program: the thread that waits for frames has to see it
            with self._changed:
                self._failure = error
        finally:
            self._update(connected=False, ended=True)

    def _connect(self) -> bool:
        """Open the source, trying again and again once it was open or when it is waited for; False if that is over."""
        while not self._stop.is_set():
            try:
                about = self._source.open(self._stop.is_set)
            except SensorError as error:
                self._update(message=str(error))
                if not self._wait and self.state.about is None:
                    self._update(failed=True)
                    return False
                self._stop.wait(self._retry)
                continue
            before = self.state
            if before.about is not None:
                if (before.about.camera, before.about.depth_unit) != (about.camera, about.depth_unit):
                    self._source.close()
                    self._update(
                        message="The sensor came back with another image size or camera: begin anew with it.",
                        failed=True,
                    )
                    return False
                self._update(reconnected=before.reconnected + 1)
                self.note("event", "The sensor came back.")
            self._update(about=about, connected=True, message=" ".join(about.warnings))
            return True
        return False

    def _follow(self) -> bool:
        """Take captures until the source ends (True) or is lost (False)."""
        self._number, rebase = None, True
        try:
            for capture in self._source.captures():
                if self._stop.is_set():
                    return True
                if capture is not None:
                    self._take(capture, rebase)
                    rebase = False
            self._update(message="")  # a recording that is over, not a fault
            return True
        except SensorError as error:
            self._update(connected=False, message=f"{error} Trying again.")
            self.note("event", f"The sensor was lost: {error}")
            return False
        finally:
            self._source.close()

    def _take(self, capture: Capture, rebase: bool) -> None:
        about, newest = self._state.about, self._newest
        assert about is not None
        if rebase:
            self._rebase(capture)
        assert self._shift_ns is not None
        time_ns = capture.time_ns + self._shift_ns
        if newest is not None and time_ns <= newest.capture.time_ns:
            self._update(repeated=self._state.repeated + 1)
            return
        gap = 0 if self._number is None else max(capture.number - self._number - 1, 0)
        self._number = capture.number
        capture = capture._replace(time_ns=time_ns)
        if self._send is not None:
            self._send(about, capture)
        self._arrivals.append(time.monotonic())
        with self._changed:
            if self._record is not None:
                self._begin_recording(self._record, about, capture)
            recorded = None if self._recorder is None else self._recorder.offer(capture)
            state = self._state
            self._newest = Taken(state.taken, capture, about, recorded)
            span = self._arrivals[-1] - self._arrivals[0]
            rate = (len(self._arrivals) - 1) / span if span > 0 else 0.0
            self._state = state._replace(taken=state.taken + 1, missing=state.missing + gap, rate=rate)
            self._changed.notify_all()

    def _begin_recording(self, make: Callable[[About, Capture], Recorder], about: About, first: Capture) -> None:
        self._record = None
        try:
            self._recorder = make(about, first)
        except SessionError as error:  # told by recording_began; the feed goes on
            self._record_error = error

    def _rebase(self, capture: Capture) -> None:
        """Let the times of a sensor that came back go on by how long it was away: its own clock may have begun anew."""
        if self._newest is None:
            self._shift_ns = -capture.time_ns
            return
        last = self._newest.capture
        self._shift_ns = last.time_ns + round((capture.captured - last.captured) * 1e9) - capture.time_ns

    def _update(self, **changes: object) -> None:
        with self._changed:
            self._state = self._state._replace(**changes)  # type: ignore[arg-type]
            self._changed.notify_all()
