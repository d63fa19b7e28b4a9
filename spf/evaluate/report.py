"""All measures of a run, ready for JSON."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from spf.evaluate.depth_agreement import agreement_with_depth
from spf.evaluate.joint_errors import THRESHOLDS, JointMeasures, joint_errors, measure_joints
from spf.evaluate.losses import count_losses
from spf.frame import JOINT_NAMES
from spf.hand.kinematics import pose_hand
from spf.joint_definitions import corrected_joints, nearest_joints, offset_axes, offsets_of
from spf.lens import as_seen, as_stated, seen_through
from spf.progress import Report
from spf.runs import Run
from spf.sessions import Session, marks_in
from spf.sessions.marked import BY_HAND
from spf.sessions.marks import count_marks
from spf.trackfile import Track

__all__ = ["Compared", "compare_run", "evaluate_run", "measures_of"]

Array = NDArray[np.float64]
_GOOD_IOU = 0.6


class Compared(NamedTuple):
    """What comparing every frame of a run gives.

    Attributes:
        truth: (N, 21, 3) m, true joints; NaN where unknown.
        corrected: (N, 21, 3) m, the run's joints where the data set would mark them.
        nearest: (N, 21, 3) m, with the constant offsets that bring this very run nearest to its truth.
        iou: (N,) overlap of the silhouettes; NaN while the hand is lost.
        distance: (N,) m, mean distance of the observed points from the model; NaN while the hand is lost.
    """

    truth: Array
    corrected: Array
    nearest: Array
    iou: Array
    distance: Array

    @property
    def errors(self) -> Array:
        """(N, 21) m, distances of the corrected joints from the true ones; NaN where there is no truth."""
        return joint_errors(self.corrected, self.truth)


def evaluate_run(run: Run, session: Session, progress: Report | None = None) -> dict[str, Any]:
    """Measure a run (spec 9).

    Args:
        run: track and plan.
        session: that was tracked.
        progress: called with what is being done and the share done.

    Returns:
        name → value, ready for JSON: errors and distances in mm, fractions from 0 to 1, None for what cannot be known.
        ``mean_joint_error_mm`` and all errors after it are those of the corrected joints where the data set's joint
        definition was fitted, and ``correction`` says so; ``mean_joint_error_own_offsets_mm`` is what remains with one
        constant offset a joint that is fitted to this very run.

    Raises:
        SessionError: a frame cannot be read.
    """
    return measures_of(run, session, compare_run(run, session, progress))


def measures_of(run: Run, session: Session, compared: Compared) -> dict[str, Any]:
    """Summarise a compared run; see :func:`evaluate_run`."""
    offsets = offsets_of(session.joint_definition) if session.has_truth else None
    track = run.track
    report: dict[str, Any] = {"session": session.name, "tracker": run.plan.tracker, "preset": run.plan.preset}
    report |= {"seed": run.plan.seed, "complete": run.manifest["complete"], "doubt": run.plan.start.doubt}
    report |= {"frames": len(track)}
    if session.has_truth:
        raw = measure_joints(joint_errors(track.joints, compared.truth))
        corrected = measure_joints(compared.errors)
        nearest = measure_joints(joint_errors(compared.nearest, compared.truth))
        report |= _joints_part(raw, corrected)
        report |= {
            "mean_joint_error_own_offsets_mm": nearest.mean * 1e3,
            "correction": _correction_note(session, offsets),
        }
        report |= _marks_part(session, compared)
    return _plain(report | _depth_part(compared) | _losses_part(track) | _work_part(track))


def compare_run(run: Run, session: Session, progress: Report | None = None) -> Compared:
    """Compare every frame of a run with its depth, and with its truth where there is one.

    Args:
        run: track and plan.
        session: that was tracked.
        progress: called with what is being done and the share done.

    Raises:
        SessionError: a frame cannot be read.
    """
    known = offsets_of(session.joint_definition) if session.has_truth else None
    offsets = np.zeros((len(JOINT_NAMES), 3)) if known is None else known
    track, lens = run.track, run.plan.start.shape.lens
    result = Compared(*(np.full((len(track), *shape), np.nan) for shape in ((21, 3), (21, 3), (21, 3), (), ())))
    axes = np.empty((len(track), len(JOINT_NAMES), 3, 3))
    for row, index in enumerate(track.frame):
        frame, hand = session[int(index)], run.hand_at(row)
        posed = pose_hand(hand, track.poses[row], track.references[row])
        axes[row] = offset_axes(hand, posed)
        result.corrected[row] = as_stated(corrected_joints(hand, posed, offsets), lens)
        if frame.truth is not None:
            result.truth[row] = frame.truth.joints
        if not track.lost[row]:
            result.iou[row], result.distance[row] = agreement_with_depth(
                hand, track.poses[row], track.references[row], seen_through(frame, lens)
            )
        if progress is not None:
            progress("Comparing with the depth", (row + 1) / len(track))
    joints, truth = as_seen(track.joints, lens), as_seen(result.truth, lens)
    result.nearest[:] = as_stated(nearest_joints(axes, joints, truth, ~track.lost), lens)
    return result


def _joints_part(raw: JointMeasures, corrected: JointMeasures) -> dict[str, Any]:
    return {
        "frames_with_truth": corrected.frames,
        "mean_joint_error_raw_mm": raw.mean * 1e3,
        "mean_joint_error_mm": corrected.mean * 1e3,
        "median_joint_error_mm": corrected.median * 1e3,
        "fingertip_error_mm": corrected.fingertips * 1e3,
        "palm_error_mm": corrected.palm * 1e3,
        "frames_max_error_under_mm": {str(mm): share for mm, share in corrected.frames_under.items()},
        "auc_0_50mm": corrected.area,
        "joint_error_mm": dict(zip(JOINT_NAMES, (corrected.per_joint * 1e3).tolist(), strict=True)),
        "success_curve": {
            "threshold_mm": np.rint(THRESHOLDS * 1e3).tolist(),
            "joints": corrected.joints_curve.tolist(),
            "frames": corrected.frames_curve.tolist(),
        },
    }


def _marks_part(session: Session, compared: Compared) -> dict[str, Any]:
    """How much of the truth a person has marked, in the whole session; nothing where nobody has."""
    frames, joints = count_marks(marks_in(session))
    known = int(np.isfinite(compared.errors).sum())
    return (
        {"frames_marked_by_hand": frames, "joints_marked_by_hand": joints, "joints_compared": known} if frames else {}
    )


def _correction_note(session: Session, offsets: Array | None) -> str:
    if session.joint_definition == BY_HAND:
        return "none: joints marked by hand are taken as they are"
    if offsets is None:
        return f"none fitted for the joints of {session.joint_definition}: mean_joint_error_mm is the raw error"
    if not offsets.any():
        return "none needed: the truth marks the model's own joints"
    return f"one constant offset a joint in its bone's frame, fitted once for {session.joint_definition}"


def _depth_part(compared: Compared) -> dict[str, Any]:
    held = np.isfinite(compared.iou)
    return {
        "mean_data_to_model_mm": _mean(compared.distance) * 1e3,
        "silhouette_iou": _mean(compared.iou),
        "frames_iou_over_60": float((compared.iou[held] >= _GOOD_IOU).sum() / max(len(held), 1)),
    }


def _losses_part(track: Track) -> dict[str, Any]:
    return dict(count_losses(track.lost)._asdict())


def _work_part(track: Track) -> dict[str, Any]:
    seconds = track.seconds[track.seconds > 0]
    return {
        "seconds_per_frame_median": float(np.median(seconds)) if seconds.size else float("nan"),
        "ess_median": _median(track.ess),
        "evaluations_per_frame": _mean(track.evaluations),
        "optimised_share": _mean(track.optimised_share),
        "log_likelihood_mean": _mean(track.log_likelihood),
    }


def _mean(values: Array) -> float:
    known = values[np.isfinite(values)]
    return float(known.mean()) if known.size else float("nan")


def _median(values: Array) -> float:
    known = values[np.isfinite(values)]
    return float(np.median(known)) if known.size else float("nan")


def _plain(value: Any) -> Any:
    """Put None in the place of NaN, which JSON does not know."""
    if isinstance(value, dict):
        return {key: _plain(item) for key, item in value.items()}
    if isinstance(value, list):
        return [_plain(item) for item in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value
