"""How well the hand is held: ``uv run python -m benchmarks.holds [--quick] [--recording FOLDER …] [--json PATH]``.

Fresh synthetic sessions of many kinds and recordings with truth are tracked from an automatic start that is told nothing;
one table has, for each kind and number of particles, the joint error with its spread, the floor that no search undercuts,
gross errors, losses, wrong sides and time, beside the bar that is asked. See docs/evaluation.md.
"""

from __future__ import annotations

import argparse
import json
import os
import sys
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor, as_completed
from pathlib import Path
from typing import Any

from benchmarks.holds.layout import stamp
from benchmarks.holds.sessions import KINDS, Source, recordings, synthetic
from benchmarks.holds.table import lay_out, row_of, worst
from benchmarks.holds.tracking import Asked, held
from spf.errors import SpfError
from spf.trackers import PRESETS, TRACKERS, make_settings

_QUICK = {"sessions": 3, "frames": 60, "seeds": 1}
_FULL = {"sessions": 15, "frames": 120, "seeds": 5}
_USUAL = ("slow", "medium", "fast")


def main(arguments: list[str] | None = None) -> None:
    """Track everything that is asked for, print the table and write the JSON."""
    options = _parse(arguments)
    asked = Asked(
        options.tracker,
        options.preset,
        tuple(options.n),
        dict(text.split("=", 1) for text in options.set),
        options.init,
    )
    runs: list[dict[str, Any]] = []
    try:
        make_settings(asked.tracker, asked.preset, asked.changes)
        for done in _all_held(_sources(options), asked, options.jobs):
            runs += done
            _tell(done)
            if options.json is not None:
                _write(options, runs)
    except SpfError as error:
        sys.exit(f"holds: {error}")
    print(lay_out(_rows(runs)))
    print(f"\n{', commit '.join(stamp().values())}; {' '.join(sys.argv[1:]) or 'all defaults'}")
    print("\n".join(["", "Farthest above the floor:", *worst(runs, options.worst)]))


def _parse(arguments: list[str] | None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="benchmarks.holds", description="How well the hand is held.")
    parser.add_argument("--quick", action="store_true", help="a few minutes: 3 sessions a kind, 60 frames, 1 seed")
    parser.add_argument(
        "--kinds", nargs="*", default=list(_USUAL), choices=[*KINDS, "all"], metavar="KIND",
        help=f"kinds of synthetic session: {', '.join(KINDS)}; all; nothing for none (slow medium fast)",
    )  # fmt: skip
    parser.add_argument("--sessions", type=int, help="synthetic sessions of each kind (15)")
    parser.add_argument("--first", type=int, default=0, help="number of the first of them (0)")
    parser.add_argument("--frames", type=int, help="frames of a session (120; recordings whole)")
    parser.add_argument(
        "--recording",
        nargs="*",
        action="extend",
        default=[],
        metavar="FOLDER[,CAMERA.json]",
        help="recordings beside them",
    )
    parser.add_argument("--seeds", type=int, help="seeds of each recording (5)")
    parser.add_argument("--n", type=int, nargs="+", default=[4, 8], help="numbers of particles (4 8)")
    parser.add_argument("--tracker", default="spf", choices=list(TRACKERS))
    parser.add_argument("--preset", default="default", choices=list(PRESETS))
    parser.add_argument("--init", default="auto", choices=("auto", "truth"))
    parser.add_argument("--set", action="append", default=[], metavar="NAME=VALUE", help="change a setting; repeatable")
    parser.add_argument("--jobs", type=int, default=1, help="processes; with more than one, each has one thread (1)")
    parser.add_argument("--worst", type=int, default=10, help="how many of the worst runs are described (10)")
    parser.add_argument("--json", type=Path, metavar="PATH", help="write every run there, as they are done")
    options = parser.parse_args(arguments)
    if any("=" not in text for text in options.set):
        parser.error("--set takes name=value")
    if "all" in options.kinds:
        options.kinds = list(KINDS)
    if not options.kinds and not options.recording:
        parser.error("name a kind or a recording")
    options.whole = options.frames is None and not options.quick
    for name, value in (_QUICK if options.quick else _FULL).items():
        if getattr(options, name) is None:
            setattr(options, name, value)
    return options


def _sources(options: argparse.Namespace) -> list[Source]:
    made = [
        source for kind in options.kinds for source in synthetic(kind, options.first, options.sessions, options.frames)
    ]
    most = sys.maxsize if options.whole else options.frames
    return made + [source for path in options.recording for source in recordings(path, options.seeds, most)]


def _all_held(sources: list[Source], asked: Asked, jobs: int) -> Iterator[list[dict[str, Any]]]:
    """Track sessions one after the other, or in processes of one thread each."""
    if jobs == 1:
        yield from (held(source, asked) for source in sources)
        return
    with ProcessPoolExecutor(jobs, initializer=_alone) as pool:
        yield from (
            future.result() for future in as_completed([pool.submit(held, source, asked) for source in sources])
        )


def _alone() -> None:
    os.environ["SPF_THREADS"] = "1"


def _tell(done: list[dict[str, Any]]) -> None:
    for run, row in ((run, row_of([run])) for run in done):
        mean = "" if row["mean_mm"] is None else f"{row['mean_mm']:.1f} mm (floor {row['floor_mm']:.1f}), "
        side = {True: "right side, ", False: "WRONG side, ", None: ""}[run["right_side"]]
        print(
            f"  {run['session']} ({run['kind']}) seed {run['seed']} N={run['n']}: {mean}{side}"
            f"{row['frames_lost']} lost, {row['ms']:.0f} ms, start {run['start_seconds']:.0f} s",
            file=sys.stderr, flush=True,
        )  # fmt: skip


def _rows(runs: list[dict[str, Any]]) -> list[dict[str, Any]]:
    groups: dict[tuple[str, int], list[dict[str, Any]]] = {}
    for run in runs:
        groups.setdefault((run["kind"], run["n"]), []).append(run)
    return [row_of(group) for group in groups.values()]


def _write(options: argparse.Namespace, runs: list[dict[str, Any]]) -> None:
    said = {name: str(value) if isinstance(value, Path) else value for name, value in vars(options).items()}
    content = {**stamp(), "options": said}
    options.json.parent.mkdir(parents=True, exist_ok=True)
    options.json.write_text(json.dumps({**content, "rows": _rows(runs), "runs": runs}) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
