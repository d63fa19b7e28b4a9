"""Write the native session format, so that every frame written survives whatever happens to the program."""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path
from types import TracebackType
from typing import Any, Self

import numpy as np
from mcap.writer import Writer
from numpy.typing import NDArray

from spf.errors import SessionError
from spf.frame import JOINT_NAMES, Camera, Frame, Truth
from spf.sessions.mcap_messages import (
    CAMERA_TOPIC,
    COLOUR_TOPIC,
    DEPTH_TOPIC,
    FREE_RECORD,
    JOINTS_TOPIC,
    MESSAGE_TYPES,
    NOTES_TOPIC,
    ORIENTATION_TOPIC,
    POSE_TOPIC,
    SESSION_RECORD,
    Description,
    definition,
    encode_array,
    encode_camera,
    encode_image,
    encode_joints,
    encode_note,
)
from spf.sessions.session import Note, Side

__all__ = ["MCAPWriter", "UnwritableError", "already_there"]

_CAMERA_EVERY_NS = 1_000_000_000


class UnwritableError(SessionError):
    """A file cannot be made or written to.

    Args:
        path: the file.
        error: what the system says.
        kept: what is in the file all the same, as a sentence.
    """

    def __init__(self, path: Path, error: OSError, kept: str = "") -> None:
        super().__init__(f"{path} cannot be written: {error.strerror}. {kept}".rstrip())
        self.cause = error


class MCAPWriter:
    """Writes frames into a session file, in place: each one is in the file when :meth:`write` returns.

    A program that is killed leaves a file that opens with all frames written so far.

    Args:
        path: the file to write.
        camera: the camera of all frames.
        depth_unit: metres per count of the uint16 images that depth is stored as.
        side: the hand shown, if known.
        joint_definition: whose joints the truth marks, ``"model"`` for the project's own.
        hand_shape: the exact hand shape of a synthetic session, ready for JSON.
        start_time_ns: nanoseconds since 1970 (UTC) of the frames' time 0, 0 if unknown.
        metadata: whatever else is known, as text; ``sensor`` is the name of the sensor.
        overwrite: replace a file that is there.

    Raises:
        SessionError: the file exists or cannot be made.
    """

    def __init__(
        self,
        path: str | Path,
        *,
        camera: Camera,
        depth_unit: float = 0.001,
        side: Side | None = None,
        joint_definition: str = "model",
        hand_shape: dict[str, Any] | None = None,
        start_time_ns: int = 0,
        metadata: Mapping[str, str] | None = None,
        overwrite: bool = False,
    ) -> None:
        self.path = Path(path)
        self.camera = camera
        self.depth_unit = depth_unit
        self._start = start_time_ns
        self._count = 0
        self._last: int | None = None
        self._last_note = -1
        self._ended = False
        self._last_camera: int | None = None
        self._channels: dict[str, int] = {}
        free = dict(metadata or {})
        description = Description(depth_unit, side, joint_definition, hand_shape, start_time_ns, camera.model)
        record = description.to_record(free)
        self._file = _create(self.path, overwrite)
        self._whole = 0
        # A chunk is closed when it is larger than this: one chunk a message.
        self._mcap = Writer(self._file, chunk_size=1)
        with self._whole_records():
            self._mcap.start(profile="ros2")
            self._mcap.add_metadata(SESSION_RECORD, record)
            self._mcap.add_metadata(FREE_RECORD, free)

    def write(self, frame: Frame) -> None:
        """Append a frame; its depth is rounded to whole counts, its index is not stored.

        Raises:
            SessionError: its time is not after the last one's, its camera is another, its depth does not fit into
                uint16 counts, or the disk is full.
        """
        if frame.camera != self.camera or frame.depth.shape != (self.camera.height, self.camera.width):
            raise SessionError(f"Frame {self._count} was taken by another camera than the session {self.path.name}.")
        if frame.truth is not None and frame.truth.joints.shape != (len(JOINT_NAMES), 3):
            raise SessionError(f"The truth of frame {self._count} has {len(frame.truth.joints)} joints, not 21.")
        self._append(round(frame.time * 1e9), self._counts(frame), frame.colour, frame.truth)

    def write_raw(self, time_ns: int, raw: NDArray[np.uint16], colour: NDArray[np.uint8] | None = None) -> None:
        """Append a frame as a sensor delivers it.

        Args:
            time_ns: nanoseconds since ``start_time_ns``, later than the last frame's.
            raw: (H, W) depth counts, 0 where there is no reading.
            colour: (H, W, 3) RGB, registered to the depth.

        Raises:
            SessionError: its time is not after the last one's, its size is another, or the disk is full.
        """
        if raw.shape != (self.camera.height, self.camera.width):
            raise SessionError(f"Frame {self._count} has another size than the session {self.path.name}.")
        self._append(time_ns, raw, colour, None)

    def add_note(self, note: Note) -> None:
        """Append a marker, a note or an event; its time counts from ``start_time_ns``, like that of frames.

        Raises:
            SessionError: the disk is full.
        """
        stamp = max(self._start + round(note.time * 1e9), self._last_note + 1, 0)
        with self._whole_records():
            self._add(NOTES_TOPIC, stamp, encode_note(note.kind, note.text, stamp))
        self._last_note = stamp

    def sync(self) -> None:
        """Have the system put what was written onto the disk, where it outlives a power cut.

        Raises:
            SessionError: the disk is full or gone.
        """
        try:
            os.fsync(self._file.fileno())
        except OSError as error:
            self._abandon()
            raise self._unwritable(error) from error

    def _append(
        self, time_ns: int, raw: NDArray[np.uint16], colour: NDArray[np.uint8] | None, truth: Truth | None
    ) -> None:
        stamp = self._start + time_ns
        if stamp < 0 or (self._last is not None and stamp <= self._last):
            raise SessionError(f"Frame {self._count} at {time_ns / 1e9} s is not later than the one before it.")
        with self._whole_records():
            if self._last_camera is None or stamp - self._last_camera >= _CAMERA_EVERY_NS:
                self._add(CAMERA_TOPIC, stamp, encode_camera(self.camera, stamp))
                self._last_camera = stamp
            if colour is not None:
                self._add(COLOUR_TOPIC, stamp, encode_image(colour, stamp))
            if truth is not None:
                self._add(JOINTS_TOPIC, stamp, encode_joints(truth.joints, stamp))
                if truth.pose is not None:
                    self._add(POSE_TOPIC, stamp, encode_array(truth.pose))
                if truth.orientation is not None:
                    self._add(ORIENTATION_TOPIC, stamp, encode_array(truth.orientation))
            # Last, so that a frame that has its depth has everything.
            self._add(DEPTH_TOPIC, stamp, encode_image(raw, stamp))
        self._last = stamp
        self._count += 1

    @contextmanager
    def _whole_records(self) -> Iterator[None]:
        """Put what is written inside into the file; when that fails, cut the file where it was whole, and end it there."""
        try:
            yield
            self._file.flush()
            self._whole = self._file.tell()
        except OSError as error:
            self._abandon()
            raise self._unwritable(error) from error

    def _abandon(self) -> None:
        """Close the file without its index, at its last whole frame: what is there opens with all frames written."""
        self._ended = True
        with suppress(OSError):  # the buffer that could not be written is tried once more when the file is closed
            self._file.close()
        if self.path.is_file():  # no device
            os.truncate(self.path, self._whole)

    def _unwritable(self, error: OSError) -> UnwritableError:
        return UnwritableError(self.path, error, "What was recorded before is safe in it.")

    def close(self) -> None:
        """Write the index and close the file.

        Raises:
            SessionError: the disk is full.
        """
        if self._ended:
            return
        self._ended = True
        try:
            with self._file:
                self._mcap.finish()
        except OSError as error:
            self._abandon()
            raise self._unwritable(error) from error

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def __len__(self) -> int:
        """Return the number of frames written."""
        return self._count

    @property
    def size(self) -> int:
        """Bytes in the file until the last whole frame."""
        return self._whole

    def _counts(self, frame: Frame) -> NDArray[np.uint16]:
        counts = np.rint(frame.depth / self.depth_unit)
        if not (counts.min() >= 0 and counts.max() <= 65535):
            raise SessionError(
                f"The depth of frame {self._count} does not fit into 0 to 65535 counts of {self.depth_unit:g} m: "
                "give another depth_unit, and 0 where there is no reading."
            )
        return counts.astype(np.uint16)

    def _add(self, topic: str, stamp: int, data: bytes) -> None:
        if topic not in self._channels:
            kind = MESSAGE_TYPES[topic]
            schema = self._mcap.register_schema(kind, "ros2msg", definition(kind))
            self._channels[topic] = self._mcap.register_channel(topic, "cdr", schema)
        self._mcap.add_message(self._channels[topic], stamp, data, stamp, self._count)


def already_there(path: Path) -> SessionError:
    """Return the error of a file that may not be replaced."""
    return SessionError(f"{path} is already there: give another name, or allow it to be overwritten.")


def _create(path: Path, overwrite: bool) -> Any:
    try:
        return path.open("wb" if overwrite else "xb")
    except FileExistsError as error:
        raise already_there(path) from error
    except OSError as error:
        raise UnwritableError(path, error) from error
