"""``spf evaluate`` and ``spf doctor``: how well a run did, and what of this machine works."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from spf.cli.console import print_json, progress_bar, warn, warn_of
from spf.cli.sessions import AsJson
from spf.doctor import examine, table
from spf.evaluate import evaluate_run
from spf.runs import read_run, reopen_session

__all__ = ["doctor", "evaluate"]

_LONG = ("success_curve", "joint_error_mm")  # parts for programs, not for a table


def evaluate(
    directory: Annotated[Path, typer.Argument(metavar="DIR", help="Directory of a run.")],
    session: Annotated[
        str | None, typer.Option(metavar="SESSION", help="Where the session lies now, if it was moved.")
    ] = None,
    as_json: AsJson = False,
) -> None:
    """Measure a run: joint errors where there is truth, agreement with the depth, losses and time.

    Example:  spf evaluate runs/first --json
    """
    run = read_run(directory)
    with progress_bar() as report, reopen_session(run.manifest, session, report) as opened:
        measures = evaluate_run(run, opened, report)
    if not run.manifest["complete"]:
        warn(f"the run was stopped after {len(run.track)} frames, and only those were measured.")
    warn_of(run.plan.start)
    if as_json:
        print_json(measures)
        return
    shown = {name: _text(value) for name, value in measures.items() if name not in _LONG}
    width = max(len(name) for name in shown)
    for name, text in shown.items():
        print(f"{name:<{width}}  {text}")


def _text(value: Any) -> str:
    if isinstance(value, dict):
        return ", ".join(f"{key}: {_text(item)}" for key, item in value.items())
    if isinstance(value, float):
        return f"{value:.4g}"
    return "–" if value is None or value == "" else str(value)


def doctor(as_json: AsJson = False) -> None:
    """Say what of this machine works and what to install; exit code 1 if something needed is missing.

    Example:  spf doctor
    """
    checks = examine()
    if as_json:
        print_json([check._asdict() for check in checks])
    else:
        print(table(checks))
    if not all(check.ok for check in checks):
        raise typer.Exit(1)
