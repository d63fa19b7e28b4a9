"""One table of everything that was held: a row a kind and number of particles, with the floor beside the error."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from typing import Any, NamedTuple

import numpy as np

from benchmarks.holds.layout import markdown
from spf.evaluate.losses import count_losses

__all__ = ["Bar", "bar_of", "lay_out", "row_of", "worst"]

_LARGE_MM = 40.0
_CURVE_MM = range(81)  # thresholds of the success curve
_GOOD_IOU = 0.7
_SAME_AS_EIGHT_MM = 2.0  # by which fewer particles may be worse than eight


class Bar(NamedTuple):
    """What is asked of a row.

    Attributes:
        mean_mm: highest mean error; above the floor where ``above_floor``.
        over_40: highest share of frames with a mean error over 40 mm.
        above_floor: whether the mean counts from the floor.
        good_iou: least share of frames with a silhouette IoU of 0.7.
    """

    mean_mm: float | None = None
    over_40: float | None = None
    above_floor: bool = False
    good_iou: float | None = None


_BARS: dict[str, Bar] = {
    "slow": Bar(4.0, 0.01),
    "medium": Bar(5.0, 0.01),
    "fast": Bar(7.0, 0.01),
    "P1": Bar(20.0, 0.10),
    "P4": Bar(1.0, above_floor=True),
    "P5": Bar(1.0, above_floor=True),
    "kinect2": Bar(good_iou=0.95),
}


def bar_of(kind: str, count: int) -> Bar | None:
    """Return what is asked of a kind with so many particles, or None."""
    bar = _BARS.get(kind)
    if bar is None or count >= 8 or bar.mean_mm is None or bar.above_floor:
        return bar
    return bar._replace(mean_mm=bar.mean_mm + _SAME_AS_EIGHT_MM)


def row_of(runs: Sequence[dict[str, Any]]) -> dict[str, Any]:
    """Summarise runs of one kind and number of particles; None for what cannot be known."""
    errors = [_known(run["error_mm"]) for run in runs]
    frames, largest = np.concatenate(errors), np.concatenate([_known(run["largest_mm"]) for run in runs])
    means = [float(own.mean()) for own in errors if own.size]
    good = [(_known(run["error_mm"], ~_flags(run)), _known(_floors(run), ~_flags(run))) for run in runs]
    lost = [count_losses(np.array(run["lost"], bool)) for run in runs]
    sides = [run["right_side"] for run in runs if run["right_side"] is not None]
    iou = np.concatenate([_known(run["iou"]) for run in runs])
    row: dict[str, Any] = {
        "kind": runs[0]["kind"], "n": runs[0]["n"], "sessions": len(runs), "frames": sum(len(r["lost"]) for r in runs),
        "mean_mm": _mean(means), "spread_mm": float(np.std(means)) if means else None, "median_mm": _median(frames),
        "p95_mm": float(np.percentile(frames, 95)) if frames.size else None,
        "floor_mm": _mean([_mean(_known(_floors(run))) for run in runs]),
        "own_floor_mm": _mean([_mean(_known(run.get("floor_mm"))) for run in runs]),
        "free_mm": _mean([_mean(_known(run.get("free_mm"))) for run in runs]),
        "fitted_mm": _mean([_mean(_known(run.get("fitted_mm"))) for run in runs]),
        "flagged": _mean(np.concatenate([_flags(run) for run in runs])) if frames.size else None,
        "unflagged_mean_mm": _mean([_mean(own) for own, _ in good]),
        "unflagged_floor_mm": _mean([_mean(own) for _, own in good]),
        "own_offsets_mm": _mean([_mean(_known(run.get("own_offsets_mm"))) for run in runs]),
        "over_40": _mean(frames > _LARGE_MM),
        "success_curve": [_mean(largest < mm) for mm in _CURVE_MM],
        "losses": sum(own.losses for own in lost), "frames_lost": sum(own.frames_lost for own in lost),
        "wrong_sides": None if not sides else sides.count(False),
        "size_error": _mean([abs(run["size_ratio"] - 1.0) for run in runs if run["size_ratio"] is not None]),
        "end_size_error": _mean([abs(run["end_size_ratio"] - 1.0) for run in runs if run.get("end_size_ratio")]),
        "iou_over_70": _mean(iou >= _GOOD_IOU), "iou": _mean(iou),
        "ms": 1e3 * float(np.median(np.concatenate([run["seconds"] for run in runs]))),
        "cpu_ms": 1e3 * float(np.median(np.concatenate([run["cpu_seconds"] for run in runs]))),
        "start_s": _median([run["start_seconds"] for run in runs]),
    }  # fmt: skip
    return row | {"bar": _judged(row)}


def _judged(row: dict[str, Any]) -> str:
    """Say what the bar of a row makes of it: "" without one, "held", or what misses it."""
    bar = bar_of(row["kind"], row["n"])
    if bar is None:
        return ""
    missed = []
    base = row["floor_mm"] or 0.0 if bar.above_floor else 0.0
    if bar.mean_mm is not None and (row["mean_mm"] is None or row["mean_mm"] > base + bar.mean_mm):
        missed.append(f"mean > {base + bar.mean_mm:.1f}")
    if bar.over_40 is not None and (row["over_40"] is None or row["over_40"] > bar.over_40):
        missed.append(f">40 > {100 * bar.over_40:.0f} %")
    if bar.good_iou is not None and (row["iou_over_70"] is None or row["iou_over_70"] < bar.good_iou):
        missed.append(f"IoU < {100 * bar.good_iou:.0f} %")
    return ", ".join(missed) or "held"


_COLUMNS: dict[str, Callable[[dict[str, Any]], str]] = {
    "kind": lambda r: f"{r['kind']}",
    "N": lambda r: f"{r['n']}",
    "runs": lambda r: f"{r['sessions']}",
    "mean mm": lambda r: "–" if r["mean_mm"] is None else f"{r['mean_mm']:.1f} ± {r['spread_mm']:.1f}",
    "median": lambda r: _number(r["median_mm"]),
    "95 %": lambda r: _number(r["p95_mm"]),
    "floor": lambda r: _number(r["floor_mm"]),
    "own": lambda r: _number(r["own_floor_mm"]),
    "free": lambda r: _number(r["free_mm"]),
    "fit": lambda r: _number(r["fitted_mm"]),
    ">40 %": lambda r: _number(r["over_40"], 100.0),
    "all<20 %": lambda r: _number(r["success_curve"][20], 100.0, 0),
    "flag %": lambda r: _number(r["flagged"], 100.0, 0),
    "unflagged": lambda r: _number(r["unflagged_mean_mm"]),
    "floor ": lambda r: _number(r["unflagged_floor_mm"]),
    "offsets": lambda r: _number(r["own_offsets_mm"]),
    "IoU≥.7 %": lambda r: _number(r["iou_over_70"], 100.0, 0),
    "losses": lambda r: f"{r['losses']}",
    "lost": lambda r: f"{r['frames_lost']}",
    "wrong": lambda r: "–" if r["wrong_sides"] is None else f"{r['wrong_sides']}",
    "size %": lambda r: _number(r["size_error"], 100.0),
    "end %": lambda r: _number(r["end_size_error"], 100.0),
    "ms": lambda r: _number(r["ms"], 1.0, 0),
    "cpu": lambda r: _number(r["cpu_ms"], 1.0, 0),
    "start s": lambda r: _number(r["start_s"], 1.0, 0),
    "bar": lambda r: r["bar"],
}


def lay_out(rows: Iterable[dict[str, Any]]) -> str:
    """Lay rows out as a Markdown table, its columns aligned."""
    cells = [list(_COLUMNS), *([make(row) for make in _COLUMNS.values()] for row in rows)]
    return markdown(cells)


def worst(runs: Iterable[dict[str, Any]], most: int) -> list[str]:
    """Describe the runs that lie farthest above their floor, and where."""
    rated = []
    for run in runs:
        errors, floors = _filled(run["error_mm"]), _filled(_floors(run) or [None] * len(run["error_mm"]))
        if np.isfinite(errors).any():
            above = errors - np.where(np.isfinite(floors), floors, 0.0)
            rated.append((float(np.nanmean(above)), run, errors))
    rated.sort(key=lambda item: -item[0])
    return [_described(above, run, errors) for above, run, errors in rated[:most]]


def _described(above: float, run: dict[str, Any], errors: np.ndarray) -> str:
    bad = [run["start_frame"] + int(i) for i in np.flatnonzero(errors > max(15.0, np.nanmedian(errors) * 1.5))]
    peak = run["start_frame"] + int(np.nanargmax(errors))
    side = "" if run["right_side"] is not False else ", WRONG SIDE"
    size = "" if run["size_ratio"] is None else f", size {run['size_ratio']:.2f}"
    return (
        f"{run['kind']} {run['number'] if run['number'] >= 0 else 'seed ' + str(run['seed'])} N={run['n']} "
        f"({run['session']}): {above:+.1f} mm over the floor, worst {np.nanmax(errors):.0f} mm in frame {peak}, "
        f"frames {_spans(bad)}{side}{size}, start {run['start_golden']:.2f} at {run['start_frame']}"
        f"{', doubted: ' + run['doubt'] if run['doubt'] else ''}"
    )


def _spans(indices: list[int]) -> str:
    """Indices as spans: 3-7, 12."""
    spans: list[list[int]] = []
    for index in indices:
        if spans and index == spans[-1][1] + 1:
            spans[-1][1] = index
        else:
            spans.append([index, index])
    shown = [f"{a}-{b}" if b > a else f"{a}" for a, b in spans[:8]]
    return (", ".join(shown) + (", …" if len(spans) > 8 else "")) or "none"


def _floors(run: dict[str, Any]) -> list[float | None] | None:
    """The exact hand's floors where there is one, else those of the hand that was found."""
    exact: list[float | None] = run.get("exact_floor_mm") or []
    return exact if any(value is not None for value in exact) else run.get("floor_mm")


def _flags(run: dict[str, Any]) -> np.ndarray:
    return np.array(run.get("flagged") or [False] * len(run["lost"]), dtype=bool)


def _filled(values: Sequence[float | None]) -> np.ndarray:
    return np.array([np.nan if value is None else value for value in values], dtype=np.float64)


def _known(values: Sequence[float | None] | None, where: np.ndarray | None = None) -> np.ndarray:
    filled = _filled(values or [])
    chosen = filled if where is None or not filled.size else filled[where]
    return chosen[np.isfinite(chosen)]


def _mean(values: Iterable[float | None] | np.ndarray) -> float | None:
    known = [float(value) for value in values if value is not None]
    return float(np.mean(known)) if known else None


def _median(values: Sequence[float] | np.ndarray) -> float | None:
    return float(np.median(values)) if len(values) else None


def _number(value: float | None, factor: float = 1.0, digits: int = 1) -> str:
    return "–" if value is None else f"{factor * value:.{digits}f}"
