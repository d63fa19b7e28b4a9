"""``spf report`` and ``spf export``: a run as a page to be read, and as files for other programs."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Annotated

import typer

from spf.cli.console import check_output, progress_bar
from spf.cli.sessions import Force
from spf.errors import RunError, SettingError
from spf.export import VIEWS, View, write_film, write_hand, write_picture, write_table
from spf.export.tables import TABLES
from spf.render import Renderer
from spf.report import write_report
from spf.runs import read_run, reopen_session

__all__ = ["COMMANDS", "export", "report"]

RunDirectory = Annotated[Path, typer.Argument(metavar="DIR", help="Directory of a run.")]
MovedSession = Annotated[
    str | None, typer.Option("--session", metavar="SESSION", help="Where the session lies now, if it was moved.")
]
_PICTURES = (".png", ".jpg")


def report(
    directory: RunDirectory,
    output: Annotated[Path, typer.Option("--output", "-o", metavar="FILE.html", help="The file to write.")],
    session: MovedSession = None,
    no_session: Annotated[
        bool,
        typer.Option("--no-session", help="Without the session: no pictures, no errors; only what the track says."),
    ] = False,
    force: Force = False,
) -> None:
    """Write a run as one HTML page that opens anywhere, offline.

    Example:  spf report runs/first -o first.html
    """
    if output.suffix.lower() not in (".html", ".htm"):
        raise SettingError(f"A report is an HTML file: name it something like {output.with_suffix('.html')}.")
    if no_session and session is not None:
        raise SettingError("--session and --no-session exclude each other: leave one out.")
    check_output(output, force)
    run = read_run(directory)
    if session is None and not no_session and not Path(run.manifest["session"]["uri"]).exists():
        raise RunError(
            f"The session of this run, {run.manifest['session']['uri']}, is gone: name where it lies with --session, or "
            "report only what the track says with --no-session."
        )
    with progress_bar() as progress:
        if no_session:
            write_report(run, None, output, None, directory=str(directory), progress=progress)
        else:
            with reopen_session(run.manifest, session, progress) as opened, Renderer() as renderer:
                write_report(run, opened, output, renderer, directory=str(directory), progress=progress)
    print(f"Wrote {output} ({output.stat().st_size / 2**20:.1f} MB): open it in any browser.")


def export(
    directory: RunDirectory,
    output: Annotated[
        Path,
        typer.Option(
            "--output",
            "-o",
            metavar="FILE",
            help="Its ending says what is written: .csv or .parquet the track, .png or .jpg a picture, .mp4 a film, .json "
            "the hand as its shape was refined.",
        ),
    ],
    frame: Annotated[
        int | None, typer.Option(help="Of a picture: which frame; the first that shows the hand. Of a hand: the last.")
    ] = None,
    view: Annotated[str, typer.Option(help=f"Of a picture or film: {', '.join(VIEWS)}.")] = "sensor",
    azimuth: Annotated[float, typer.Option(help="Degrees to the right of the view.")] = 0.0,
    elevation: Annotated[float, typer.Option(help="Degrees above the view.")] = 0.0,
    zoom: Annotated[float, typer.Option(help="Magnification.", min=0.1, max=20.0)] = 1.0,
    height: Annotated[
        int | None, typer.Option(help="Pixels; 960 of a picture, 480 of a film.", min=96, max=1440)
    ] = None,
    speed: Annotated[float, typer.Option(help="Of a film: times the session's own pace.", min=0.05, max=20.0)] = 1.0,
    session: MovedSession = None,
    force: Force = False,
) -> None:
    """Write a run for other programs: its track, a picture of a frame, a film; or its hand, for ``spf track --hand``.

    Examples:

        spf export runs/first -o track.csv

        spf export runs/first -o frame.png --frame 30 --view side

        spf export runs/first -o run.mp4

        spf export runs/first -o hand.json
    """
    ending = output.suffix.lower()
    if ending not in (*TABLES, *_PICTURES, ".mp4", ".json"):
        known = ", ".join((*TABLES, *_PICTURES, ".mp4", ".json"))
        raise SettingError(f"The file's ending says what is written, one of {known}; '{output.name}' has none of them.")
    check_output(output, force)
    run = read_run(directory)
    if ending in TABLES:
        write_table(run.track, output)
        print(f"Wrote {len(run.track)} frames to {output}.")
        return
    if ending == ".json":
        shown = write_hand(run, output, frame)
        print(f"Wrote the hand of frame {shown} to {output}: 'spf track --hand {output}' begins with it.")
        return
    side = _view(view, azimuth, elevation, zoom)
    with progress_bar() as progress, reopen_session(run.manifest, session, progress) as opened, Renderer() as renderer:
        if ending == ".mp4":
            write_film(run, opened, output, renderer, view=side, height=height or 480, speed=speed, progress=progress)
        else:
            pixels = height or 960
            chosen = int(run.track.frame[int(run.track.lost.argmin())]) if frame is None else frame
            write_picture(run, opened, chosen, output, renderer, view=side, size=(round(pixels * 4 / 3), pixels))
    print(f"Wrote {output}.")


def _view(name: str, azimuth: float, elevation: float, zoom: float) -> View:
    if name not in VIEWS:
        raise SettingError(f"There is no view '{name}'; the views are {', '.join(VIEWS)}.")
    base = VIEWS[name]
    return View(base.azimuth + math.radians(azimuth), base.elevation + math.radians(elevation), zoom)


COMMANDS = (report, export)
