"""What all commands share: sentences and progress on stderr, results on stdout, options parsed the same way."""

from __future__ import annotations

import json
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import typer
from rich.console import Console
from rich.progress import BarColumn, Progress, TaskProgressColumn, TextColumn, TimeRemainingColumn

from spf import __version__
from spf.errors import RunError, SessionError, SettingError
from spf.initialise import Doubted, Start
from spf.live import is_live, is_meant_live, open_live
from spf.progress import Report
from spf.sessions import Session, open_session

__all__ = [
    "INTERRUPTED",
    "check_output",
    "check_session_output",
    "complain",
    "open_given",
    "parse_assignments",
    "parse_range",
    "print_json",
    "progress_bar",
    "show_version",
    "warn",
    "warn_of",
]

_REMEDIES: dict[Doubted, str] = {
    "pose": "Give one with --init POSE.json, or begin at a frame that shows an open hand.",
    "side": "Give the hand with --hand HAND.json if you know it.",
}
INTERRUPTED = 130  # exit code after Ctrl-C, as shells have it


def complain(sentence: str) -> None:
    """Write one sentence on stderr, on one line."""
    print("spf: " + " ".join(sentence.split()), file=sys.stderr, flush=True)


def warn(sentence: str) -> None:
    """Write a warning on stderr; nothing for ""."""
    if sentence:
        complain(f"warning: {sentence}")


def warn_of(start: Start) -> None:
    """Warn of a start that may be wrong and of a camera that is, and say what to do; nothing where all is believed."""
    if start.doubted is not None:
        warn(f"{start.doubt} {_REMEDIES[start.doubted]}")
    warn(start.remark)


def print_json(value: Any) -> None:
    """Write a value on stdout as JSON."""
    print(json.dumps(value, indent=2, allow_nan=False))


def show_version(wanted: bool) -> None:
    """Print the version and stop, if it is asked for."""
    if wanted:
        print(f"spf {__version__}")
        raise typer.Exit


@contextmanager
def progress_bar() -> Iterator[Report]:
    """Give ``report(what is done, share)``, which shows a bar on stderr, if that is a terminal, from its first call on."""
    console = Console(stderr=True)
    columns = (TextColumn("{task.description}"), BarColumn(), TaskProgressColumn(), TimeRemainingColumn())
    progress = Progress(*columns, console=console, transient=True, disable=not console.is_terminal)
    task = progress.add_task("", total=1.0)

    def report(text: str, share: float) -> None:
        progress.update(task, description=text, completed=share)
        progress.start()

    try:
        yield report
    finally:
        progress.stop()


def open_given(uri: str, camera: Path | None = None) -> Session:
    """Open a session that was named on the command line, show how far that is, and pass on its warnings.

    Raises:
        SessionError: it cannot be opened.
        SensorError: it is written like a live sensor that there is not.
    """
    if is_live(uri) and uri.startswith("replay:"):
        raise SessionError(
            f"{uri} plays a recording as if it were live: give the recording itself, {uri.partition(':')[2]}."
        )
    if is_live(uri):
        raise SessionError(f"{uri} is a live sensor: 'spf record {uri} -o FILE' records it, 'spf track' tracks it.")
    if is_meant_live(uri):
        open_live(uri)
    with progress_bar() as report:
        session = open_session(uri, camera, report)
    for sentence in session.warnings:
        warn(sentence)
    return session


def parse_range(text: str | None, count: int) -> tuple[int, int]:
    """Read ``A:B`` as the frames [A, B) of a session of ``count`` frames; either may be left out.

    Raises:
        SettingError: it is no range, is empty or reaches outside the session.
    """
    if text is None:
        return 0, count
    first_text, colon, last_text = text.partition(":")
    try:
        if not colon:
            raise ValueError
        first, last = int(first_text or 0), int(last_text or count)
    except ValueError:
        raise SettingError(f"A range of frames is like 0:100, 50: or :100, not '{text}'.") from None
    if not 0 <= first < last <= count:
        raise SettingError(
            f"The range {text} is outside the session, which has the frames 0 to {count - 1} (write 0:{count} for all)."
        )
    return first, last


def parse_assignments(texts: list[str]) -> dict[str, str]:
    """Read ``name=value`` texts.

    Raises:
        SettingError: one has no name or no value, or a name comes twice.
    """
    found: dict[str, str] = {}
    for text in texts:
        name, equals, value = (part.strip() for part in text.partition("="))
        if not (name and equals and value):
            raise SettingError(f"--set takes name=value, as in --set k=3, not '{text}'.")
        if name in found:
            raise SettingError(f"--set {name} is given twice: decide on one value.")
        found[name] = value
    return found


def check_output(path: Path, force: bool) -> None:
    """Check that a file may be written, before any work is done.

    Raises:
        RunError: it exists and may not be replaced, or its folder is missing.
    """
    if path.is_dir():
        raise RunError(f"{path} is a folder: give the name of a file.")
    if path.exists() and not force:
        raise RunError(f"{path} exists already: choose another name, or replace it with --force.")
    if not path.resolve().parent.is_dir():
        raise RunError(f"There is no folder {path.resolve().parent} to write {path.name} to: make it first.")


def check_session_output(path: Path, force: bool) -> None:
    """Check that a session may be written to a file, before any work is done.

    Raises:
        SettingError: its name is not one of a session.
        RunError: see :func:`check_output`.
    """
    if path.suffix.lower() != ".mcap":
        raise SettingError(f"A session is written as an MCAP file: name it something like {path.with_suffix('.mcap')}.")
    check_output(path, force)
