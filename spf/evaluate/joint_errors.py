"""Joint errors against the truth, and the success curves made of them."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from spf.frame import JOINT_NAMES

__all__ = ["JointMeasures", "joint_errors", "measure_joints"]

Array = NDArray[np.float64]

THRESHOLDS = np.arange(81) * 1e-3  # m, of the success curves
_LIMITS_MM = (20, 30, 40)
_AREA = 0.050  # m, up to which the area under the curve is taken
_TIPS = [i for i, name in enumerate(JOINT_NAMES) if name.endswith("_tip")]
_PALM = [i for i, name in enumerate(JOINT_NAMES) if name == "wrist" or name.endswith("_mcp")]


class JointMeasures(NamedTuple):
    """Measures of joint errors, in metres and as fractions; NaN where no truth says.

    Attributes:
        frames: frames with truth.
        mean, median: over all joints of all frames.
        fingertips: mean over the five fingertips.
        palm: mean over the wrist and the knuckles of the four fingers.
        per_joint: (21,) mean of each joint.
        frames_under: mm → fraction of frames whose largest joint error is under it.
        joints_curve, frames_curve: (81,) fraction of joints, and of frames by their largest error, within
            each of 0, 1 … 80 mm.
        area: under the joints' curve from 0 to 50 mm, 1 for no error at all.
    """

    frames: int
    mean: float
    median: float
    fingertips: float
    palm: float
    per_joint: Array
    frames_under: dict[int, float]
    joints_curve: Array
    frames_curve: Array
    area: float


def joint_errors(joints: Array, truth: Array) -> Array:
    """Return the distances (N, 21), m, of joints (N, 21, 3) from the true ones; NaN where the truth is."""
    return np.asarray(np.linalg.norm(joints - truth, axis=2))


def measure_joints(errors: Array) -> JointMeasures:
    """Summarise joint errors (N, 21), m; joints and frames without truth (NaN) are left out."""
    errors = errors[np.isfinite(errors).any(axis=1)]
    known = errors[np.isfinite(errors)]
    largest = np.array([np.max(row[np.isfinite(row)]) for row in errors])
    joints_curve, frames_curve = _success(known), _success(largest)
    within = THRESHOLDS <= _AREA + 1e-9
    return JointMeasures(
        frames=len(errors),
        mean=_mean(known),
        median=float(np.median(known)) if known.size else float("nan"),
        fingertips=_mean(errors[:, _TIPS]),
        palm=_mean(errors[:, _PALM]),
        per_joint=np.array([_mean(column) for column in errors.T]),
        frames_under={mm: _mean((largest < mm * 1e-3).astype(np.float64)) for mm in _LIMITS_MM},
        joints_curve=joints_curve,
        frames_curve=frames_curve,
        area=float(np.trapezoid(joints_curve[within], THRESHOLDS[within]) / _AREA),
    )


def _mean(values: Array) -> float:
    known = values[np.isfinite(values)]
    return float(known.mean()) if known.size else float("nan")


def _success(errors: Array) -> Array:
    """Fraction of errors (M,) within each threshold."""
    if not errors.size:
        return np.full(len(THRESHOLDS), np.nan)
    return np.searchsorted(np.sort(errors), THRESHOLDS, side="right") / errors.size
