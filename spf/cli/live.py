"""``spf record`` and ``spf stream``: live sensors recorded, tracked and sent on."""

from __future__ import annotations

import json
import signal
import socket
import sys
import threading
import time
from collections import deque
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.console import Console
from rich.status import Status

from spf.cli.console import check_output, complain, warn, warn_of
from spf.cli.sessions import Force
from spf.errors import RunError, SettingError
from spf.evaluate import count_losses
from spf.live import SENSORS, Feed, FeedState, Recording, open_live
from spf.live.keeping import LiveRun, latency_facts
from spf.live.network import Publisher
from spf.live.tracking import Request, find_live_start, follow
from spf.runs import check_free
from spf.sessions import Side
from spf.trackers import make_settings

__all__ = ["COMMANDS", "Seconds", "Wait", "record", "stream", "track_live"]

LiveSensor = Annotated[
    str, typer.Argument(metavar="URI", help=f"A live sensor: {', '.join(s.example for s in SENSORS.values())}.")
]
Wait = Annotated[bool, typer.Option("--wait", help="Wait for a sensor that is not there yet.")]
Seconds = Annotated[float | None, typer.Option(min=0.1, help="Stop a live sensor after so long; else at Ctrl-C.")]
_STATUS_EVERY = 0.5  # s
_LATELY = 150  # tracked frames that the shown latency is of


def record(
    uri: LiveSensor,
    output: Annotated[Path, typer.Option("--output", "-o", metavar="FILE.mcap", help="The file to record to.")],
    seconds: Seconds = None,
    side: Annotated[str | None, typer.Option(metavar="left|right", help="Which hand is shown, if you know.")] = None,
    run: Annotated[Path | None, typer.Option("--track", metavar="DIR", help="Track meanwhile, to this run.")] = None,
    wait: Wait = False,
    force: Force = False,
    as_json: Annotated[bool, typer.Option("--json", help="Print a line of JSON twice a second.")] = False,
) -> None:
    """Record a live sensor; every frame counted as recorded is in the file, whatever happens to the program.

    Press Enter to set a marker; write something before it to make a note.

    Examples:

        spf record replay:sessions/open-close.mcap -o recording.mcap --seconds 3

        spf record replay:sessions/open-close.mcap -o tracked.mcap --track runs/live
    """
    check_output(output, force)
    if run is not None:
        request = Request("spf", "default", make_settings("spf", "default", {}), side=checked_side(side))
        track_live(uri, run, output, request, seconds=seconds, wait=wait, force=force, as_json=as_json)
        return
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
    if not as_json:
        print(f"Next: spf track {recording.path} -o RUN")


def stream(
    uri: LiveSensor,
    to: Annotated[str, typer.Option("--to", metavar="tcp://*:PORT", help="Where others connect to.")],
    seconds: Seconds = None,
    wait: Wait = False,
    as_json: Annotated[bool, typer.Option("--json", help="Print a line of JSON twice a second.")] = False,
) -> None:
    """Send a live sensor to other computers: they record or track zmq://THIS-COMPUTER:PORT.

    Example:  spf stream replay:sessions/open-close.mcap --to tcp://*:5555 --seconds 3
    """
    publisher = Publisher(to)
    try:
        with (
            Feed(open_live(uri), wait=wait, send=publisher.send) as feed,
            stopped_by_signals(),
            status_line(as_json) as show,
            suppress(KeyboardInterrupt),
        ):
            sensor = feed.about().sensor
            port = publisher.address.rpartition(":")[2]
            complain(
                f"{sensor} is sent from {publisher.address}; there: spf track zmq://{socket.gethostname()}:{port} -o RUN"
            )
            _watch(feed, float("inf") if seconds is None else time.monotonic() + seconds, show)
    finally:
        publisher.close()
    if not as_json:
        print(f"Sent {feed.state.taken} frames of {sensor}.")


def track_live(
    uri: str,
    directory: Path,
    output: Path,
    request: Request,
    *,
    seconds: float | None,
    wait: bool,
    force: bool,
    as_json: bool,
) -> None:
    """Track a live sensor while it is recorded, and keep both.

    Raises:
        RunError: no hand was found until it ended.
    """
    check_free(directory, force)
    make_folder(output.parent)
    feed = Feed(open_live(uri), wait=wait)
    feed.record(output, side=request.side, overwrite=force)
    until = float("inf") if seconds is None else time.monotonic() + seconds
    kept: LiveRun | None = None

    def stop() -> bool:
        recording = feed.recording
        return time.monotonic() > until or (recording is not None and recording.ended != "")

    with feed, stopped_by_signals(), status_line(as_json) as show, ExitStack() as stack:
        feed.recording_began()
        take_notes(feed)
        with suppress(KeyboardInterrupt):
            start = find_live_start(feed, request, lambda text, _share: show({"doing": text}), stop)
            if start is not None:
                warn_of(start)
                command = ["spf", *sys.argv[1:]]
                kept = LiveRun(directory, output, uri, request, start, command, overwrite=force)
                stack.enter_context(kept)
                _follow(feed, request, kept, stop, show)
        recording, state = feed.stop_recording(), feed.state
        if kept is not None:
            kept.finish()
    assert recording is not None
    warn(recording.ended)
    summarise_recording(recording, state, as_json)
    if kept is None:
        raise RunError(f"No hand was believed until the end, so nothing was tracked; {output} has all that was seen.")
    if not as_json:
        print(_summary(kept, directory))


def make_folder(folder: Path) -> None:
    """Make the folder of a recording.

    Raises:
        RunError: it cannot be made.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise RunError(f"The directory {folder} cannot be made: {error.strerror}.") from None


def _follow(feed: Feed, request: Request, kept: LiveRun, stop: Callable[[], bool], show: Any) -> None:
    """Track and show how it goes until it is over."""
    lately: deque[float] = deque(maxlen=_LATELY)
    told, dropped, shown = "", 0, 0.0
    for tracked in follow(feed, request, kept.start, stop):
        kept.add(tracked)
        lately.append(tracked.latency)
        dropped += tracked.dropped
        now, state, recording = time.monotonic(), feed.state, feed.recording
        if now - shown > _STATUS_EVERY and recording is not None:
            shown = now
            doing = "lost, searching" if tracked.result.lost else "tracking"
            show({"doing": doing, **latency_facts(list(lately)), "dropped": dropped, **facts(state, recording)})
            sentence = recording.warning or state.message
            if sentence != told:
                told = sentence
                warn(sentence)


def _summary(kept: LiveRun, directory: Path) -> str:
    track, live = kept.track, kept.facts()
    if not len(track):
        return f"A hand was found, but there was no frame left to track. Next: spf evaluate {directory}"
    losses = count_losses(track.lost)
    return (
        f"Tracked {len(track)} of the frames live ({live['dropped']} dropped for newer ones): {losses.losses} losses, "
        f"{losses.frames_lost} frames without a hand; from capture to estimate {live['latency_ms_median']} ms "
        f"(median), {live['latency_ms_p95']} ms (95 %).\n"
        f"Next: spf evaluate {directory}, or repeat it from the recording: spf track --repeat {directory} -o RUN"
    )


def _watch(feed: Feed, until: float, show: Any) -> None:
    """Show how a feed, and its recording if there is one, goes until its time is over or it ends by itself."""
    told = ""
    while time.monotonic() < until:
        state, recording = feed.state, feed.recording
        show(facts(state, recording))
        ended = "" if recording is None else recording.ended
        sentence = ended or ("" if recording is None else recording.warning) or state.message
        if sentence != told:
            told = sentence
            warn(sentence)
        if state.ended or ended:
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
        f"{recording.path}.{lost}{missing}"
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


COMMANDS = (record, stream)
