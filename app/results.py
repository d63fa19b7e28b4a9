"""What a run has tracked so far: a summary of every frame for the plots, and everything of the last few hundred."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from app.budget import SHARED, Budget
from spf.frame import Camera, Frame
from spf.hand.model import Hand
from spf.lens import seen_through
from spf.locate import reach_of
from spf.observation import Observation, observe
from spf.optimisers.trajectory import Trajectory
from spf.progress import Report
from spf.sessions import Session
from spf.settings import Settings
from spf.track import TrackedFrame, Tracking, TrackState, reshaped
from spf.trackfile import TrackRow, row_of

__all__ = ["Entry", "Results", "Seen", "Summary", "entry_of", "joint_error", "same_rules", "seen_again"]

KEYFRAME = 10  # every so many frames, the state is kept for good


class Entry(NamedTuple):
    """Everything of one tracked frame.

    Attributes:
        result: of the frame, without its observation.
        state: after it, to track on from here.
        tracking: what it was tracked with; the hand is the start's.
        seen: what was taken for the hand; None while nothing was.
        before: the state that the frame was tracked from, to track it once more.
    """

    result: TrackedFrame
    state: TrackState
    tracking: Tracking
    seen: Seen | None
    before: TrackState

    @property
    def shaped(self) -> Tracking:
        """What the frame was tracked with, with the hand in the shape that it had by then."""
        return reshaped(self.tracking, self.result.shape_change)

    @property
    def hand(self) -> Hand:
        """The hand in that shape."""
        return self.shaped.hand


class Seen(NamedTuple):
    """What views show of an observation: a small part of it.

    Attributes:
        top, left: corner of the mask in the depth image.
        camera: of the part of the image under the mask.
        packed: the mask, a bit a pixel.
        depths: (M,) m, of the pixels under the mask.
    """

    top: int
    left: int
    camera: Camera
    packed: NDArray[np.uint8]
    depths: NDArray[np.float32]

    @property
    def mask(self) -> NDArray[np.bool_]:
        """The pixels (h, w) that were taken for the hand."""
        height, width = self.camera.height, self.camera.width
        return np.unpackbits(self.packed, count=height * width).reshape(height, width).astype(bool)

    @property
    def points(self) -> NDArray[np.float32]:
        """The hand's observed points (M, 3), m."""
        v, u = np.nonzero(self.mask)
        return self.camera.back_project(u, v, self.depths).astype(np.float32)


class Summary(NamedTuple):
    """What the plots over frames show of one.

    Attributes:
        frame: its index.
        joints: (21, 3) m.
        lost: whether the hand is lost.
        recovered: whether it was found again in this frame.
        ess: effective sample size, nan while lost.
        optimised_share: weight of the optimised samples, nan while lost.
        resampled: whether the particles were resampled; False where that is not known, in a run from disk.
        winner: proposal of the heaviest particle; "" while lost.
        golden, overlap: how well the render explains the depth, nan while lost.
        error: mean distance of the joints from the truth, m; nan where there is no truth.
        seconds: spent on the frame.
        shape_change: (9,) of the hand, from the start's: see :func:`spf.hand.shape.varied`.
        tracking: what it was tracked with.
    """

    frame: int
    joints: NDArray[np.float64]
    lost: bool
    recovered: bool
    ess: float
    optimised_share: float
    resampled: bool
    winner: str
    golden: float
    overlap: float
    error: float
    seconds: float
    shape_change: NDArray[np.float64]
    tracking: Tracking


class Results:
    """The frames tracked in one run, consecutive from its first; oldest entries are forgotten before memory grows."""

    def __init__(self, budget: Budget = SHARED) -> None:
        self._budget = budget
        self._entries: dict[int, Entry] = {}
        self._sizes: dict[int, int] = {}
        self._summaries: dict[int, Summary] = {}
        self._rows: dict[int, TrackRow] = {}
        self._states: dict[int, TrackState] = {}

    @classmethod
    def reopened(
        cls, rows: Sequence[TrackRow], states: Mapping[int, TrackState], tracking: Callable[[int], Tracking],
        session: Session, report: Report,
    ) -> Results:  # fmt: skip
        """Return what was read from disk: everything but the particles, which are tracked again from the nearest state."""
        results = cls()
        for done, row in enumerate(rows, 1):
            index = row.result.index
            results._rows[index] = row
            results._summaries[index] = _summary_of(row, session[index], tracking(index), resampled=False)
            report("Opening the run", done / len(rows))
        results._states = dict(states)
        return results

    def add(self, entry: Entry, frame: Frame) -> None:
        """Store a frame; whatever was tracked after it no longer follows from it and is dropped."""
        index = entry.result.index
        self.cut(index)
        row, info = row_of(entry.result), entry.result.info
        self._rows[index] = row
        if index % KEYFRAME == 0:
            self._states[index] = entry.state
        self._summaries[index] = _summary_of(row, frame, entry.tracking, resampled=info is not None and info.resampled)
        self.recall(entry)

    def recall(self, entry: Entry) -> None:
        """Have everything of a tracked frame in memory (again)."""
        index = entry.result.index
        self._entries.pop(index, None)
        self._entries[index] = entry
        self._sizes[index] = _bytes(entry)
        self._budget.keep_within(self)

    @property
    def kept_bytes(self) -> int:
        """Bytes of what is kept of frames for the views."""
        return sum(self._sizes.values())

    def forget_oldest(self) -> bool:
        """Forget what is kept of a frame for the views, its summary and row excepted; not of the only one that there is."""
        if len(self._entries) < 2:
            return False
        oldest = next(iter(self._entries))
        del self._entries[oldest], self._sizes[oldest]
        return True

    def remeasure(self, frame: Frame) -> None:
        """Compare a tracked frame with its truth anew: somebody has marked joints in it."""
        summary = self._summaries.get(frame.index)
        if summary is not None:
            self._summaries[frame.index] = summary._replace(error=joint_error(summary.joints, frame))

    def cut(self, index: int) -> None:
        """Drop a frame and all after it: they no longer follow from what comes before."""
        parts: tuple[dict[int, Any], ...] = (self._summaries, self._rows, self._states, self._entries, self._sizes)
        for part in parts:
            for later in [i for i in part if i >= index]:
                del part[later]

    def copy(self) -> Results:
        """Return results that grow apart from these from now on."""
        other = Results(self._budget)
        other._summaries, other._rows, other._states = dict(self._summaries), dict(self._rows), dict(self._states)
        other._entries, other._sizes = dict(self._entries), dict(self._sizes)
        return other

    @property
    def rows(self) -> list[TrackRow]:
        """What a track keeps of the frames, in their order."""
        return list(self._rows.values())

    @property
    def states(self) -> dict[int, TrackState]:
        """Frame → state after it, of every tenth frame and the last one that is in memory: what is kept on disk."""
        ends = [i for i in (self.last,) if i in self._entries]
        return {**self._states, **{i: self._entries[i].state for i in ends if i is not None}}

    def state(self, index: int) -> TrackState | None:
        """Return the state after a frame, if it is in memory."""
        entry = self._entries.get(index)
        return entry.state if entry is not None else self._states.get(index)

    def entry(self, index: int) -> Entry | None:
        """Return everything of a frame, or None when it was not tracked or is no longer in memory."""
        return self._entries.get(index)

    def summary(self, index: int) -> Summary | None:
        """Return a frame's summary, or None when it was not tracked."""
        return self._summaries.get(index)

    @property
    def summaries(self) -> list[Summary]:
        """Of all frames tracked, in their order."""
        return list(self._summaries.values())

    @property
    def last(self) -> int | None:
        """Index of the last frame tracked."""
        return next(reversed(self._summaries), None)

    def lost_since(self, index: int) -> int | None:
        """Return the frame since which the hand is lost in a frame, or None when it is not."""
        if index not in self._summaries or not self._summaries[index].lost:
            return None
        while index - 1 in self._summaries and self._summaries[index - 1].lost:
            index -= 1
        return index


def joint_error(joints: NDArray[np.float64], frame: Frame) -> float:
    """Return the mean distance in metres of joints (21, 3) from a frame's truth; nan where it has none."""
    if frame.truth is None:
        return float("nan")
    distances = np.linalg.norm(joints - frame.truth.joints, axis=1)
    known = distances[np.isfinite(distances)]
    return float(known.mean()) if len(known) else float("nan")


def _summary_of(row: TrackRow, frame: Frame, tracking: Tracking, *, resampled: bool) -> Summary:
    result = row.result
    return Summary(
        result.index, result.joints, result.lost, result.recovered, result.ess, row.optimised_share, resampled,
        row.winner, result.golden, result.overlap, joint_error(result.joints, frame), result.seconds,
        result.shape_change, tracking,
    )  # fmt: skip


def entry_of(result: TrackedFrame, state: TrackState, tracking: Tracking, before: TrackState) -> Entry:
    """Return what is kept of a frame: trajectories in single precision, and what views show of the depth."""
    info, observation = result.info, result.observation
    if info is not None:
        info = info._replace(trajectories=tuple(_light(trace) for trace in info.trajectories))
    seen = None
    if observation is not None:
        mask = observation.depth > 0
        depths = observation.depth[mask]
        seen = Seen(observation.top, observation.left, observation.camera, np.packbits(mask), depths)
    return Entry(result._replace(info=info, observation=None), state, tracking, seen, before)


def seen_again(entry: Entry, frame: Frame) -> Observation:
    """Return what was looked at in a tracked frame."""
    how, place = entry.shaped, entry.result.place
    assert place is not None
    return observe(seen_through(frame, how.start.shape.lens), place, reach_of(how.hand))


def _light(trace: Trajectory) -> Trajectory:
    return Trajectory(*(part.astype(np.float32) for part in trace))


def same_rules(tracking: Tracking, tracker: str, settings: Settings) -> bool:
    """Tell whether a frame was tracked by a tracker with these settings."""
    return tracking.tracker == tracker and tracking.settings == settings


def _bytes(value: object) -> int:
    """Bytes of all arrays within nested tuples."""
    if isinstance(value, np.ndarray):
        return value.nbytes
    if isinstance(value, Entry):  # `tracking` is shared by all frames
        return _bytes(tuple(value.result)) + _bytes(tuple(value.state)) + _bytes(value.seen)
    if isinstance(value, tuple):
        return sum(_bytes(part) for part in value)
    return 0
