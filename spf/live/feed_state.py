"""What a feed says: the captures that it took, and how it stands."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from spf.frame import Frame
from spf.live.source import About, Capture

__all__ = ["CONNECTING", "FeedState", "Taken"]

CONNECTING = "Connecting."  # the message before anything is known


class Taken(NamedTuple):
    """A capture that the feed took.

    Attributes:
        index: how many were taken before it.
        capture: with its time stamp in ns since the first one.
        about: the sensor.
        recorded: its index in the recording; None while none is made.
    """

    index: int  # type: ignore[assignment]  # a tuple's method of that name is not missed
    capture: Capture
    about: About
    recorded: int | None

    def frame(self) -> Frame:
        """Return it in metres; if it is recorded, with the index that it has there, and the same depth bit by bit."""
        depth = self.capture.raw * np.float32(self.about.depth_unit)
        index = self.index if self.recorded is None else self.recorded
        return Frame(index, self.capture.time_ns / 1e9, depth, self.about.camera, self.capture.colour)


class FeedState(NamedTuple):
    """How a feed stands.

    Attributes:
        about: the sensor; None until it was open once.
        connected: whether it is open now.
        message: why it is not, or what a user should know; "" when all is well.
        taken: captures until now.
        missing: gaps in the sensor's count: frames lost before they came here.
        repeated: captures that were left out because their time was not later than the last one's.
        rate: captures per second, lately.
        reconnected: how often the sensor came back.
        ended: whether no more will come.
        failed: whether it ended by a fault of the sensor, which ``message`` names.
    """

    about: About | None
    connected: bool
    message: str
    taken: int
    missing: int
    repeated: int
    rate: float
    reconnected: int
    ended: bool
    failed: bool
