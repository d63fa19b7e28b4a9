"""The command line ``spf``: every error that a user can cause is one sentence, whatever is tracked is kept."""

from __future__ import annotations

import sys
from collections.abc import Callable, Sequence

import typer

from spf.cli import comparing, live, marking, results, sessions, sharing, tracking
from spf.cli.console import INTERRUPTED, complain, show_version
from spf.errors import SpfError

__all__ = ["app", "execute", "main"]

_WRONG = 2
_USAGE_ERROR: type[Exception] = typer.BadParameter.__mro__[1]  # what Typer raises for all that does not parse

app = typer.Typer(
    name="spf",
    help="Track a hand in depth sessions with the Smart Particle Filter.\n\n"
    "A first walk through it:\n\n"
    "    spf info sessions/open-close.mcap\n\n"
    "    spf track sessions/open-close.mcap -o runs/first\n\n"
    "    spf evaluate runs/first\n\n"
    "'spf COMMAND --help' says what a command takes. 'panel serve app' opens the same in a browser.",
    add_completion=False,
    rich_markup_mode="rich",
    context_settings={"help_option_names": ["-h", "--help"]},
)
_PANELS: dict[str, tuple[Callable[..., None], ...]] = {
    "Sessions": (*sessions.COMMANDS, *marking.COMMANDS),
    "Tracking": tracking.COMMANDS,
    "Live sensors": live.COMMANDS,
    "Runs": (results.evaluate, *sharing.COMMANDS),
    "This computer": (results.doctor,),
}
for panel, commands in _PANELS.items():
    for command in commands:
        app.command(rich_help_panel=panel)(command)
app.command(name="compare", rich_help_panel="Runs")(comparing.compare_trackers)


@app.callback()
def _options(
    version: bool = typer.Option(
        False, "--version", "-v", help="Print the version and stop.", is_eager=True, callback=show_version
    ),
) -> None:
    pass


def execute(arguments: Sequence[str]) -> int:
    """Run the command line and return its exit code: 0, 1 (doctor found faults), 2 (wrong input) or 130 (Ctrl-C)."""
    try:
        return int(app(list(arguments) or ["--help"], prog_name="spf", standalone_mode=False) or 0)
    except SpfError as error:
        complain(str(error))
    except _USAGE_ERROR as error:
        context = error.ctx  # type: ignore[attr-defined]
        command = "spf" if context is None else context.command_path
        complain(f"{error.format_message()} (see {command} --help)")  # type: ignore[attr-defined]
    except KeyboardInterrupt:
        complain("stopped.")
        return INTERRUPTED
    return _WRONG


def main() -> None:
    """Entry point of the ``spf`` script."""
    sys.exit(execute(sys.argv[1:]))
