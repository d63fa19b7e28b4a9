"""The report's page: everything gathered is put into one template, with its style, script and pictures inside."""

from __future__ import annotations

import base64
import json
from functools import cache
from importlib.resources import files
from pathlib import Path
from typing import Any

import jinja2
from markupsafe import Markup

from spf import __version__
from spf.errors import RenderUnavailableError, RunError
from spf.export.writing import written_whole
from spf.progress import Report, part_of, silent
from spf.render import Renderer
from spf.report import content
from spf.report.keyframes import MOST_LOSSES, Shot, key_frames, shots
from spf.runs import Run
from spf.sessions import Session
from spf.trackers import TRACKERS

__all__ = ["report_html", "write_report"]

_COMPARING = 0.6  # share of the work that comparing with the depth is

NO_SESSION = (
    "Written without the session: its depth, and with it pictures and errors, is not here; only what the track says."
)


def write_report(
    run: Run,
    session: Session | None,
    path: Path,
    renderer: Renderer | None,
    *,
    directory: str = "RUN",
    progress: Report | None = None,
) -> None:
    """Write the report of a run as one HTML file that needs nothing else.

    Args:
        run: track and manifest.
        session: that was tracked; None leaves out pictures and errors, and the report says so.
        path: of the file.
        renderer: draws the key frames; not used without a session.
        directory: of the run, for the command that repeats it.
        progress: called with what is being done and the share done; an error that it raises ends the work, and no file
            is left.

    Raises:
        RunError: nothing was tracked, or the file cannot be written.
        SessionError: a frame cannot be read.
        RenderError: a picture could not be drawn; a machine that cannot draw at all gives a report that says so.
    """
    page = report_html(run, session, renderer, directory=directory, progress=progress)
    with written_whole(path) as part:
        part.write_text(page, encoding="utf-8")


def report_html(
    run: Run,
    session: Session | None,
    renderer: Renderer | None,
    *,
    directory: str = "RUN",
    progress: Report | None = None,
) -> str:
    """Return the report of a run as HTML; see :func:`write_report`."""
    if not len(run.track):
        raise RunError("The run has tracked no frame, so that there is nothing to report: track the session again.")
    report = progress or silent
    figures = content.figures_of(run, session, part_of(report, 0.0, _COMPARING))
    drawn, cannot_draw = _shots(run, session, figures, renderer, report)
    groups = content.setting_rows(run)
    return _template().render(
        run=run, plan=run.plan, manifest=run.manifest, track=run.track, session=session,
        tracker=TRACKERS[run.plan.tracker].title,
        notices=_notices(run, session, cannot_draw),
        numbers=content.numbers_of(run, figures),
        commands=content.repeat_commands(run, directory),
        shots=drawn, most_losses=MOST_LOSSES, errors_known=figures.measures.get("mean_joint_error_mm") is not None,
        plots=content.plots_of(run, figures), measures=figures.measures,
        losses=content.loss_rows(run.track), stages=content.stage_rows(run.track),
        groups=groups, differing=[row for rows in groups.values() for row in rows if row.differs],
        manifest_json=json.dumps(run.manifest, indent=2), manifest_link=_data_link(run.manifest),
        version=__version__,
    )  # fmt: skip


def _shots(
    run: Run, session: Session | None, figures: content.Figures, renderer: Renderer | None, report: Report
) -> tuple[list[Shot], str]:
    """The pictures of the key frames, and why there are none of the hand, if so."""
    if session is None:
        return [], ""
    cannot_draw = ""
    if renderer is not None:
        try:
            renderer.opengl().result()
        except RenderUnavailableError as error:
            cannot_draw, renderer = str(error), None
    keys = key_frames(run.track, content.badness(run.track, figures.compared))

    def rest(text: str, share: float) -> None:
        report(text, _COMPARING + (1 - _COMPARING) * share)

    return list(shots(run, session, keys, renderer, rest)), cannot_draw


def _notices(run: Run, session: Session | None, cannot_draw: str) -> list[str]:
    """Sentences that whoever reads the report should know first."""
    notices = []
    if not run.manifest["complete"]:
        first, last = run.plan.first, run.plan.last
        notices.append(f"The run was stopped: {len(run.track)} of its {last - first} frames are here.")
    doubt = run.manifest["start"].get("doubt", "")
    notices += [doubt] if doubt else []
    if run.plan.changes:
        frames = ", ".join(str(change.frame) for change in run.plan.changes)
        notices.append(
            f"Tracker, settings or seed were changed on the way, from frame {frames} on; those shown are the first."
        )
    notices += [NO_SESSION] if session is None else []
    if cannot_draw:
        notices.append(f"{cannot_draw} The key frames show the depth with the skeleton only.")
    return [*notices, *run.manifest["session"].get("warnings", [])]


def _data_link(value: Any) -> str:
    packed = base64.b64encode(json.dumps(value, indent=2).encode()).decode()
    return f"data:application/json;base64,{packed}"


@cache
def _template() -> jinja2.Template:
    folder = files("spf.report") / "assets"
    environment = jinja2.Environment(
        autoescape=True, undefined=jinja2.StrictUndefined, trim_blocks=True, lstrip_blocks=True
    )
    environment.filters["picture"] = lambda jpeg: f"data:image/jpeg;base64,{base64.b64encode(jpeg).decode()}"
    environment.filters["value"] = _value
    for name in ("style.css", "hover.js"):
        environment.globals[name.partition(".")[0]] = Markup((folder / name).read_text("utf-8"))
    return environment.from_string((folder / "report.html").read_text("utf-8"))


def _value(value: Any) -> str:
    """A setting's or a measure's value as people write it."""
    if value is None or value == "":
        return "–"
    if isinstance(value, bool):
        return "on" if value else "off"
    return f"{value:.4g}" if isinstance(value, float) else str(value)
