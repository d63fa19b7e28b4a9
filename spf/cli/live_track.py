"""``spf track`` of a live sensor, and ``spf record --track``: tracked while it is recorded."""

from __future__ import annotations

import sys
import time
from collections import deque
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path
from typing import Any

from spf.cli.console import warn, warn_of
from spf.cli.live_status import (
    STATUS_EVERY,
    facts,
    raise_if_ended,
    status_line,
    stopped_by_signals,
    summarise_recording,
    take_notes,
    wait_for_sensor,
)
from spf.errors import RunError
from spf.evaluate import count_losses
from spf.live import Feed, open_live
from spf.live.keeping import LiveRun, latency_facts
from spf.live.tracking import Request, find_live_start, follow
from spf.runs import check_free, make_directory

__all__ = ["track_live"]

_LATELY = 150  # tracked frames that the shown latency is of


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
        RunError: no hand was believed until it ended, its time was over before one could be tracked, or the disk is full.
        SensorError: the sensor is not there; no directory is left behind.
    """
    check_free(directory, force)
    source = open_live(uri)
    feed = Feed(source, wait=wait)
    feed.record(output, side=request.side, overwrite=force)
    until, kept, start = float("inf"), None, None

    def stop() -> bool:
        recording = feed.recording
        return time.monotonic() > until or (recording is not None and recording.ended != "")

    with (
        _none_left_empty(output.parent),
        feed,
        stopped_by_signals(),
        status_line(as_json) as show,
        ExitStack() as stack,
    ):
        wait_for_sensor(uri, source, feed, feed.recording_began, show, seconds=seconds, wait=wait)
        take_notes(feed)
        if seconds is not None:
            until = time.monotonic() + seconds
        with suppress(KeyboardInterrupt):
            start = find_live_start(feed, request, lambda text, _share: show({"doing": text}), stop)
            if start is not None and not stop():  # else there is no frame left to track, and a run of none helps nobody
                warn_of(start)
                command = ["spf", *sys.argv[1:]]
                kept = LiveRun(directory, output, uri, request, start, command, overwrite=force)
                stack.enter_context(kept)
                _follow(feed, request, kept, stop, show)
        recording, state = feed.stop_recording(), feed.state
        if kept is not None:
            kept.finish()
    assert recording is not None
    summarise_recording(recording, state, as_json)
    if kept is None and not recording.ended and not state.failed:
        over = time.monotonic() > until
        raise RunError(_why_nothing(seconds if over else None, start is not None, output))
    if kept is not None and not as_json:
        print(_summary(kept, directory))
    raise_if_ended(recording, state)


@contextmanager
def _none_left_empty(directory: Path) -> Iterator[None]:
    """Make a directory; when what follows fails, remove it again, and those made for it, unless there is something in it."""
    made = [folder for folder in (directory, *directory.parents) if not folder.exists()]
    make_directory(directory)
    try:
        yield
    except BaseException:  # Ctrl-C while a sensor is waited for, too
        for folder in made:
            with suppress(OSError):  # not empty
                folder.rmdir()
        raise


def _why_nothing(seconds: float | None, found: bool, output: Path) -> str:
    """Say why nothing was tracked; ``seconds`` is the time that was given, if it is over."""
    seen = f"{output} has all that was seen: 'spf track {output} -o RUN' tracks it."
    if seconds is None:
        ended = "It ended when the first pose was found" if found else "No hand was believed until the end"
        return f"{ended}, so nothing was tracked; {seen}"
    what = "when the first pose was found" if found else "before a hand was believed"
    return (
        f"The {seconds:g} s of --seconds were over {what}, so nothing was tracked: finding it takes 6 to 20 s of them, and "
        f"longer when the program compiles its kernels for the first time; give more. {seen}"
    )


def _follow(feed: Feed, request: Request, kept: LiveRun, stop: Callable[[], bool], show: Any) -> None:
    """Track and show how it goes until it is over."""
    lately: deque[float] = deque(maxlen=_LATELY)
    told, dropped, shown = "", 0, 0.0
    for tracked in follow(feed, request, kept.start, stop):
        kept.add(tracked)
        lately.append(tracked.latency)
        dropped += tracked.dropped
        now, state, recording = time.monotonic(), feed.state, feed.recording
        if now - shown > STATUS_EVERY and recording is not None:
            shown = now
            doing = "lost, searching" if tracked.result.lost else "tracking"
            show({"doing": doing, **latency_facts(list(lately)), "dropped": dropped, **facts(state, recording)})
            sentence = recording.warning or ("" if state.failed else state.message)  # a failure is said at the end
            if sentence != told:
                told = sentence
                warn(sentence)


def _summary(kept: LiveRun, directory: Path) -> str:
    track, live = kept.track, kept.facts()
    if not len(track):
        return "A hand was found, but the sensor gave no frame any more that could be tracked."
    losses = count_losses(track.lost)
    return (
        f"Tracked {len(track)} of the frames live ({live['dropped']} dropped for newer ones): {losses.losses} losses, "
        f"{losses.frames_lost} frames without a hand; from capture to estimate {live['latency_ms_median']} ms "
        f"(median), {live['latency_ms_p95']} ms (95 %).\n"
        f"Next: spf evaluate {directory}, or repeat it from the recording: spf track --repeat {directory} -o RUN"
    )
