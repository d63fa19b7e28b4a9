"""What every live sensor is: opened, it says what it is and gives captures until it is closed, ends or is lost."""

from __future__ import annotations

import time
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator, Mapping
from typing import ClassVar, NamedTuple

import numpy as np
from numpy.typing import NDArray

from spf.frame import Camera
from spf.sessions import Side

__all__ = ["About", "Capture", "HostClock", "LiveSource"]


class About(NamedTuple):
    """What a sensor says of itself once it is open.

    Attributes:
        sensor: its name, for people and for the recording.
        camera: that takes the depth.
        depth_unit: metres per raw count.
        rate: frames per second that it was asked for; 0 where it does not say.
        side: the hand that it shows, where that is known.
        metadata: whatever else belongs into a recording, as text.
        warnings: sentences that a user should read.
    """

    sensor: str
    camera: Camera
    depth_unit: float
    rate: float = 0.0
    side: Side | None = None
    metadata: Mapping[str, str] = {}
    warnings: tuple[str, ...] = ()


class Capture(NamedTuple):
    """One depth image, as the sensor delivers it.

    Attributes:
        number: the sensor's own count; a gap is frames that were lost before they came here.
        time_ns: the sensor's time stamp, ns; its zero is the sensor's own.
        captured: the same instant on this computer's ``time.monotonic()``, s.
        raw: (H, W) uint16 counts, 0 where there is no reading; nobody writes into it any more.
        colour: (H, W, 3) uint8 RGB registered to the depth, or None.
    """

    number: int
    time_ns: int
    captured: float
    raw: NDArray[np.uint16]
    colour: NDArray[np.uint8] | None = None


class LiveSource(ABC):
    """A sensor, or what stands for one. One thread uses it; after :meth:`close` it can be opened again.

    Attributes:
        warm_up: seconds within which one that is there gives its first frame; inf where it always gives one or says why not.
        remedy: what a user does when no frame comes, as the middle of a sentence.
    """

    warm_up: ClassVar[float] = 5.0
    remedy: ClassVar[str] = "unplug the sensor and plug it in again"

    @abstractmethod
    def open(self, stopped: Callable[[], bool] = lambda: False) -> About:
        """Connect to the sensor and start it.

        Args:
            stopped: asked while it waits for something that may never come; True ends that soon, as if it were missing.

        Raises:
            SensorError: it is missing, busy, not permitted or cannot do what is asked; one sentence that says what to do.
        """

    @abstractmethod
    def captures(self) -> Iterator[Capture | None]:
        """Yield captures as they come, None when a while passed without one; ends when the source has no more.

        Raises:
            SensorError: the sensor is lost.
        """

    @abstractmethod
    def close(self) -> None:
        """Stop the sensor and give it back; nothing if it is not open."""


class HostClock:
    """Maps a sensor's time stamps to this computer's monotonic clock, where they have no common zero.

    The offset is the smallest difference between arrival and stamp that was seen, so that the shortest transport counts as
    none; it is let grow by 100 ppm, which is more than two crystals drift apart.
    """

    def __init__(self) -> None:
        self._offset: float | None = None
        self._seen = 0.0

    def captured(self, time_ns: int, arrived: float | None = None) -> float:
        """Return when a frame of the given stamp was captured, s of ``time.monotonic()``, given when it arrived (now)."""
        arrived = time.monotonic() if arrived is None else arrived
        offset = arrived - time_ns / 1e9
        if self._offset is None:
            self._offset = offset
        else:
            self._offset = min(offset, self._offset + 1e-4 * (arrived - self._seen))
        self._seen = arrived
        return time_ns / 1e9 + self._offset
