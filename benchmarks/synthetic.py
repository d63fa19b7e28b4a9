"""Accuracy on fresh synthetic sessions: ``uv run python -m benchmarks.synthetic [--n 4] [--seeds 1] [--json PATH]``.

Every motion is seen by every sensor, by a hand drawn at random, with clutter and viewpoint from the seed; each session is
tracked from an automatic start. The truth is exact, so the error is that of the tracker. The table shows the mean joint
error in mm of each motion (rows) and sensor (columns), and over all sessions the mean, the median over frames, the share
of frames over 40 mm, and the frames reported as lost.
"""

from __future__ import annotations

import argparse
import json
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np

from spf.errors import SpfError
from spf.hand.kinematics import joints_of
from spf.prepare import prepare
from spf.settings import Settings
from spf.synthetic import MOTIONS, SENSORS, SyntheticSettings, synthesise
from spf.track import begin, track_frame
from spf.trackers import make_settings

__all__ = ["main"]

_LARGE_MM = 40.0


def main(arguments: list[str] | None = None) -> None:
    """Track, print the table and write the JSON."""
    options = _parse(arguments)
    rows: list[dict[str, Any]] = []
    try:
        changes = dict(text.split("=", 1) for text in options.set)
        settings = make_settings(options.tracker, "default", {"n": str(options.n), **changes})
        for motion in options.motions:
            for sensor in options.sensors:
                rows += [_tracked(motion, sensor, seed, options, settings) for seed in range(options.seeds)]
            print(_line(rows, motion, options.sensors, heading=motion == options.motions[0]), flush=True)
    except SpfError as error:
        sys.exit(f"synthetic: {error}")
    print(_summary(rows))
    if options.json is not None:
        content = {"options": {k: str(v) for k, v in vars(options).items()}, "settings": settings.to_dict()}
        options.json.write_text(json.dumps({**content, "sessions": rows}, indent=1) + "\n", encoding="utf-8")


def _parse(arguments: list[str] | None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(description="Accuracy on fresh synthetic sessions.")
    parser.add_argument("--motions", nargs="+", default=list(MOTIONS), choices=list(MOTIONS))
    parser.add_argument("--sensors", nargs="+", default=list(SENSORS), choices=list(SENSORS))
    parser.add_argument("--seeds", type=int, default=1, help="sessions of each motion and sensor (1)")
    parser.add_argument("--first-seed", type=int, default=1000, help="seed of the first of them (1000)")
    parser.add_argument("--shape", default="random", help="shape of the hands (random)")
    parser.add_argument("--clutter", default="forearm", help="what else is in the scene (forearm)")
    parser.add_argument("--frames", type=int, default=90, help="frames of a session (90)")
    parser.add_argument("--speed", type=float, default=9.0, help="mean motion of the joints, mm a frame (9)")
    parser.add_argument("--tracker", default="spf")
    parser.add_argument("--n", type=int, default=4, help="particles (4)")
    parser.add_argument("--init", default="auto", choices=("auto", "truth"))
    parser.add_argument("--set", action="append", default=[], metavar="NAME=VALUE")
    parser.add_argument("--json", type=Path, metavar="PATH")
    return parser.parse_args(arguments)


def _tracked(motion: str, sensor: str, seed: int, options: argparse.Namespace, settings: Settings) -> dict[str, Any]:
    """Make a session, track it from its start and compare it with the truth."""
    asked = SyntheticSettings(
        motion=motion, sensor=sensor, shape=options.shape, clutter=options.clutter, frames=options.frames,
        speed_mm=options.speed, seed=options.first_seed + seed, side=("right", "left")[seed % 2],
    )  # fmt: skip
    session = synthesise(asked)
    began = time.perf_counter()
    start = prepare(session, init=options.init, seed=seed)
    preparing = time.perf_counter() - began
    tracking, state = begin(options.tracker, settings, start, seed, time=float(session.times[start.frame]))
    errors, seconds, lost = [], [], 0
    for index in range(start.frame, options.frames):
        frame = session[index]
        state, result = track_frame(tracking, state, frame)
        seconds.append(result.seconds)
        lost += result.lost
        if frame.truth is not None:
            joints = joints_of(tracking.hand, result.pose, result.reference)
            errors.append(1e3 * float(np.linalg.norm(joints - frame.truth.joints, axis=1).mean()))
    row = {
        "motion": motion, "sensor": sensor, "seed": seed, "start_frame": start.frame, "start_seconds": preparing,
        "right_side": start.shape.side == session.side, "size_ratio": tracking.hand.length / session.hand.length,
        "start_golden": start.golden, "doubt": bool(start.doubt), "lost_frames": lost,
        "seconds_per_frame_median": float(np.median(seconds)), "errors_mm": errors,
    }  # fmt: skip
    print(
        f"  {motion} {sensor} {seed}: {np.mean(errors):.1f} mm, side {'right' if row['right_side'] else 'WRONG'}, size "
        f"{row['size_ratio']:.2f}, golden {start.golden:.2f}, lost {lost}, start {preparing:.0f} s",
        file=sys.stderr, flush=True,
    )  # fmt: skip
    return row


def _line(rows: list[dict[str, Any]], motion: str, sensors: list[str], *, heading: bool) -> str:
    own = [[r for r in rows if r["motion"] == motion and r["sensor"] == sensor] for sensor in sensors]
    cells = "".join(f"{np.mean([np.mean(r['errors_mm']) for r in group]):>18.1f}" for group in own)
    head = f"{'mm':<16}" + "".join(f"{sensor:>18}" for sensor in sensors) + "\n" if heading else ""
    return f"{head}{motion:<16}{cells}"


def _summary(rows: list[dict[str, Any]]) -> str:
    errors = np.concatenate([row["errors_mm"] for row in rows])
    return (
        f"{len(rows)} sessions: mean of sessions {np.mean([np.mean(row['errors_mm']) for row in rows]):.2f} mm, median frame "
        f"{np.median(errors):.2f} mm, {100 * np.mean(errors > _LARGE_MM):.1f} % of frames over {_LARGE_MM:.0f} mm, "
        f"{sum(row['lost_frames'] for row in rows)} frames lost, {sum(not row['right_side'] for row in rows)} wrong sides, "
        f"start {np.median([row['start_seconds'] for row in rows]):.0f} s, "
        f"{1e3 * np.median([row['seconds_per_frame_median'] for row in rows]):.0f} ms a frame"
    )


if __name__ == "__main__":
    main()
