"""The frames that a report shows: the first, the worst, each loss, and some in between; and their pictures."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from spf.export.pictures import GIVEN_UP, VIEWS, encoded, hand_scene, hand_view, row_skeletons
from spf.frame import Frame
from spf.hand.model import Hand
from spf.lens import seen_through
from spf.locate import reach_of
from spf.observation import observe
from spf.progress import Report
from spf.render import Renderer, Skeleton, box_around, depth_picture
from spf.runs import Run
from spf.sessions import Session
from spf.trackfile import Track

__all__ = ["MOST_LOSSES", "KeyFrame", "Shot", "key_frames", "shots"]

Array = NDArray[np.float64]
MOST_LOSSES = 4  # that are shown with pictures
_EVENLY = 6
_SIZE = (560, 420)
_SIDES = ("sensor", "oblique")


class KeyFrame(NamedTuple):
    """A row of the track and why it is shown."""

    row: int
    why: str


class Shot(NamedTuple):
    """The pictures of a key frame, JPEG files; ``renders`` is empty where this machine cannot draw."""

    key: KeyFrame
    depth: bytes
    renders: tuple[bytes, ...]


def key_frames(track: Track, badness: Array) -> list[KeyFrame]:
    """Return the frames to be shown, in their order.

    Args:
        track: of the run, at least one frame.
        badness: (N,) how bad each frame is; NaN where nothing is known.
    """
    held = np.flatnonzero(~track.lost)
    reasons: dict[int, list[str]] = {}
    if len(held):
        reasons.setdefault(int(held[0]), []).append("first")
        known = held[np.isfinite(badness[held])]
        if len(known):
            reasons.setdefault(int(known[np.argmax(badness[known])]), []).append("worst")
    for number, (begin, end) in enumerate(_losses(track.lost)[:MOST_LOSSES], 1):
        reasons.setdefault(begin, []).append(f"loss {number}: given up")
        if end < len(track):
            reasons.setdefault(end, []).append(f"loss {number}: found again")
    for row in np.linspace(0, len(held) - 1, min(_EVENLY, len(held))).round().astype(int):
        reasons.setdefault(int(held[row]), [])
    return [KeyFrame(row, ", ".join(reasons[row])) for row in sorted(reasons)]


def _losses(lost: NDArray[np.bool_]) -> list[tuple[int, int]]:
    """First row of each loss and of what follows it; the frames before the hand was first found are none."""
    edges = np.diff(np.concatenate([[0], lost.astype(np.int8), [0]]))
    pairs = zip(np.flatnonzero(edges == 1).tolist(), np.flatnonzero(edges == -1).tolist(), strict=True)
    return [(begin, end) for begin, end in pairs if begin > 0]


def shots(
    run: Run, session: Session, keys: list[KeyFrame], renderer: Renderer | None, progress: Report | None = None
) -> Iterator[Shot]:
    """Draw key frames, lazily.

    Args:
        run: track and hand.
        session: that was tracked.
        keys: from :func:`key_frames`.
        renderer: draws the hand; None leaves its pictures out.
        progress: called with what is being done and the share done.

    Raises:
        SessionError: a frame cannot be read.
        RenderError: a picture could not be drawn.
    """
    track, lens = run.track, run.plan.start.shape.lens
    for done, key in enumerate(keys, 1):
        frame, hand = session[int(track.frame[key.row])], run.hand_at(key.row)
        renders: tuple[bytes, ...] = ()
        if renderer is not None:
            scene = hand_scene(hand, track, key.row, frame, lens)
            views = [hand_view(track, key.row, VIEWS[side]) for side in _SIDES]
            renders = tuple(renderer.jpeg(scene, view, _SIZE, quality=85, smooth=True) for view in views)
        yield Shot(key, _depth(hand, track, key.row, frame, lens), renders)
        if progress is not None:
            progress("Drawing the key frames", done / len(keys))


def _depth(hand: Hand, track: Track, row: int, frame: Frame, lens: float) -> bytes:
    skeletons = row_skeletons(track, row, frame)
    if track.lost[row] and np.isfinite(track.golden[row]):  # a pose was found and not believed
        skeletons.append(Skeleton(track.joints[row], GIVEN_UP))
    box = box_around(frame.camera, np.stack([skeleton.joints for skeleton in skeletons])) if skeletons else None
    picture = depth_picture(
        frame, _region(hand, track, row, seen_through(frame, lens)), skeletons, box=box, width=_SIZE[0]
    )
    return encoded(picture, ".jpg")


def _region(hand: Hand, track: Track, row: int, frame: Frame) -> NDArray[np.bool_] | None:
    """What is taken for the hand where it was found; None while it is lost."""
    if track.lost[row]:
        return None
    seen = observe(frame, track.poses[row, :3], reach_of(hand))
    region = np.zeros(frame.depth.shape, bool)
    height, width = seen.depth.shape
    region[seen.top : seen.top + height, seen.left : seen.left + width] = seen.depth > 0
    return region
