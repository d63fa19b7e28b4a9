"""What ``spf record``, ``spf track`` and ``spf stream`` share: how a live source stands, notes that are typed, signals."""

from __future__ import annotations

import json
import signal
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

from rich.console import Console
from rich.markup import escape
from rich.status import Status

from spf.cli.console import complain, warn
from spf.errors import RunError, SensorError, SettingError
from spf.live import Feed, FeedState, LiveSource, Recording
from spf.live.feed_state import CONNECTING
from spf.sessions import Side

__all__ = [
    "STATUS_EVERY",
    "checked_side",
    "facts",
    "in_words",
    "raise_if_ended",
    "status_line",
    "stopped_by_signals",
    "summarise_recording",
    "take_notes",
    "wait_for_sensor",
]

STATUS_EVERY = 0.5  # s
_WORDS = {
    "doing": "{}",
    "sensor": "{}",
    "frames": "{} frames",
    "frames_per_second": "{:.0f}/s",
    "latency_ms_median": "latency {} ms",
    "latency_ms_p95": "95 % under {} ms",
    "dropped": "{} dropped for newer ones",
    "missing_from_sensor": "{} lost before this computer",
    "reconnected": "connected again {}×",
    "recorded": "recorded {} frames",
    "recorded_s": "{:.1f} s",
    "megabytes": "{:.1f} MB",
    "queued": "{} still to write",
    "not_recorded": "{} not recorded",
    "notes_not_recorded": "{} markers and notes not kept",
}
_PATIENCE = 20.0  # s for a first frame where no time is given: longer than what sensors themselves wait for one


def wait_for_sensor(
    uri: str,
    source: LiveSource,
    feed: Feed,
    came: Callable[[float], bool],
    show: Callable[[dict[str, Any]], None],
    *,
    seconds: float | None,
    wait: bool,
) -> None:
    """Wait until a sensor gives what is asked for, and say meanwhile why it does not.

    Args:
        uri: of the sensor.
        source: that the feed runs, of that URI.
        feed: that was started.
        came: waits for so many seconds; tells whether it has come.
        show: called with how the feed stands.
        seconds: that ``--seconds`` gives the sensor: one that gives nothing for so long, and could, is waited for no more.
        wait: whether it is waited for as long as it takes.

    Raises:
        SensorError: it did not come in time.
    """
    limit = float("inf") if wait else max(_PATIENCE if seconds is None else seconds, source.warm_up)
    until, told = time.monotonic() + limit, CONNECTING
    while not came(min(STATUS_EVERY, max(until - time.monotonic(), 0.0))):
        state = feed.state
        if time.monotonic() >= until:
            raise SensorError(
                f"No frame came from {uri} within {limit:g} s: {source.remedy}, or have it waited for with --wait."
            )
        show(facts(state, None))
        if state.message not in ("", told):
            told = state.message
            warn(told)


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
            "notes_not_recorded": recording.notes_lost,
            "queued": recording.queued,
            "recorded_s": round(recording.seconds, 3),
            "megabytes": round(recording.size / 1e6, 3),
        }
    return found


def summarise_recording(recording: Recording, state: FeedState, as_json: bool) -> None:
    """Say what was recorded, and what was not."""
    if as_json:
        ended = {"file": str(recording.path), "complete": not recording.ended, "ended": recording.ended or None}
        print(json.dumps({**facts(state, recording), **ended}), flush=True)
        return
    lost = f" {recording.lost} frames could not be recorded." if recording.lost else ""
    notes = f" {recording.notes_lost} markers and notes could not be recorded." if recording.notes_lost else ""
    missing = f" {state.missing} frames were lost between the sensor and this computer." if state.missing else ""
    print(
        f"Recorded {recording.frames} frames ({recording.seconds:.1f} s, {recording.size / 1e6:.1f} MB) to "
        f"{recording.path}.{lost}{notes}{missing}"
    )


def raise_if_ended(recording: Recording, state: FeedState) -> None:
    """Let the command fail when the recording or its sensor ended by a fault; how much was recorded is said by then.

    Raises:
        RunError: the recording did.
        SensorError: the sensor did.
    """
    if recording.ended:
        raise RunError(f"{recording.ended} Make room and go on in another file.")
    if state.failed:
        raise SensorError(f"{state.message} What was recorded until then is kept in {recording.path}.")


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
        yield lambda values: status.update(in_words(values))


def in_words(values: dict[str, Any]) -> str:
    """Return facts of a feed, its recording and its tracking as one line; what is not there or 0 is left out."""
    words = [text.format(values[name]) for name, text in _WORDS.items() if values.get(name)]
    if values.get("connected") is False:
        words.insert(0, "not connected")
    return escape(" · ".join(words))


def take_notes(feed: Feed) -> None:
    """Make markers and notes of what is typed, while a terminal is there."""
    if sys.stdin is None or not sys.stdin.isatty():
        return

    def read() -> None:
        for line in sys.stdin:
            text = line.strip()
            kept = feed.note("note" if text else "marker", text)
            if text:
                complain(f"noted: {text}" if kept else f"not noted, as nothing is recorded any more: {text}")
            else:
                complain("marker set." if kept else "no marker set, as nothing is recorded any more.")

    threading.Thread(target=read, name="notes", daemon=True).start()


def checked_side(text: str | None) -> Side | None:
    """Read the name of a side.

    Raises:
        SettingError: it is neither.
    """
    if text not in ("left", "right", None):
        raise SettingError(f"--side takes left or right, not '{text}'.")
    return text  # type: ignore[return-value]
