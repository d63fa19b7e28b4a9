"""Recording beside tracking: a bounded queue and a thread of its own, so that nothing slow costs a recorded frame.

A frame is acknowledged when it is in the file, where it outlives the end of the program. The disk is looked at while there is
still room: a recording ends whole before the disk is full, and says so.
"""

from __future__ import annotations

import shutil
import threading
import time
from collections import deque
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple, Self

from spf.errors import SessionError
from spf.live.source import About, Capture
from spf.sessions import MCAPWriter, Note, Side

__all__ = ["Recorder", "Recording"]

_QUEUE_BYTES = 128 << 20
_QUEUE_FRAMES = 30  # at least
_LOOK_EVERY = 1.0  # s between looks at the disk
_SYNC_EVERY = 2.0  # s of frames that a power cut can cost
_RESERVE = 64 << 20  # bytes that are left free on the disk
_WARN = (10, 30, 60, 120)  # s of recording left when the user is warned


class Recording(NamedTuple):
    """How a recording stands.

    Attributes:
        path: the file.
        frames: acknowledged: they are in the file.
        queued: not yet written.
        lost: frames that could not be recorded because the disk was too slow, or after it was full.
        notes_lost: markers, notes and events that could not be recorded because a write had failed.
        seconds: from the first to the last acknowledged frame.
        size: bytes written.
        seconds_left: until the disk is full, at the present rate; inf while it is not known.
        warning: a sentence about something that will go wrong, or "".
        ended: why it ended by itself, or "" while it goes on or was ended by its user.
    """

    path: Path
    frames: int
    queued: int
    lost: int
    notes_lost: int
    seconds: float
    size: int
    seconds_left: float
    warning: str
    ended: str


class Recorder:
    """Records captures into a session file.

    Args:
        path: the file to write.
        about: the sensor.
        first: the first capture, which the times of the recording count from; it is not recorded by this.
        side: the hand shown, if known; else what the sensor says.
        overwrite: replace a file that is there.
        acknowledge: called with the index of each frame that is in the file, by the thread that writes.
        free_space: bytes free where a path lies.

    Raises:
        SessionError: the file exists or cannot be made, or the disk is nearly full.
    """

    def __init__(
        self,
        path: Path,
        about: About,
        first: Capture,
        *,
        side: Side | None = None,
        overwrite: bool = False,
        acknowledge: Callable[[int], None] | None = None,
        free_space: Callable[[Path], int] = lambda path: shutil.disk_usage(path).free,
    ) -> None:
        self._path, self._acknowledge, self._free_space = path, acknowledge, free_space
        self._first_ns, self._began = first.time_ns, first.captured
        self._room = max(_QUEUE_FRAMES, _QUEUE_BYTES // max(first.raw.nbytes, 1))
        folder = path.resolve().parent
        if not folder.is_dir():
            raise SessionError(f"There is no folder {folder} to record {path.name} to: make it first.")
        if free_space(folder) < 2 * _RESERVE:
            raise SessionError(
                f"The disk of {path} is full but for {free_space(folder) >> 20} MB: make room to record."
            )
        wall = time.time_ns() - round((time.monotonic() - first.captured) * 1e9)
        self._writer = MCAPWriter(
            path, camera=about.camera, depth_unit=about.depth_unit, side=side or about.side, start_time_ns=wall,
            metadata={**about.metadata, "sensor": about.sensor}, overwrite=overwrite,
        )  # fmt: skip
        self._queue: deque[Capture | Note] = deque()
        self._changed = threading.Condition()
        self._closing = False
        self._accepted, self._lost, self._notes_lost, self._frames_queued = 0, 0, 0, 0
        self._missed = 0  # frames lost since the last one that was accepted
        self._last_ns = self._first_ns
        self._free, self._rate, self._ended = float("inf"), 0.0, ""
        self._thread = threading.Thread(target=self._write_all, name=f"record {path.name}")
        self._thread.start()

    def offer(self, capture: Capture) -> int | None:
        """Take a capture to be recorded, without waiting.

        Returns:
            its index in the recording, None when it cannot be recorded (which is counted).
        """
        with self._changed:
            if self._ended or self._closing or self._frames_queued >= self._room:
                self._lost += 1
                self._missed += 1
                return None
            if self._missed:
                text = f"{self._missed} frames before this one were not recorded: the disk was too slow."
                self._queue.append(Note(self._seconds(capture.time_ns), "event", text))
                self._missed = 0
            self._queue.append(capture)
            self._frames_queued += 1
            self._accepted += 1
            self._changed.notify()
            return self._accepted - 1

    def note(self, kind: str, text: str, now: float | None = None) -> bool:
        """Add a marker, a note or an event at this instant (``now`` of ``time.monotonic()``).

        Returns:
            whether it was taken; a recording that has ended takes none.
        """
        moment = time.monotonic() if now is None else now
        with self._changed:
            if self._ended or self._closing:
                return False
            self._queue.append(Note(moment - self._began, kind, text))
            self._changed.notify()
            return True

    @property
    def state(self) -> Recording:
        """How the recording stands now."""
        with self._changed:
            left = max(self._free - _RESERVE, 0.0) / self._rate if self._rate > 0 else float("inf")
            within = next((step for step in _WARN if left < step), None)
            warning = "" if within is None or self._ended else f"The disk is full in less than {within} s: make room."
            return Recording(
                self._path, len(self._writer), self._frames_queued, self._lost, self._notes_lost,
                self._seconds(self._last_ns), self._writer.size, left, warning, self._ended,
            )  # fmt: skip

    def close(self) -> Recording:
        """Write what is queued and the file's index; return how the recording stands at its end."""
        with self._changed:
            self._closing = True
            self._changed.notify()
        self._thread.join()
        return self.state

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _seconds(self, time_ns: int) -> float:
        return (time_ns - self._first_ns) / 1e9

    def _write_all(self) -> None:
        began = looked = synced = time.monotonic()
        size = self._writer.size
        try:
            while (item := self._next()) is not None:
                self._write(item)
                now = time.monotonic()
                if now - looked > _LOOK_EVERY:
                    self._look_at_disk((self._writer.size - size) / (now - began))
                    looked = now
                if now - synced > _SYNC_EVERY:
                    self._writer.sync()
                    synced = now
            self._writer.close()
        except SessionError as error:
            self._end(str(error))
            self._give_up_queue()

    def _give_up_queue(self) -> None:
        """Count what can no longer be written, frames and notes each by themselves."""
        with self._changed:
            self._lost += self._frames_queued
            self._notes_lost += len(self._queue) - self._frames_queued
            self._queue.clear()
            self._frames_queued = 0

    def _next(self) -> Capture | Note | None:
        """Wait for what is to be written next, and leave it in the queue until it is; None at the end."""
        with self._changed:
            while not self._queue:
                if self._closing or self._ended:
                    return None
                self._changed.wait()
            return self._queue[0]

    def _written(self, item: Capture | Note) -> None:
        with self._changed:
            self._queue.popleft()
            self._frames_queued -= isinstance(item, Capture)

    def _write(self, item: Capture | Note) -> None:
        if isinstance(item, Note):
            self._writer.add_note(item)
            self._written(item)
            return
        self._writer.write_raw(item.time_ns - self._first_ns, item.raw, item.colour)
        self._written(item)
        self._last_ns = item.time_ns
        if self._acknowledge is not None:
            self._acknowledge(len(self._writer) - 1)

    def _look_at_disk(self, rate: float) -> None:
        self._free, self._rate = float(self._free_space(self._path.resolve().parent)), rate
        with self._changed:
            queued = sum(item.raw.nbytes for item in self._queue if isinstance(item, Capture))
        if self._free < _RESERVE + queued:
            self._end("The disk is nearly full: the recording was ended, what is recorded is safe.")

    def _end(self, why: str) -> None:
        """Take no more frames; what is queued is still written."""
        with self._changed:
            self._ended = why
            self._changed.notify()
