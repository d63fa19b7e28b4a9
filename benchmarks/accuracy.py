"""Accuracy over sessions and seeds: ``uv run python -m benchmarks.accuracy SESSION … [--seeds 5] [--json PATH]``.

Each session is tracked with each seed, from its own automatic start, and measured as ``spf evaluate`` does; the table
shows mean ± standard deviation over the seeds. Errors are of the corrected joints but for the column that says raw.
"""

from __future__ import annotations

import argparse
import json
import sys
from pathlib import Path
from typing import Any

import numpy as np

from spf.errors import SpfError
from spf.evaluate import evaluate_run
from spf.hand import read_hand_shape
from spf.manifest import Plan
from spf.prepare import prepare
from spf.runs import Run, track_plan
from spf.sessions import Session, open_session
from spf.settings import Settings
from spf.trackers import PRESETS, TRACKERS, make_settings
from spf.trackfile import row_of, track_of

__all__ = ["main"]

#: heading → path of keys in the measures, factor
COLUMNS: dict[str, tuple[tuple[str, ...], float]] = {
    "mean mm": (("mean_joint_error_mm",), 1.0),
    "raw mm": (("mean_joint_error_raw_mm",), 1.0),
    "median mm": (("median_joint_error_mm",), 1.0),
    "tips mm": (("fingertip_error_mm",), 1.0),
    "<20 %": (("frames_max_error_under_mm", "20"), 100.0),
    "<30 %": (("frames_max_error_under_mm", "30"), 100.0),
    "<40 %": (("frames_max_error_under_mm", "40"), 100.0),
    "IoU": (("silhouette_iou",), 1.0),
    "IoU≥.6 %": (("frames_iou_over_60",), 100.0),
    "losses": (("losses",), 1.0),
    "lost": (("frames_lost",), 1.0),
    "ms": (("seconds_per_frame_median",), 1e3),
}


def main(arguments: list[str] | None = None) -> None:
    """Track, measure, print the table and write the JSON."""
    options = _parse(arguments)
    rows: list[dict[str, Any]] = []
    try:
        changes = dict(text.split("=", 1) for text in options.set)
        settings = make_settings(options.tracker, options.preset, changes)
        for uri in options.sessions:
            with open_session(uri) as session:
                runs = [_measured(session, settings, options, seed) for seed in range(options.seeds)]
            rows.append({"session": session.name, "runs": runs})
            print(_table(rows[-1:], heading=len(rows) == 1), flush=True)
    except SpfError as error:
        sys.exit(f"accuracy: {error}")
    if options.json is not None:
        described = {"tracker": options.tracker, "preset": options.preset, "settings": settings.to_dict()}
        options.json.write_text(json.dumps({**described, "sessions": rows}, indent=1) + "\n", encoding="utf-8")


def _parse(arguments: list[str] | None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(description="Accuracy over sessions and seeds.")
    parser.add_argument("sessions", nargs="+", metavar="SESSION")
    parser.add_argument("--seeds", type=int, default=5, help="number of seeds (5)")
    parser.add_argument("--tracker", default="spf", help=f"one of {', '.join(TRACKERS)} (spf)")
    parser.add_argument("--preset", default="default", help=f"one of {', '.join(PRESETS)} (default)")
    parser.add_argument("--set", action="append", default=[], metavar="NAME=VALUE", help="change a setting; repeatable")
    parser.add_argument("--init", default="auto", help="auto, truth or a pose file (auto)")
    parser.add_argument("--hand", type=Path, metavar="HAND.json", help="shape of the hand (found)")
    parser.add_argument("--frames", type=int, help="only the first so many")
    parser.add_argument("--json", type=Path, metavar="PATH", help="write all measures of all runs there")
    options = parser.parse_args(arguments)
    if options.seeds < 1:
        parser.error("--seeds is a number from 1 on")
    if any("=" not in text for text in options.set):
        parser.error("--set takes name=value")
    return options


def _measured(session: Session, settings: Settings, options: argparse.Namespace, seed: int) -> dict[str, Any]:
    """Track and measure a session with one seed."""
    last = min(len(session), options.frames or len(session))
    shape = None if options.hand is None else read_hand_shape(options.hand)
    start = prepare(session, init=options.init, shape=shape, seed=seed, last=last)
    plan = Plan(options.tracker, options.preset, settings, seed, options.init, 0, last, start)
    dof_names = start.shape.hand().dof_names
    track = track_of([row_of(result) for result in track_plan(session, plan)], dof_names)
    measures = evaluate_run(Run({"complete": True}, plan, track), session)
    note = f"  ({start.doubt})" if start.doubt else ""
    mean = measures.get("mean_joint_error_mm")
    told = "" if mean is None else f" {mean:.2f} mm,"
    print(
        f"  {session.name} seed {seed}:{told} {start.shape.side} hand, scale {start.shape.scale:.3f}, "
        f"{measures['losses']} losses, {measures['frames_lost']} frames lost{note}",
        file=sys.stderr,
        flush=True,
    )
    return {**measures, "hand": start.shape.to_dict(), "start_frame": start.frame, "start_golden": start.golden}


def _table(rows: list[dict[str, Any]], *, heading: bool) -> str:
    lines = [f"{'session':<22}" + "".join(f"{name:>15}" for name in COLUMNS)] if heading else []
    for row in rows:
        cells = [_cell(row["runs"], keys, factor) for keys, factor in COLUMNS.values()]
        lines.append(f"{row['session']:<22}" + "".join(f"{cell:>15}" for cell in cells))
    return "\n".join(lines)


def _cell(runs: list[dict[str, Any]], keys: tuple[str, ...], factor: float) -> str:
    values = []
    for run in runs:
        value: Any = run
        for key in keys:
            value = value.get(key) if isinstance(value, dict) else None
        if value is not None:
            values.append(float(value) * factor)
    if not values:
        return "–"
    return f"{np.mean(values):.4g} ± {np.std(values):.2g}"


if __name__ == "__main__":
    main()
