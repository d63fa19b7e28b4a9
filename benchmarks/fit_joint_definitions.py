"""Fit what a data set's joints mean on the model: ``uv run python -m benchmarks.fit_joint_definitions SESSION|RUN …``.

Takes recordings of one data set with truth, tracks each with the default tracker from an automatic start (or reads a
run of ``spf track`` that is given in its place), and takes for each joint the geometric median, over all frames that the
hand was held in, of the truth minus the model's joint in its bone's frame, as a fraction of the hand's length; each
recording counts the same, however long it is. Writes it, with the date and how it was done, to
``spf/joint_definitions.json``. To be run once, on CVAR's P1, P4 and P5.
"""

from __future__ import annotations

import argparse
import datetime
import json
import sys
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize

from spf import __version__
from spf.errors import SpfError
from spf.frame import JOINT_NAMES
from spf.hand.kinematics import pose_hand
from spf.joint_definitions import corrected_joints, definitions, relative_offsets
from spf.lens import as_seen, as_stated
from spf.manifest import Plan
from spf.prepare import prepare
from spf.runs import MANIFEST, Run, read_run, reopen_session, track_plan
from spf.sessions import Session, open_session
from spf.trackers import make_settings
from spf.trackfile import row_of, track_of

__all__ = ["main"]

Array = NDArray[np.float64]
_STORED = Path(__file__).resolve().parent.parent / "spf" / "joint_definitions.json"


class _Tracked(NamedTuple):
    session: Session
    run: Run


def main(arguments: list[str] | None = None) -> None:
    """Fit the offsets, print what they leave of the error, and write them."""
    parser = argparse.ArgumentParser(description="Fit what a data set's joints mean on the model.")
    parser.add_argument("sources", nargs="+", metavar="SESSION|RUN", help="recordings of one data set, or runs on them")
    parser.add_argument("--init", choices=("auto", "truth"), default="auto", help="where first poses come from (auto)")
    parser.add_argument("--seed", type=int, default=0, help="of the tracker")
    parser.add_argument("-o", "--output", type=Path, default=_STORED, help="file to write (spf/joint_definitions.json)")
    options = parser.parse_args(arguments)
    try:
        tracked = [_tracked(Path(source), options.seed, options.init) for source in options.sources]
    except SpfError as error:
        sys.exit(f"fit_joint_definitions: {error}")
    names = {item.session.joint_definition for item in tracked}
    if len(names) != 1 or not all(item.session.has_truth for item in tracked):
        parser.error(f"give recordings with truth of one data set, not of {', '.join(sorted(names))}")
    offsets = _middle([_offsets(item) for item in tracked])
    for item in tracked:
        before, after = _errors(item, np.zeros_like(offsets)), _errors(item, offsets)
        raw, corrected = np.nanmean(before) * 1e3, np.nanmean(after) * 1e3
        print(f"{item.session.name:<8} {raw:6.2f} mm raw  {corrected:6.2f} mm corrected")
    entry = {
        "fitted": datetime.date.today().isoformat(),
        "recordings": [item.session.name for item in tracked],
        "frames": [int((~item.run.track.lost).sum()) for item in tracked],
        "how": "per joint, geometric median over held frames, each recording counting the same, of truth minus model in "
        f"the bone's frame, as a fraction of the hand's length; spf {__version__}, default tracker, start {options.init}, "
        f"seed {options.seed}",
        "offsets": {name: np.round(row, 5).tolist() for name, row in zip(JOINT_NAMES, offsets, strict=True)},
    }
    content = {**definitions(), names.pop(): entry}
    options.output.write_text(json.dumps(content, indent=1) + "\n", encoding="utf-8")
    print(f"Wrote {options.output}.")


def _tracked(source: Path, seed: int, init: str) -> _Tracked:
    if (source / MANIFEST).exists():
        run = read_run(source)
        return _Tracked(reopen_session(run.manifest), run)
    session = open_session(source)
    start = prepare(session, init=init, seed=seed)
    if start.doubt:
        print(f"{session.name}: {start.doubt}", file=sys.stderr)
    plan = Plan("spf", "default", make_settings("spf"), seed, init, 0, len(session), start)
    track = track_of([row_of(r) for r in track_plan(session, plan)], start.shape.hand().dof_names)
    return _Tracked(session, Run({}, plan, track))


def _offsets(item: _Tracked) -> Array:
    """(N, 21, 3) offsets in the frames that the hand was held in; NaN where there is no truth."""
    track, lens = item.run.track, item.run.plan.start.shape.lens
    held = np.flatnonzero(~track.lost)
    result = np.full((len(held), len(JOINT_NAMES), 3), np.nan)
    for place, row in enumerate(held):
        truth = item.session.truth(int(track.frame[row]))
        if truth is not None:
            hand = item.run.hand_at(int(row))
            posed = pose_hand(hand, track.poses[row], track.references[row])
            result[place] = relative_offsets(hand, posed, as_seen(truth.joints, lens))
    return result


def _middle(offsets: list[Array]) -> Array:
    """Geometric medians (21, 3) of offsets (N, 21, 3) of several recordings that count the same: the least mean error."""
    result = np.empty(offsets[0].shape[1:])
    for joint in range(len(result)):
        own = [part[np.isfinite(part[:, joint]).all(axis=1), joint] for part in offsets]
        first = np.median(np.concatenate(own), axis=0)
        result[joint] = minimize(_mean_distance, first, args=(own,), method="Nelder-Mead").x
    return result


def _mean_distance(place: Array, recordings: list[Array]) -> float:
    return float(np.mean([np.linalg.norm(points - place, axis=1).mean() for points in recordings]))


def _errors(item: _Tracked, offsets: Array) -> Array:
    """(N, 21) m in all frames, lost ones included."""
    track, lens = item.run.track, item.run.plan.start.shape.lens
    result = np.full((len(track), len(JOINT_NAMES)), np.nan)
    for row, index in enumerate(track.frame):
        truth = item.session.truth(int(index))
        if truth is not None:
            hand = item.run.hand_at(row)
            posed = pose_hand(hand, track.poses[row], track.references[row])
            joints = as_stated(corrected_joints(hand, posed, offsets), lens)
            result[row] = np.linalg.norm(joints - truth.joints, axis=1)
    return result


if __name__ == "__main__":
    main()
