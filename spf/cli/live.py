"""``spf record`` and ``spf stream``: live sensors recorded, tracked and sent on."""

from __future__ import annotations

import json
import signal
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.console import Console
from rich.status import Status

from spf.cli.console import check_output, complain, warn
from spf.cli.sessions import Force
from spf.errors import SettingError
from spf.live import SENSORS, Feed, FeedState, Recording, open_live
from spf.sessions import Side

__all__ = ["COMMANDS", "record"]

LiveSensor = Annotated[
    str, typer.Argument(metavar="URI", help=f"A live sensor: {', '.join(s.example for s in SENSORS.values())}.")
]
Wait = Annotated[bool, typer.Option("--wait", help="Wait for a sensor that is not there yet.")]
_STATUS_EVERY = 0.5  # s


def record(
    uri: LiveSensor,
    output: Annotated[Path, typer.Option("--output", "-o", metavar="FILE.mcap", help="The file to record to.")],
    seconds: Annotated[float | None, typer.Option(min=0.1, help="Stop after so long; else at Ctrl-C.")] = None,
    side: Annotated[str | None, typer.Option(metavar="left|right", help="Which hand is shown, if you know.")] = None,
    wait: Wait = False,
    force: Force = False,
    as_json: Annotated[bool, typer.Option("--json", help="Print a line of JSON twice a second.")] = False,
) -> None:
    """Record a live sensor; every frame counted as recorded is in the file, whatever happens to the program.

    Press Enter to set a marker; write something before it to make a note.

    Examples:

        spf record replay:sessions/open-close.mcap -o recording.mcap --seconds 3
    """
    check_output(output, force)
    feed = Feed(open_live(uri), wait=wait)
    feed.record(output, side=checked_side(side), overwrite=force)
    with feed, stopped_by_signals(), status_line(as_json) as show:
        feed.recording_began()
        take_notes(feed)
        until = float("inf") if seconds is None else time.monotonic() + seconds
        with suppress(KeyboardInterrupt):  # the way that a recording without --seconds is ended
            _watch(feed, until, show)
        recording = feed.stop_recording()
        state = feed.state
    assert recording is not None
    summarise_recording(recording, state, as_json)


def _watch(feed: Feed, until: float, show: Any) -> None:
    """Show how the recording goes until its time is over or it ends by itself."""
    told = ""
    while time.monotonic() < until:
        state, recording = feed.state, feed.recording
        assert recording is not None
        show(facts(state, recording))
        sentence = recording.ended or recording.warning or state.message
        if sentence != told:
            told = sentence
            warn(sentence)
        if state.ended or recording.ended:
            return
        feed.newest(state.taken - 1, min(_STATUS_EVERY, max(until - time.monotonic(), 0.0)))
        time.sleep(min(_STATUS_EVERY, max(until - time.monotonic(), 0.0)))


def facts(state: FeedState, recording: Recording | None) -> dict[str, Any]:
    """Return how a feed and its recording stand, ready for JSON."""
    found: dict[str, Any] = {
        "sensor": state.about.sensor if state.about else None,
        "connected": state.connected,
        "frames": state.taken,
        "frames_per_second": round(state.rate, 2),
        "missing_from_sensor": state.missing,
        "reconnected": state.reconnected,
    }
    if recording is not None:
        found |= {
            "recorded": recording.frames,
            "not_recorded": recording.lost,
            "queued": recording.queued,
            "recorded_s": round(recording.seconds, 3),
            "megabytes": round(recording.size / 1e6, 3),
        }
    return found


def summarise_recording(recording: Recording, state: FeedState, as_json: bool) -> None:
    """Say what was recorded, and what was not."""
    if as_json:
        print(json.dumps({**facts(state, recording), "file": str(recording.path), "complete": True}), flush=True)
        return
    lost = f" {recording.lost} frames could not be recorded." if recording.lost else ""
    missing = f" {state.missing} frames were lost between the sensor and this computer." if state.missing else ""
    print(
        f"Recorded {recording.frames} frames ({recording.seconds:.1f} s, {recording.size / 1e6:.1f} MB) to "
        f"{recording.path}.{lost}{missing}\nNext: spf track {recording.path} -o RUN"
    )


def checked_side(text: str | None) -> Side | None:
    """Read the name of a side.

    Raises:
        SettingError: it is neither.
    """
    if text not in ("left", "right", None):
        raise SettingError(f"--side takes left or right, not '{text}'.")
    return text  # type: ignore[return-value]


@contextmanager
def stopped_by_signals() -> Iterator[None]:
    """Let the end of a session or a service (SIGTERM) end the program as Ctrl-C does: with all files whole."""

    def stop(*_: object) -> None:
        raise KeyboardInterrupt

    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before = signal.signal(signal.SIGTERM, stop)
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, before)


@contextmanager
def status_line(as_json: bool) -> Iterator[Any]:
    """Give a function that shows facts: as lines of JSON, as one line on a terminal, else not at all."""
    console = Console(stderr=True)
    if as_json:
        yield lambda values: print(json.dumps(values), flush=True)
        return
    if not console.is_terminal:
        yield lambda _values: None
        return
    with Status("Connecting", console=console) as status:
        yield lambda values: status.update(
            "  ".join(f"{name.replace('_', ' ')} {value}" for name, value in values.items() if value not in (None, 0))
        )


def take_notes(feed: Feed) -> None:
    """Make markers and notes of what is typed, while a terminal is there."""
    if sys.stdin is None or not sys.stdin.isatty():
        return

    def read() -> None:
        for line in sys.stdin:
            text = line.strip()
            if feed.note("note" if text else "marker", text):
                complain(f"noted: {text}" if text else "marker set.")

    threading.Thread(target=read, name="notes", daemon=True).start()


COMMANDS = (record,)
