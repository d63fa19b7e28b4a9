"""Track one session from an automatic start, with each number of particles, and note everything that the table needs."""

from __future__ import annotations

import time
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from benchmarks.holds.labels import as_labelled, hand_of_labels, true_side
from benchmarks.holds.sessions import KINDS, Source, open_source
from spf.evaluate import agreement_with_depth
from spf.evaluate.contradictions import CONTRADICTED, label_energy
from spf.evaluate.floor import floor_of
from spf.hand.kinematics import joints_of, pose_hand
from spf.initialise import Start, find_start
from spf.joint_definitions import nearest_joints, offset_axes
from spf.lens import as_seen, as_stated, seen_through
from spf.prepare import SessionFrames, prepare
from spf.sessions import Session
from spf.synthetic import SyntheticSession
from spf.track import begin, reshaped, track_frame
from spf.trackers import TRACKERS, make_settings

__all__ = ["Asked", "held"]

Array = NDArray[np.float64]


class Asked(NamedTuple):
    """What to track with.

    Attributes:
        tracker, preset: by name.
        counts: numbers of particles.
        changes: of its settings, name → text.
        init: "auto" or "truth".
    """

    tracker: str
    preset: str
    counts: tuple[int, ...]
    changes: dict[str, str]
    init: str


def held(source: Source, asked: Asked) -> list[dict[str, Any]]:
    """Start, track with each number of particles, and measure, ready for JSON; one result a number of particles.

    Nothing is told to the start but the frames: neither the size of the hand nor, but for kinds that say so, its side.

    Raises:
        SpfError: no start was found, or a frame cannot be read.
    """
    session = open_source(source)
    frames = SessionFrames(session, 0, min(source.frames, len(session)))
    began = time.perf_counter()
    if asked.init == "auto":
        told = source.synthetic and KINDS[source.kind].told
        start = find_start(frames, np.random.default_rng([source.seed, 1]), side=true_side(session) if told else None)
    else:
        start = prepare(session, init=asked.init, seed=source.seed, last=len(frames))
    shared = {
        "kind": source.kind, "number": source.number, "seed": source.seed, "session": session.name,
        **_start_part(session, start), "start_seconds": time.perf_counter() - began,
    }  # fmt: skip
    shared |= _floor_part(session, frames, start)
    return [shared | {"n": count} | _tracked(session, frames, start, asked, count, source) for count in asked.counts]


def _start_part(session: Session, start: Start) -> dict[str, Any]:
    hand, side = start.shape.hand(), true_side(session)
    exact = session.hand.length if isinstance(session, SyntheticSession) else None
    return {
        "start_frame": start.frame, "start_golden": start.golden, "doubt": start.doubted,
        "right_side": None if side is None else start.shape.side == side,
        "size_ratio": None if exact is None else hand.length / exact,
        "shows": "" if not isinstance(session, SyntheticSession) else session.metadata["synthetic"],
    }  # fmt: skip


def _floor_part(session: Session, frames: SessionFrames, start: Start) -> dict[str, Any]:
    """Floors in mm by frame: of the hand that was found, and of the exact one where there is one; flagged labels."""
    if not session.has_truth:
        return {}
    hand = as_labelled(session, start.shape.hand())
    exact = session.hand if isinstance(session, SyntheticSession) else None
    lens = start.shape.lens
    labelled = hand_of_labels(session, lens)
    part: dict[str, list[Any]] = {
        "fitted_mm": [],
        "floor_mm": [],
        "free_mm": [],
        "exact_floor_mm": [],
        "label_golden": [],
    }
    for frame in frames[start.frame :]:
        rng = np.random.default_rng([frame.index, 7])
        own = floor_of(hand, frame, rng, lens=lens)
        free = floor_of(hand, frame, rng, pulled=False, lens=lens)
        best = None if exact is None else floor_of(exact, frame, rng, exact=True)
        part["fitted_mm"].append(None if own is None else _mm(own.fitted))
        part["floor_mm"].append(None if own is None else _mm(own.descended))
        part["free_mm"].append(None if free is None else _mm(free.descended))
        part["exact_floor_mm"].append(None if best is None else _mm(best.descended))
        part["label_golden"].append(
            None if frame.truth is None else round(label_energy(labelled, seen_through(frame, lens)), 4)
        )
    part["flagged"] = [golden is not None and golden > CONTRADICTED for golden in part["label_golden"]]
    return part


def _tracked(
    session: Session, frames: SessionFrames, start: Start, asked: Asked, count: int, source: Source
) -> dict[str, Any]:
    """Track from a start; everything by frame, from the start's on."""
    settings = make_settings(asked.tracker, asked.preset, _with_count(asked, count))
    tracking, state = begin(asked.tracker, settings, start, source.seed, time=float(session.times[start.frame]))
    lens = start.shape.lens
    rows: dict[str, list[Any]] = {
        "error_mm": [], "largest_mm": [], "lost": [], "golden": [], "iou": [], "seconds": [], "cpu_seconds": []
    }  # fmt: skip
    marks: list[tuple[Array, Array, Array]] = []  # axes of the offsets, joints, truth
    for frame in frames[start.frame :]:
        began = time.process_time()
        state, result = track_frame(tracking, state, frame)
        rows["cpu_seconds"].append(round(time.process_time() - began, 5))
        rows["seconds"].append(round(result.seconds, 5))
        hand = reshaped(tracking, result.shape_change).hand
        rows["lost"].append(bool(result.lost))
        rows["golden"].append(None if np.isnan(result.golden) else round(result.golden, 4))
        if not source.synthetic:
            agreement = agreement_with_depth(hand, result.pose, result.reference, seen_through(frame, lens))
            rows["iou"].append(0.0 if result.lost else round(agreement.silhouette_iou, 4))
        errors = None
        if frame.truth is not None:
            joints = as_stated(joints_of(as_labelled(session, hand), result.pose, result.reference), lens)
            if not source.synthetic:
                posed = pose_hand(hand, result.pose, result.reference)
                marks.append((offset_axes(hand, posed), posed.joints, as_seen(frame.truth.joints, lens)))
            errors = np.linalg.norm(joints - frame.truth.joints, axis=1)
        rows["error_mm"].append(None if errors is None else _mm(errors))
        rows["largest_mm"].append(None if errors is None else round(1e3 * float(np.nanmax(errors)), 3))
    exact = session.hand.length if isinstance(session, SyntheticSession) else None
    ended = {"end_size_ratio": None if exact is None else hand.length / exact}
    return rows | ended | {"own_offsets_mm": _nearest(marks, lens) if marks else None}


def _nearest(marks: list[tuple[Array, Array, Array]], lens: float) -> list[float]:
    """Errors by frame that remain with the constant offsets that bring this very run nearest to its truth, mm."""
    axes, joints, truth = (np.array(part) for part in zip(*marks, strict=True))
    apart = nearest_joints(axes, joints, truth, np.ones(len(joints), bool)) - truth
    return [_mm(np.linalg.norm(as_stated(own, lens), axis=1)) for own in apart]


def _with_count(asked: Asked, count: int) -> dict[str, str]:
    """The changes, and the number of particles where the tracker has any."""
    known = {info.name for info in TRACKERS[asked.tracker].settings().describe()}
    return ({"n": str(count)} if "n" in known else {}) | asked.changes


def _mm(errors: Array) -> float:
    """Mean over the known joints, mm."""
    return round(1e3 * float(np.nanmean(errors)), 3)
