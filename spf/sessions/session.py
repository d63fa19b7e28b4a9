"""Session: a recording of depth frames, read by random access, whatever file format it is stored in."""

from __future__ import annotations

import hashlib
import json
import operator
from abc import ABC, abstractmethod
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from types import TracebackType
from typing import Any, Literal, NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from spf.frame import Camera, Frame, Truth
from spf.progress import Report, silent

__all__ = ["Note", "Session", "Side"]

Side = Literal["left", "right"]


class Note(NamedTuple):
    """Something said of an instant of a recording.

    Attributes:
        time: seconds since the session's first frame.
        kind: ``"marker"`` or ``"note"`` by a person, ``"event"`` by the program (a sensor lost, frames not recorded).
        text: what is said; may be empty for a marker.
    """

    time: float
    kind: str
    text: str


@dataclass(frozen=True, kw_only=True, eq=False)
class Session(ABC):
    """A depth recording: ``len(session)`` frames, ``session[i]`` at random and from several threads.

    A reader subclasses it and says how the raw depth, the colour and the truth of one frame are read.

    Attributes:
        uri: what it was opened with.
        name: short name for tables and titles.
        format: name of its format, as in the table of formats.
        camera: the camera of all its frames.
        times_ns: (N,) int64 nanoseconds since the first frame, increasing.
        depth_unit: metres per raw count; ``np.rint(frame.depth / depth_unit)`` is the raw uint16 image.
        side: the hand that it shows, None where the format does not say.
        joint_definition: whose joints its truth marks: ``"model"`` for the project's own, else the data set's name.
        has_truth: whether frames carry a truth.
        hand_shape: the exact hand shape of a synthetic session, ready for JSON, else None.
        start_time_ns: nanoseconds since 1970 (UTC) of the first frame, 0 where unknown.
        metadata: whatever else is known, as text (``sensor``, ``dataset``, …).
        contents: one line for everything that its file holds, for people (topics, tracks, arrays).
        notes: markers and notes made while it was recorded, by time.
        warnings: one sentence for everything that a user should know of how it was read.
    """

    uri: str
    name: str
    format: str
    camera: Camera
    times_ns: NDArray[np.int64]
    depth_unit: float = 0.001
    side: Side | None = None
    joint_definition: str = "model"
    has_truth: bool = False
    hand_shape: dict[str, Any] | None = None
    start_time_ns: int = 0
    metadata: Mapping[str, str] = field(default_factory=dict)
    contents: tuple[str, ...] = ()
    notes: tuple[Note, ...] = ()
    warnings: tuple[str, ...] = ()

    @abstractmethod
    def raw_depth(self, index: int) -> NDArray[np.uint16]:
        """Return the (H, W) raw depth counts of a frame, 0 where the sensor has no reading.

        Raises:
            SessionError: the frame cannot be read.
        """

    def colour(self, index: int) -> NDArray[np.uint8] | None:
        """Return the (H, W, 3) RGB image of a frame, registered to its depth, or None."""
        return None

    def truth(self, index: int) -> Truth | None:
        """Return the ground truth of a frame, or None."""
        return None

    @cached_property
    def times(self) -> NDArray[np.float64]:
        """(N,) seconds since the first frame."""
        return self.times_ns / 1e9

    def __len__(self) -> int:
        return len(self.times_ns)

    def __getitem__(self, index: int) -> Frame:
        """Return one frame; a negative index counts from the end.

        Raises:
            IndexError: there is no such frame.
            SessionError: the frame cannot be read.
        """
        position = operator.index(index)
        if not -len(self) <= position < len(self):
            raise IndexError(f"Frame {position} is outside the {len(self)} frames of {self.name}.")
        position %= len(self)
        return Frame(
            index=position,
            time=float(self.times[position]),
            depth=self.raw_depth(position) * np.float32(self.depth_unit),
            camera=self.camera,
            colour=self.colour(position),
            truth=self.truth(position),
        )

    def __iter__(self) -> Iterator[Frame]:
        return (self[index] for index in range(len(self)))

    def fingerprint(self, report: Report = silent) -> str:
        """Return the SHA-256 of camera, depth unit, times and all raw depth: equal for equal recordings in any format.

        Args:
            report: is told how far reading all the depth is, the first time.

        Raises:
            SessionError: a frame cannot be read.
        """
        if not self._fingerprint:
            digest = hashlib.sha256(json.dumps([*self.camera, self.depth_unit]).encode())
            digest.update(self.times_ns.astype("<i8").tobytes())
            for index in range(len(self)):
                digest.update(self.raw_depth(index).astype("<u2").tobytes())
                report("Reading the whole recording", (index + 1) / len(self))
            self._fingerprint.append(digest.hexdigest())
        return self._fingerprint[0]

    @cached_property
    def _fingerprint(self) -> list[str]:
        """Holds the fingerprint once it was asked for."""
        return []

    def close(self) -> None:  # noqa: B027 - only live sources hold something to give back
        """Give back what the session holds (files are opened for each read, so nothing by default)."""

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()
