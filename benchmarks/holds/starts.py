"""Random starts: ``uv run python -m benchmarks.holds.starts [--count 100] [--recording FOLDER …] [--json PATH]``.

The automatic start is given one frame, taken at random, and the ten frames from there on, and told nothing else: neither
size nor side. After one frame and after ten the pose is compared with the floor's (SMD begun at the truth); a start counts as
found when it lies within 20 mm of that. Bars: 90 % after one frame, 98 % after ten, the right side in 95 %.
"""

from __future__ import annotations

import argparse
import json
import sys
import time
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from benchmarks.holds.labels import as_labelled, hand_of_labels, true_side
from benchmarks.holds.layout import markdown, stamp
from benchmarks.holds.sessions import KINDS, Source, open_source, recordings, synthetic
from spf.errors import SpfError, StartError
from spf.evaluate.contradictions import CONTRADICTED, label_energy
from spf.evaluate.floor import floor_of
from spf.hand.kinematics import joints_of
from spf.hand.model import Hand
from spf.initialise import Start, find_start
from spf.lens import as_stated
from spf.prepare import SessionFrames
from spf.sessions import Session
from spf.track import begin, reshaped, track_frame
from spf.trackers import make_settings

__all__ = ["main"]

Array = NDArray[np.float64]

_FOUND_MM = 20.0
_GIVEN = (1, 10)  # frames that the start is given
_LENGTH = 40  # frames of the synthetic sessions that a frame is drawn from
_USUAL = ("medium", "back", "any_view", "body", "table")


class _Place(NamedTuple):
    """A frame to start in."""

    source: Source
    frame: int


def main(arguments: list[str] | None = None) -> None:
    """Start everywhere, print the table and write the JSON."""
    options = _parse(arguments)
    tried: list[dict[str, Any]] = []
    try:
        for place in _places(options):
            done = _started(place)
            tried += done
            print("\n".join(_told(one) for one in done), file=sys.stderr, flush=True)
            if options.json is not None:
                content = json.dumps({**stamp(), "rows": _rows(tried), "starts": tried})
                options.json.parent.mkdir(parents=True, exist_ok=True)
                options.json.write_text(content + "\n", encoding="utf-8")
    except SpfError as error:
        sys.exit(f"starts: {error}")
    print(_table(_rows(tried)))


def _parse(arguments: list[str] | None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="benchmarks.holds.starts", description="Automatic starts in random frames.")
    parser.add_argument("--count", type=int, default=100, help="starts in all, dealt over kinds and recordings (100)")
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


def _places(options: argparse.Namespace) -> list[_Place]:
    """Deal the starts over kinds and recordings; a recording's, among those whose compared frames no label contradicts."""
    groups = [*options.kinds, *options.recording]
    shares = [len(part) for part in np.array_split(np.arange(options.count), len(groups))]
    places: list[_Place] = []
    for group, share in zip(groups, shares, strict=True):
        if group in options.kinds:
            for source in synthetic(group, options.first, share, _LENGTH):
                rng = np.random.default_rng([source.number, 3])
                places.append(_Place(source, int(rng.integers(_LENGTH - max(_GIVEN)))))
        else:
            places += _in_recording(recordings(group, 1, sys.maxsize)[0], share)
    return places


def _in_recording(source: Source, count: int) -> list[_Place]:
    session, rng = open_source(source), np.random.default_rng(5)
    hand = hand_of_labels(session)
    places: list[_Place] = []
    for index in rng.permutation(len(session) - max(_GIVEN)):
        if len(places) == count:
            break
        compared = (session[int(index) + given - 1] for given in _GIVEN)
        if all(label_energy(hand, frame) < CONTRADICTED for frame in compared):
            places.append(_Place(source, int(index)))
    return places


def _started(place: _Place) -> list[dict[str, Any]]:
    """Start in a frame, given one frame and given ten."""
    session = open_source(place.source)
    hand, side = hand_of_labels(session), true_side(session)
    return [_found(session, place, given, hand, side) for given in _GIVEN]


def _found(session: Session, place: _Place, given: int, hand: Hand, side: str | None) -> dict[str, Any]:
    frames = SessionFrames(session, place.frame, place.frame + given)
    row: dict[str, Any] = {
        "kind": place.source.kind, "number": place.source.number, "session": session.name, "frame": place.frame,
        "given": given,
    }  # fmt: skip
    began = time.perf_counter()
    try:
        start = find_start(frames, np.random.default_rng([place.source.number + 1, place.frame, given]))
    except StartError:
        return row | {
            "apart_mm": None,
            "right_side": False,
            "golden": 1.0,
            "doubt": "no hand",
            "size": None,
            "seconds": 0.0,
        }
    seconds = time.perf_counter() - began
    lens = start.shape.lens
    found, *posed = (start.shape.hand(), start.pose, start.reference) if given == 1 else _followed(frames, start)
    floor = floor_of(hand, frames[-1], np.random.default_rng(0), exact=True)
    apart = None
    if floor is not None:
        joints = as_stated(joints_of(as_labelled(session, found), *posed), lens)
        apart = _apart_mm(joints, joints_of(hand, floor.pose, floor.reference))
    return row | {
        "apart_mm": apart, "right_side": start.shape.side == side, "golden": start.golden, "margin": start.margin,
        "doubt": start.doubted or "", "size": found.length / hand.length, "seconds": seconds,
    }  # fmt: skip


def _followed(frames: SessionFrames, start: Start) -> tuple[Hand, Array, Array]:
    """Track from a start to the last frame: (hand, pose, reference) there."""
    tracking, state = begin("spf", make_settings("spf"), start, 0, time=frames[start.frame].time)
    for frame in frames[start.frame :]:
        state, result = track_frame(tracking, state, frame)
    return reshaped(tracking, result.shape_change).hand, result.pose, result.reference


def _apart_mm(joints: Array, others: Array) -> float:
    return 1e3 * float(np.linalg.norm(joints - others, axis=1).mean())


def _told(one: dict[str, Any]) -> str:
    apart = "nothing" if one["apart_mm"] is None else f"{one['apart_mm']:.0f} mm"
    side = "" if one["right_side"] else ", WRONG side"
    doubt = f", doubted: {one['doubt']}" if one["doubt"] else ""
    return (
        f"  {one['kind']} {one['number']} frame {one['frame']} ({one['session']}), {one['given']} given: {apart}{side}, "
        f"golden {one['golden']:.2f}{doubt}, {one['seconds']:.0f} s"
    )


def _rows(tried: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """Shares by kind and number of frames given, then those over everything."""
    kinds = [*dict.fromkeys(one["kind"] for one in tried), "all"]
    rows = []
    for kind in kinds:
        for given in _GIVEN:
            own = [one for one in tried if one["given"] == given and kind in ("all", one["kind"])]
            found = np.array([one["apart_mm"] is not None and one["apart_mm"] < _FOUND_MM for one in own])
            doubted = np.array([bool(one["doubt"]) for one in own])
            rows.append({
                "kind": kind, "given": given, "starts": len(own), "found": float(found.mean()),
                "right_side": float(np.mean([one["right_side"] for one in own])),
                "median_mm": float(np.median([one["apart_mm"] for one in own if one["apart_mm"] is not None])),
                "failures_doubted": float(doubted[~found].mean()) if (~found).any() else None,
                "found_doubted": float(doubted[found].mean()) if found.any() else None,
                "seconds": float(np.median([one["seconds"] for one in own])),
            })  # fmt: skip
    return rows


def _table(rows: list[dict[str, Any]]) -> str:
    def share(value: float | None) -> str:
        return "–" if value is None else f"{100 * value:.0f} %"

    headings = (
        "kind",
        "frames",
        "starts",
        "< 20 mm",
        "right side",
        "median mm",
        "failures doubted",
        "found doubted",
        "s",
    )
    cells = [headings] + [
        (
            r["kind"], str(r["given"]), str(r["starts"]), share(r["found"]), share(r["right_side"]), f"{r['median_mm']:.1f}",
            share(r["failures_doubted"]), share(r["found_doubted"]), f"{r['seconds']:.0f}",
        )
        for r in rows
    ]  # fmt: skip
    return markdown(cells)


if __name__ == "__main__":
    main()
