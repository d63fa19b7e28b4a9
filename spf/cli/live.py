"""``spf record`` and ``spf stream``: live sensors recorded, tracked and sent on."""

from __future__ import annotations

import socket
import time
from contextlib import suppress
from pathlib import Path
from typing import Annotated, Any

import typer

from spf.cli.console import check_session_output, complain, warn
from spf.cli.live_status import (
    STATUS_EVERY,
    checked_side,
    facts,
    raise_if_ended,
    status_line,
    stopped_by_signals,
    summarise_recording,
    take_notes,
    wait_for_sensor,
)
from spf.cli.live_track import track_live
from spf.cli.sessions import Force
from spf.errors import SensorError, SettingError
from spf.live import SENSORS, Feed, open_live
from spf.live.network import Publisher
from spf.live.tracking import Request
from spf.trackers import make_settings

__all__ = ["COMMANDS", "Seconds", "Wait", "record", "stream"]

LiveSensor = Annotated[
    str,
    typer.Argument(
        metavar="URI",
        help=f"A live sensor: {', '.join(s.example for s in SENSORS.values())}; what is in [] may be left out, and is quoted "
        "in a shell. 'spf doctor' lists the cameras that are connected.",
    ),
]
Wait = Annotated[
    bool, typer.Option("--wait", help="Wait for a live sensor that is not there yet, for as long as it takes.")
]
Seconds = Annotated[
    float | None,
    typer.Option(min=0.1, help="End a live sensor so many seconds after its first frame; without, Ctrl-C ends it."),
]


def record(
    uri: LiveSensor,
    output: Annotated[Path, typer.Option("--output", "-o", metavar="FILE.mcap", help="The file to record to.")],
    seconds: Seconds = None,
    side: Annotated[str | None, typer.Option(metavar="left|right", help="Which hand is shown, if you know.")] = None,
    run: Annotated[
        Path | None,
        typer.Option("--track", metavar="DIR", help="Track at the same time, and keep the run in this directory."),
    ] = None,
    wait: Wait = False,
    force: Force = False,
    as_json: Annotated[bool, typer.Option("--json", help="Print a line of JSON twice a second.")] = False,
) -> None:
    """Record a live sensor; every frame counted as recorded is in the file, whatever happens to the program.

    Ctrl-C ends a recording and leaves a whole file. Enter sets a marker; a line of text and Enter make a note.

    Fails when the disk gets full, or when no frame comes; what was recorded until then is kept.

    Examples:

        spf record realsense: -o recording.mcap --seconds 60

        spf record replay:sessions/open-close.mcap -o recording.mcap --seconds 3

        spf record replay:sessions/open-close.mcap -o tracked.mcap --track runs/live
    """
    if run is not None and run.resolve() == output.resolve():
        raise SettingError("--track takes a directory, and --output a file: give them different names.")
    check_session_output(output, force)
    if run is not None:
        request = Request("spf", "default", make_settings("spf", "default", {}), side=checked_side(side))
        track_live(uri, run, output, request, seconds=seconds, wait=wait, force=force, as_json=as_json)
        return
    source = open_live(uri)
    feed = Feed(source, wait=wait)
    feed.record(output, side=checked_side(side), overwrite=force)
    with feed, stopped_by_signals(), status_line(as_json) as show:
        wait_for_sensor(uri, source, feed, feed.recording_began, show, seconds=seconds, wait=wait)
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
    raise_if_ended(recording, state)


def stream(
    uri: LiveSensor,
    to: Annotated[
        str,
        typer.Option(
            "--to",
            metavar="tcp://*:PORT",
            help="Where others connect to: a free port of this computer, quoted in a shell.",
        ),
    ],
    seconds: Seconds = None,
    wait: Wait = False,
    as_json: Annotated[bool, typer.Option("--json", help="Print a line of JSON twice a second.")] = False,
) -> None:
    """Send a live sensor to other computers: they record or track zmq://THIS-COMPUTER:PORT.

    Example:  spf stream replay:sessions/open-close.mcap --to "tcp://*:5555" --seconds 3
    """
    publisher = Publisher(to)
    try:
        source = open_live(uri)
        with Feed(source, wait=wait, send=publisher.send) as feed, stopped_by_signals(), status_line(as_json) as show:
            wait_for_sensor(uri, source, feed, feed.opened, show, seconds=seconds, wait=wait)
            sensor = feed.about().sensor
            port = publisher.address.rpartition(":")[2]
            complain(
                f"{sensor} is sent from {publisher.address}; there: spf track zmq://{socket.gethostname()}:{port} -o RUN"
            )
            with suppress(KeyboardInterrupt):  # the way that it is ended without --seconds
                _watch(feed, float("inf") if seconds is None else time.monotonic() + seconds, show)
            state = feed.state
    finally:
        publisher.close()
    if not as_json:
        print(f"Sent {state.taken} frames of {sensor}.")
    if state.failed:
        raise SensorError(state.message)
    if not state.taken:
        raise SensorError(f"{sensor} gave no frame, so that nothing was sent: {source.remedy}.")


def _watch(feed: Feed, until: float, show: Any) -> None:
    """Show how a feed, and its recording if there is one, goes until its time is over or it ends by itself."""
    told = ""
    while time.monotonic() < until:
        state, recording = feed.state, feed.recording
        show(facts(state, recording))
        if state.ended or state.failed or (recording is not None and recording.ended):
            return  # a failure is said at the end
        sentence = ("" if recording is None else recording.warning) or state.message
        if sentence != told:
            told = sentence
            warn(sentence)
        feed.newest(state.taken - 1, min(STATUS_EVERY, max(until - time.monotonic(), 0.0)))
        time.sleep(min(STATUS_EVERY, max(until - time.monotonic(), 0.0)))


COMMANDS = (record, stream)
