"""Hard kidnaps: ``uv run python -m benchmarks.holds.kidnaps [--count 30] [--recording FOLDER …] [--json PATH]``.

Between two frames the hand jumps by 14 cm and turns by 150°. In a synthetic session the hand itself jumps, with its forearm;
in a recording the tracker is told instead that the hand was elsewhere. Noted are when the loss was noticed and when the hand was
held again, within 20 mm of the floor (SMD begun at the truth) and for three frames. Bars: noticed within 5 frames, recovered
within 10, all of them.
"""

from __future__ import annotations

import argparse
import dataclasses
import json
import sys
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from benchmarks.holds.labels import as_labelled, hand_of_labels
from benchmarks.holds.layout import markdown, stamp
from benchmarks.holds.sessions import KINDS, open_source, recordings, session_settings
from spf.errors import SpfError
from spf.evaluate.contradictions import CONTRADICTED, label_energy
from spf.evaluate.floor import floor_of
from spf.filters.step import start_at
from spf.frame import Frame
from spf.hand.kinematics import joints_of, relative_to_camera
from spf.hand.model import Hand
from spf.lens import seen_through
from spf.prepare import SessionFrames, prepare
from spf.sessions import Session
from spf.synthetic import SyntheticSession, synthesise
from spf.track import Tracking, TrackState, begin, reshaped, track_frame
from spf.trackers import make_settings

__all__ = ["kidnapped", "main"]

Array = NDArray[np.float64]
_JUMP, _TURN = 0.14, np.radians(150.0)  # m and rad between two frames
_BEFORE, _AFTER = 15, 15  # frames before the kidnap, for the tracker to know the hand, and after it
_HELD_MM, _HELD_FRAMES = 20.0, 3  # above the floor, and for so long, counts as held
_NOTICED, _RECOVERED = 5, 10  # frames: the bars
_USUAL = ("medium", "body", "table", "second_hand")
_SKIN = 0.02  # m of hand around a joint
_SEEN = 0.4  # of the pixels in which the sensor saw the hand before, at least
_WAYS = (1.0, 1.0, 0.5)  # a jump goes less along the line of sight than across it
_CHECKED = 4  # frames after the jump, spread, in which it must be
_DRAWS = 500


def main(arguments: list[str] | None = None) -> None:
    """Kidnap, print the table and write the JSON."""
    options = _parse(arguments)
    tried: list[dict[str, Any]] = []
    groups = [*options.kinds, *options.recording]
    shares = [len(part) for part in np.array_split(np.arange(options.count), len(groups))]
    try:
        for group, share in zip(groups, shares, strict=True):
            of_session = group in options.kinds
            made = _synthetic(group, options.first, share) if of_session else _recorded(group, share)
            for one in made:
                tried.append(one)
                print(_told(one), file=sys.stderr, flush=True)
                if options.json is not None:
                    content = json.dumps({**stamp(), "rows": _rows(tried), "kidnaps": tried})
                    options.json.parent.mkdir(parents=True, exist_ok=True)
                    options.json.write_text(content + "\n", encoding="utf-8")
    except SpfError as error:
        sys.exit(f"kidnaps: {error}")
    print(_table(_rows(tried)))


def _parse(arguments: list[str] | None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="benchmarks.holds.kidnaps", description="Hard kidnaps.")
    parser.add_argument("--count", type=int, default=30, help="kidnaps in all, dealt over kinds and recordings (30)")
    parser.add_argument("--first", type=int, default=0, help="number of the first synthetic session of each kind (0)")
    parser.add_argument("--kinds", nargs="*", default=list(_USUAL), choices=list(KINDS), metavar="KIND")
    parser.add_argument(
        "--recording",
        nargs="*",
        action="extend",
        default=[],
        metavar="FOLDER",
        help="recordings with truth beside them",
    )
    parser.add_argument("--json", type=Path, metavar="PATH")
    options = parser.parse_args(arguments)
    if not options.kinds and not options.recording:
        parser.error("name a kind or a recording")
    return options


def kidnapped(session: SyntheticSession, at: int, rng: np.random.Generator) -> SyntheticSession:
    """Return a session whose hand jumps by 14 cm and turns by 150° between frames ``at`` − 1 and ``at``, and is seen there.

    Raises:
        ValueError: there is no room in the view.
    """
    trajectory = session.stage.trajectory
    seen = _pixels(session, at - 1)
    for _ in range(_DRAWS):
        poses, orientations = trajectory.poses.copy(), trajectory.orientations.copy()
        poses[at:, :3] += _direction(rng, _WAYS) * _JUMP
        orientations[at:] = Rotation.from_rotvec(_direction(rng) * _TURN).as_matrix() @ orientations[at:]
        stage = session.stage._replace(trajectory=trajectory._replace(poses=poses, orientations=orientations))
        made = dataclasses.replace(session, stage=stage)
        after = np.linspace(at, len(made) - 1, _CHECKED).astype(int)
        if _is_clear(made, at) and all(_pixels(made, int(index)) > _SEEN * seen for index in after):
            return made  # neither out of the view, nor in what else is in the scene, nor behind it, nor seen end on
    raise ValueError(f"The hand of {session.name} cannot jump anywhere without leaving the view.")


def _pixels(session: SyntheticSession, index: int) -> int:
    """Count the pixels in which the sensor sees the hand."""
    return int((session.hand_mask(index) & (session[index].depth > 0.0)).sum())


def _is_clear(session: SyntheticSession, first: int) -> bool:
    """Whether the whole hand is in the view, and nowhere in a table or a wall, from a frame on."""
    trajectory, background = session.stage.trajectory, session.stage.clutter.background
    for pose, orientation in zip(trajectory.poses[first:], trajectory.orientations[first:], strict=True):
        joints = joints_of(session.hand, pose, orientation)
        if joints[:, 2].min() < _SKIN:
            return False
        u, v = np.round(session.camera.project(joints)).astype(int).T
        if min(u.min(), v.min()) < 0 or u.max() >= session.camera.width or v.max() >= session.camera.height:
            return False
        if (joints[:, 2] + _SKIN > background[v, u]).any():
            return False
    return True


def _direction(rng: np.random.Generator, weights: tuple[float, float, float] = (1.0, 1.0, 1.0)) -> Array:
    axis = rng.normal(size=3) * np.array(weights)
    return np.asarray(axis / np.linalg.norm(axis))


def _synthetic(kind: str, first: int, count: int) -> list[dict[str, Any]]:
    """Kidnap the hand of sessions of a kind, each tracked with its exact shape from the truth."""
    return [_of_session(kind, number) for number in range(first, first + count)]


def _of_session(kind: str, number: int) -> dict[str, Any]:
    settings = session_settings(kind, number, _BEFORE + _AFTER)
    session = kidnapped(synthesise(settings), _BEFORE, np.random.default_rng([number, 11]))
    start = prepare(session, init="truth", seed=number)
    tracking, state = begin("spf", make_settings("spf"), start, number, time=float(session.times[start.frame]))
    for index in range(start.frame, _BEFORE):
        state, _ = track_frame(tracking, state, session[index])
    told = {
        "kind": kind,
        "number": number,
        "session": session.name,
        "at": _BEFORE,
        "shows": session.metadata["synthetic"],
    }
    frames = SessionFrames(session, _BEFORE, _BEFORE + _AFTER)
    return told | _followed(session, tracking, state, frames, session.hand)


def _recorded(path: str, count: int) -> list[dict[str, Any]]:
    """Kidnap the tracker of a recording at frames spread over it, whose labels the depth does not contradict."""
    source = recordings(path, 1, sys.maxsize)[0]
    session = open_source(source)
    start = prepare(session, seed=0)
    lens = start.shape.lens
    labelled = hand_of_labels(session, lens)
    rows: list[dict[str, Any]] = []
    for turn, wanted in enumerate(
        np.linspace(start.frame + _BEFORE, len(session) - _AFTER, count + 2)[1:-1].astype(int)
    ):
        rng = np.random.default_rng([turn, 13])
        ahead = range(wanted, len(session) - _AFTER)
        at = next(
            (i for i in ahead if label_energy(labelled, seen_through(session[i], lens)) < CONTRADICTED), int(wanted)
        )
        tracking, state = begin("spf", make_settings("spf"), start, turn, time=float(session.times[start.frame]))
        held = floor_of(labelled, session[at - 1], rng, lens=lens)
        assert held is not None
        pose = held.pose.copy()
        pose[:3] += _direction(rng, _WAYS) * _JUMP
        reference = Rotation.from_rotvec(_direction(rng) * _TURN).as_matrix() @ held.reference
        elsewhere = start_at(
            tracking.hand, pose, reference, float(session.times[at - 1]), len(state.filter.particles.poses)
        )
        state = state._replace(
            filter=elsewhere, fresh=False, history=(start.golden,) * 10, golden=start.golden,
            held=relative_to_camera(pose, reference),
        )  # fmt: skip
        told = {"kind": source.kind, "number": turn, "session": session.name, "at": int(at), "shows": ""}
        rows.append(told | _followed(session, tracking, state, SessionFrames(session, at, at + _AFTER), labelled))
    return rows


def _followed(
    session: Session, tracking: Tracking, state: TrackState, frames: SessionFrames, labelled: Hand
) -> dict[str, Any]:
    """Track on after a kidnap, and say when it was noticed and when the hand was held again, in frames; None for never."""
    above, lost, seconds = [], [], []
    for frame in frames:
        state, result = track_frame(tracking, state, frame)
        own = as_labelled(session, reshaped(tracking, result.shape_change).hand)
        joints = joints_of(own, result.pose, result.reference)
        if isinstance(session, SyntheticSession):
            assert frame.truth is not None
            above.append(_apart_mm(joints, frame.truth.joints))
        else:
            above.append(_above_floor_mm(joints, seen_through(frame, tracking.start.shape.lens), labelled))
        lost.append(bool(result.lost))
        seconds.append(result.seconds)
    held = np.array([a is not None and a < _HELD_MM for a in above])
    again = [i for i in range(len(held) - _HELD_FRAMES + 1) if held[i : i + _HELD_FRAMES].all()]
    recovered = None if not again else again[0] + 1
    noticed = next((i + 1 for i, flag in enumerate(lost) if flag), None)
    return {
        "noticed": noticed, "recovered": recovered, "lost": lost, "above_floor_mm": above, "seconds": seconds,
        "lost_again": bool(recovered is not None and not held[recovered - 1 :].all()),
    }  # fmt: skip


def _above_floor_mm(joints: Array, frame: Frame, labelled: Hand) -> float | None:
    """Mean distance from the joints of the floor's pose, mm; None where a frame has no floor."""
    floor = floor_of(labelled, frame, np.random.default_rng(frame.index), exact=True)
    if floor is None:
        return None
    return _apart_mm(joints, joints_of(labelled, floor.pose, floor.reference))


def _apart_mm(joints: Array, others: Array) -> float:
    return round(1e3 * float(np.linalg.norm(joints - others, axis=1).mean()), 2)


def _told(one: dict[str, Any]) -> str:
    noticed = "never noticed" if one["noticed"] is None else f"noticed after {one['noticed']}"
    recovered = "NEVER recovered" if one["recovered"] is None else f"recovered after {one['recovered']}"
    path = " ".join("–" if value is None else f"{value:.0f}" for value in one["above_floor_mm"])
    return f"  {one['kind']} {one['number']} ({one['session']}, frame {one['at']}): {noticed}, {recovered}; mm: {path}"


def _rows(tried: list[dict[str, Any]]) -> list[dict[str, Any]]:
    rows = []
    for kind in [*dict.fromkeys(one["kind"] for one in tried), "all"]:
        own = [one for one in tried if kind in ("all", one["kind"])]
        recovered = [one["recovered"] for one in own if one["recovered"] is not None]
        rows.append({
            "kind": kind, "kidnaps": len(own),
            "noticed": float(np.mean([any(_in_time(one[key], _NOTICED) for key in ("noticed", "recovered")) for one in own])),
            "recovered": float(np.mean([_in_time(one["recovered"], _RECOVERED) for one in own])),
            "ever": len(recovered), "median": float(np.median(recovered)) if recovered else None,
            "longest": max(recovered) if recovered else None, "lost_again": sum(one["lost_again"] for one in own),
        })  # fmt: skip
    return rows


def _in_time(frames: int | None, limit: int) -> bool:
    return frames is not None and frames <= limit


def _table(rows: list[dict[str, Any]]) -> str:
    headings = (
        "kind", "kidnaps", f"noticed or held in {_NOTICED}", f"recovered in {_RECOVERED}", "recovered ever", "median frames",
        "longest", "not held to the end",
    )  # fmt: skip
    cells: list[tuple[str, ...]] = [headings]
    for r in rows:
        median, longest = ("–" if r[key] is None else f"{r[key]:g}" for key in ("median", "longest"))
        cells.append((
            r["kind"], str(r["kidnaps"]), f"{100 * r['noticed']:.0f} %", f"{100 * r['recovered']:.0f} %", str(r["ever"]),
            median, longest, str(r["lost_again"]),
        ))  # fmt: skip
    return markdown(cells)


if __name__ == "__main__":
    main()
