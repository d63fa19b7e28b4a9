"""Live tracking: the first pose from live frames, then always the newest frame; what was not come to is dropped and counted.

The automatic start takes seconds, in which the hand has moved on: what it finds (side, shape, a pose) is where the search in
the present begins, like that for a hand that was lost. From then on it is :func:`spf.track.track_frame`, as offline.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from typing import NamedTuple

import numpy as np

from spf.errors import StartError
from spf.frame import Frame
from spf.hand import HandShape
from spf.initialise import Start, find_start
from spf.live.feed import Feed
from spf.live.feed_state import Taken
from spf.manifest import Plan
from spf.progress import Report
from spf.runs import begin_late
from spf.segmentation import find_regions
from spf.sessions import Side
from spf.settings import Settings
from spf.track import TrackedFrame, track_frame

__all__ = ["LiveFrame", "Request", "find_live_start", "follow"]

_LOOKED_AT = 64  # frames that a start is found from: two seconds
_LOOKED_AT_OF_KNOWN = 32  # … when the shape of the hand is known
_WAIT = 0.2  # s after which a wait looks whether to stop
NO_HAND = "No hand is seen yet: hold an open hand before the camera, half a metre away."


class Request(NamedTuple):
    """How a live source is to be tracked.

    Attributes:
        tracker: name in the table of trackers.
        preset: that the settings were made from, for people.
        settings: of the tracker.
        seed: of all randomness.
        shape: of the hand, None to find it.
        side: of the hand, None to find it.
    """

    tracker: str
    preset: str
    settings: Settings
    seed: int = 0
    shape: HandShape | None = None
    side: Side | None = None

    def plan(self, start: Start, first: int, last: int) -> Plan:
        """Return the plan of a run that began with a start and tracked some of the frames ``[first, last)``."""
        return Plan(self.tracker, self.preset, self.settings, self.seed, "auto", first, last, start)


class LiveFrame(NamedTuple):
    """A tracked live frame.

    Attributes:
        taken: the capture.
        frame: the same in metres.
        result: what was found in it.
        latency: seconds from its capture to its estimate.
        dropped: captures since the last tracked one that were not tracked.
    """

    taken: Taken
    frame: Frame
    result: TrackedFrame
    latency: float
    dropped: int


def find_live_start(
    feed: Feed, request: Request, progress: Report, stop: Callable[[], bool] = lambda: False
) -> Start | None:
    """Find the first pose from what a feed shows now, again and again until one is believed.

    Args:
        feed: that was started.
        request: how it is to be tracked.
        progress: called with what is being done and the share done.
        stop: asked between two attempts.

    Returns:
        the start, its frame an index of :meth:`Taken.frame`; None when the feed ended or ``stop`` said so.
    """
    about = feed.about()
    side = request.side or about.side
    rng = np.random.default_rng([request.seed, 1])
    progress("Waiting for frames", 0.0)
    after = -1
    while (frames := _collect(feed, after, request.shape is not None, stop)) is not None:
        after = feed.state.taken - 1
        if not any(find_regions(frame) for frame in frames[:: len(frames) // 4]):
            progress(NO_HAND, 0.0)
            continue
        try:
            start = find_start(frames, rng, side=side, shape=request.shape, progress=progress)
        except StartError:
            progress(NO_HAND, 0.0)
            continue
        if start.doubted != "pose":
            return start._replace(frame=frames[start.frame].index)
        progress(f"{start.doubt} Looking again: hold an open hand before the camera.", 0.0)
    return None


def _collect(feed: Feed, after: int, known: bool, stop: Callable[[], bool]) -> list[Frame] | None:
    """Gather the frames that come next; None when there are no more."""
    frames: list[Frame] = []
    while len(frames) < (_LOOKED_AT_OF_KNOWN if known else _LOOKED_AT):
        taken = feed.newest(after, _WAIT)
        if stop() or (taken is None and feed.state.ended):
            return None
        if taken is not None:
            after = taken.index
            frames.append(taken.frame())
    return frames


def follow(feed: Feed, request: Request, start: Start, stop: Callable[[], bool] = lambda: False) -> Iterator[LiveFrame]:
    """Track the newest frame of a feed, again and again, until it ends or ``stop`` says so.

    Frames that should be recorded and could not be are left out, so that the run can be repeated from the recording.
    """
    recorded = feed.recording is not None
    state = tracking = None
    after = feed.state.taken - 2  # the newest there is
    while not stop():
        taken = feed.newest(after, _WAIT)
        if taken is None:
            if feed.state.ended:
                return
            continue
        dropped, after = (taken.index - after - 1 if tracking else 0), taken.index
        if recorded and taken.recorded is None:
            continue
        frame = taken.frame()
        if tracking is None or state is None:
            tracking, state = begin_late(request.plan(start, 0, 0), frame.index, frame.time)
        state, result = track_frame(tracking, state, frame)
        yield LiveFrame(taken, frame, result, time.monotonic() - taken.capture.captured, dropped)
