"""The run that a page shows as files: what each is called, and how it is made from what is in memory."""

from __future__ import annotations

import tempfile
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import NamedTuple

from app.shelf import plan_of_lane, run_of
from app.state import State
from spf.errors import StartError
from spf.export import View, write_film, write_picture, write_table
from spf.progress import Report
from spf.render import Renderer
from spf.report import write_report
from spf.runs import Run
from spf.sessions import Session

__all__ = ["EXPORTS", "Export", "Wanted", "exported", "wanted_of"]


class Export(NamedTuple):
    """One kind of file: its ending, what is written on its button, the icon, and what is said while it is made."""

    ending: str
    label: str
    icon: str
    task: str


EXPORTS = (
    Export(".html", "Report", "description", "Writing the report"),
    Export(".csv", "Track CSV", "table_view", "Writing the track"),
    Export(".parquet", "Track Parquet", "table_chart", "Writing the track"),
    Export(".png", "Picture", "image", "Drawing the picture"),
    Export(".mp4", "Film", "movie", "Writing the film"),
)


class Wanted(NamedTuple):
    """What is exported, fixed when the button is pressed.

    Attributes:
        session: that is tracked.
        run: makes the run, in the worker: the session's fingerprint takes a while.
        directory: where the page keeps the run, or "RUN" before it is kept.
        frame: that is shown.
        view: that it is seen from.
    """

    session: Session
    run: Callable[[], Run]
    directory: str
    frame: int
    view: View


def wanted_of(state: State, folder: Path) -> Wanted:
    """Return what a page shows now, ready to be exported.

    Args:
        state: of the page.
        folder: that the page keeps its runs in.

    Raises:
        StartError: nothing is tracked yet.
    """
    lane, session, origin = state.lane, state.session, state.origin
    if session is None or origin is None or not lane.results.summaries:
        raise StartError("Nothing is tracked yet: press Start, then Step or Play, and export what was tracked.")
    plan, label, rows = plan_of_lane(lane, origin, state.init), lane.label or lane.title, lane.results.rows
    run = partial(run_of, plan, session, state.camera, label, rows)
    directory = str(folder / lane.folder.run) if lane.folder.run else "RUN"
    return Wanted(session, run, directory, state.frame, View(state.azimuth, state.elevation, state.zoom))


def exported(wanted: Wanted, ending: str, renderer: Renderer) -> Callable[[Report], tuple[str, bytes]]:
    """Return the work that makes a file and returns its name and content.

    Args:
        wanted: from :func:`wanted_of`.
        ending: of one of :data:`EXPORTS`.
        renderer: of the server.
    """

    def work(report: Report) -> tuple[str, bytes]:
        run, session = wanted.run(), wanted.session
        name = f"{session.name}-{run.plan.tracker}" + (f"-frame-{wanted.frame}" if ending == ".png" else "") + ending
        with tempfile.TemporaryDirectory(prefix="spf-export-") as folder:
            path = Path(folder) / name
            if ending == ".html":
                write_report(run, session, path, renderer, directory=wanted.directory, progress=report)
            elif ending == ".mp4":
                write_film(run, session, path, renderer, view=wanted.view, progress=report)
            elif ending == ".png":
                write_picture(run, session, wanted.frame, path, renderer, view=wanted.view)
            else:
                write_table(run.track, path)
            return name, path.read_bytes()

    return work
