"""``spf compare``: trackers side by side on one session."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.console import Console
from rich.table import Table

from spf.cli.console import (
    INTERRUPTED,
    complain,
    open_given,
    parse_assignments,
    parse_range,
    print_json,
    progress_bar,
    warn,
)
from spf.cli.sessions import AsJson, CameraFile, Force, SessionPath
from spf.cli.tracking import FrameRange, HandFile, Init
from spf.compare import COMPARISON, check_free, compare, contenders_of, draw_success, prepare_comparison, table
from spf.hand import read_hand_shape
from spf.parallel import threads
from spf.trackers import PRESETS, TRACKERS

__all__ = ["compare_trackers"]

_FIGURE = "success.svg"


def compare_trackers(
    session: SessionPath,
    output: Annotated[Path, typer.Option("--output", "-o", metavar="DIR", help="Directory of the comparison.")],
    trackers: Annotated[
        str,
        typer.Option(
            metavar="A,B,…",
            help=f"Some of {', '.join(TRACKERS)}; LABEL=TRACKER lets one take part again with other settings.",
        ),
    ] = ",".join(TRACKERS),
    seeds: Annotated[int, typer.Option(min=1, help="Number of seeds, from 0 on.")] = 5,
    presets: Annotated[
        list[str] | None,
        typer.Option(
            "--preset",
            metavar="[LABEL=]PRESET",
            help=f"One of {', '.join(PRESETS)}, a saved one or its file, for all or one; repeatable.",
        ),
    ] = None,
    assignments: Annotated[
        list[str] | None,
        typer.Option("--set", metavar="[LABEL.]NAME=VALUE", help="Change a setting of all or of one; repeatable."),
    ] = None,
    hand: HandFile = None,
    init: Init = "auto",
    frames: FrameRange = None,
    equal_time: Annotated[
        bool, typer.Option("--equal-time", help="Give all about the time per frame that spf takes with N = 4.")
    ] = False,
    jobs: Annotated[
        int | None, typer.Option(min=1, help="Processes, each with one thread; as many as cores if not given.")
    ] = None,
    camera: CameraFile = None,
    force: Force = False,
    as_json: AsJson = False,
) -> None:
    """Run trackers on one session from the same starts, and say how well each does.

    Examples:

        spf compare sessions/fast-wave.mcap -o runs/compared --trackers spf,smd,apf --init truth

        spf compare recordings/P5 -o runs/fair --equal-time --seeds 3 --frames 0:100

        spf compare recordings/P5 -o runs/points --trackers apf,few=apf --preset paper --set few.points=45
    """
    check_free(output, force)
    contenders = contenders_of(
        [name.strip() for name in trackers.split(",") if name.strip()],
        presets or [],
        parse_assignments(assignments or []),
    )
    content: dict[str, Any] = {}
    with open_given(session, camera) as opened, progress_bar() as report:
        first, last = parse_range(frames, len(opened))
        comparison = prepare_comparison(
            opened, contenders, range(seeds), command=["spf", *sys.argv[1:]], camera=camera,
            shape=None if hand is None else read_hand_shape(hand), init=init, first=first, last=last, progress=report,
        )  # fmt: skip
        for seed, start in comparison.starts.items():
            for sentence in (start.doubt, start.remark):
                warn(sentence and f"seed {seed}: {sentence}")
        interrupted = False
        try:
            for so_far in compare(comparison, output, jobs=jobs or threads(), equal_time=equal_time, progress=report):
                content = so_far
        except KeyboardInterrupt:
            interrupted = True
    drawn = bool(content) and draw_success(content, output / _FIGURE)
    _show(content, output, as_json, drawn)
    if interrupted:
        complain(f"stopped: the {len(content.get('runs', ()))} runs that were finished are kept in {output}.")
        raise typer.Exit(INTERRUPTED)


def _show(content: dict[str, Any], output: Path, as_json: bool, drawn: bool) -> None:
    if not content:
        return
    if as_json:
        print_json(content)
        return
    heading, *rows = table(content)
    shown = Table(*heading, box=None, header_style="bold", pad_edge=False)
    for column in shown.columns[1:]:
        column.justify = "right"
    for row in rows:
        shown.add_row(*row)
    Console(width=max(Console().width, 120)).print(shown)
    print(f"ms/frame is processor time on one thread. Wrote {output / COMPARISON}", end="")
    print(f" and {output / _FIGURE}." if drawn else "; without ground truth there are no success curves.")
