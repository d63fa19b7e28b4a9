"""Is the uncertainty honest: ``uv run python -m benchmarks.holds.calibration [--sessions 8] [--json PATH]``.

Sessions are tracked from an automatic start, and each true joint is looked for in the ellipsoids that should hold it with
probability 0.1 to 0.99. The factor on the covariance and the degrees of freedom of the errors' distribution are the most likely
ones of sessions of even numbers, and are judged on those of odd ones. See docs/evaluation.md.
"""

from __future__ import annotations

import argparse
import json
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize
from scipy.stats import f as f_distribution
from scipy.stats import spearmanr

from benchmarks.holds.layout import markdown, stamp
from benchmarks.holds.sessions import KINDS, Source, open_source, synthetic
from spf.errors import SpfError
from spf.filters.smart import SpfSettings
from spf.filters.uncertainty import reach_of_share, uncertainty_of
from spf.initialise import find_start
from spf.prepare import SessionFrames
from spf.track import begin, reshaped, track_frame

__all__ = ["LEVELS", "coverage", "fitted", "main"]

Array = NDArray[np.float64]
LEVELS = (0.1, 0.25, 0.5, 0.68, 0.8, 0.9, 0.95, 0.99)
_EVERY = 3  # frames in a row are too much alike to count each
_HELD_MM = 40.0  # a frame worse than this is a gross error: told apart, for no Gaussian means it
_USUAL = ("slow", "medium", "fast", "back")


def main(arguments: list[str] | None = None) -> None:
    """Track, fit, print how often the truth lies where it should, and write the JSON."""
    parser = argparse.ArgumentParser(prog="benchmarks.holds.calibration", description="Is the uncertainty honest.")
    parser.add_argument("--kinds", nargs="+", default=list(_USUAL), choices=list(KINDS), metavar="KIND")
    parser.add_argument("--sessions", type=int, default=8, help="sessions of each kind, half of them to fit on (8)")
    parser.add_argument("--first", type=int, default=0, help="number of the first of them (0)")
    parser.add_argument("--frames", type=int, default=60)
    parser.add_argument("--n", type=int, default=4, help="particles (4)")
    parser.add_argument("--json", type=Path, metavar="PATH")
    options = parser.parse_args(arguments)
    rows: list[dict[str, Any]] = []
    try:
        for kind in options.kinds:
            for source in synthetic(kind, options.first, options.sessions, options.frames):
                rows += _measured(source, options.n)
                print(f"  {kind} {source.number}: {len(rows)} frames", file=sys.stderr, flush=True)
    except SpfError as error:
        sys.exit(f"calibration: {error}")
    for parity, use in enumerate(("fit on", "judge by")):
        if not any(row["number"] % 2 == parity for row in _held(rows)):
            sys.exit(f"calibration: in no session to {use} was the hand held; ask for more sessions.")
    result = _summary(rows)
    print(_table(result))
    if options.json is not None:
        options.json.parent.mkdir(parents=True, exist_ok=True)
        options.json.write_text(json.dumps({**stamp(), **result, "frames": rows}) + "\n", encoding="utf-8")


def _measured(source: Source, count: int) -> list[dict[str, Any]]:
    """Track a session, and measure its uncertainty with factor 1 in every third frame."""
    session = open_source(source)
    frames = SessionFrames(session, 0, source.frames)
    start = find_start(frames, np.random.default_rng([source.seed, 1]))
    settings = SpfSettings(n=count)
    tracking, state = begin("spf", settings, start, source.seed, time=float(session.times[start.frame]))
    rows = []
    for frame in frames[start.frame :]:
        state, result = track_frame(tracking, state, frame)
        if frame.index % _EVERY or frame.truth is None or result.info is None or result.observation is None:
            continue
        began = time.perf_counter()
        hand = reshaped(tracking, result.shape_change).hand
        said = uncertainty_of(hand, result.observation, result.info, settings, factor=1.0)
        seconds = time.perf_counter() - began
        errors = frame.truth.joints - result.joints
        rows.append({
            "kind": source.kind, "number": source.number, "frame": frame.index, "seconds": seconds,
            "squared": _squared(errors, said.joints).round(4).tolist(),
            "error_mm": (1e3 * np.linalg.norm(errors, axis=1)).round(3).tolist(),
            "deviation_mm": (1e3 * said.deviation).round(3).tolist(),
        })  # fmt: skip
    return rows


def _squared(errors: Array, covariances: Array) -> Array:
    """Squared Mahalanobis distances (21,) of errors (21, 3)."""
    return np.asarray(np.einsum("ji,ji->j", errors, np.linalg.solve(covariances, errors[:, :, None])[:, :, 0]))


def fitted(squared: Array) -> tuple[float, float]:
    """Return the factor on the covariance and the degrees of freedom (more than 2) that are the most likely ones.

    Args:
        squared: (M,) squared Mahalanobis distances of errors in three dimensions, by the covariances with a factor of 1.
    """

    def unlikely(logs: Array) -> float:
        scale, tails = np.exp(logs[0]), 2.0 + np.exp(logs[1])  # squared / (3 scale) is of F(3, tails)
        return -float(f_distribution.logpdf(squared / (3.0 * scale), 3, tails).mean() - logs[0])

    log_scale, log_excess = minimize(unlikely, np.zeros(2), method="Nelder-Mead").x
    tails = 2.0 + float(np.exp(log_excess))
    return float(np.exp(log_scale)) * tails / (tails - 2.0), tails


def coverage(squared: Array, factor: float, tails: float) -> list[float]:
    """Return how often the truth lies within the ellipsoid of each of :data:`LEVELS`."""
    return [float(np.mean(squared <= factor * reach_of_share(level, 3, tails) ** 2)) for level in LEVELS]


def _summary(rows: list[dict[str, Any]]) -> dict[str, Any]:
    """Fit on even numbers; judge on odd ones, all together and by kind; frames with gross errors are left out and counted."""
    held = _held(rows)
    even = [row for row in held if row["number"] % 2 == 0]
    odd = [row for row in held if row["number"] % 2 == 1]
    factor, tails = fitted(_all(even, "squared"))
    parts = {"fitted on": even, "judged on": odd}
    parts |= {kind: [row for row in odd if row["kind"] == kind] for kind in dict.fromkeys(row["kind"] for row in odd)}
    return {
        "factor": factor, "tails": tails, "gross_frames": len(rows) - len(held), "held_frames": len(held),
        "ms": 1e3 * float(np.median([row["seconds"] for row in rows])),
        "parts": {name: _part(own, factor, tails) for name, own in parts.items() if own},
    }  # fmt: skip


def _held(rows: list[dict[str, Any]]) -> list[dict[str, Any]]:
    return [row for row in rows if np.mean(row["error_mm"]) < _HELD_MM]


def _part(rows: list[dict[str, Any]], factor: float, tails: float) -> dict[str, Any]:
    errors, deviations = _all(rows, "error_mm"), _all(rows, "deviation_mm") * np.sqrt(factor)
    thirds = np.quantile(deviations, [1 / 3, 2 / 3])
    surest, least = deviations <= thirds[0], deviations > thirds[1]
    return {
        "frames": len(rows), "coverage": coverage(_all(rows, "squared"), factor, tails),
        "rms_error_mm": _rms(errors), "rms_deviation_mm": _rms(deviations),
        "rank_correlation": float(spearmanr(deviations, errors).statistic),
        "surest_third_mm": float(errors[surest].mean()), "least_sure_third_mm": float(errors[least].mean()),
    }  # fmt: skip


def _all(rows: list[dict[str, Any]], key: str) -> Array:
    return np.concatenate([np.asarray(row[key], dtype=np.float64) for row in rows])


def _rms(values: Array) -> float:
    return float(np.sqrt(np.mean(values**2)))


def _table(result: dict[str, Any]) -> str:
    headings = ["", "frames", *(f"{100 * level:.0f} %" for level in LEVELS), "rms error mm", "expected", "rank corr.",
                "surest third mm", "least sure third mm"]  # fmt: skip
    cells = [headings]
    for name, part in result["parts"].items():
        shares = [f"{100 * share:.0f}" for share in part["coverage"]]
        numbers = [f"{part[key]:.1f}" for key in ("rms_error_mm", "rms_deviation_mm")]
        ends = [f"{part[key]:.1f}" for key in ("surest_third_mm", "least_sure_third_mm")]
        cells.append([name, str(part["frames"]), *shares, *numbers, f"{part['rank_correlation']:.2f}", *ends])
    return (
        f"{markdown(cells)}\n\nfactor on the covariance {result['factor']:.2f}, degrees of freedom {result['tails']:.1f}; "
        f"{result['gross_frames']} frames over {_HELD_MM:.0f} mm left out, {result['held_frames']} held; "
        f"{result['ms']:.1f} ms a frame"
    )


if __name__ == "__main__":
    main()
