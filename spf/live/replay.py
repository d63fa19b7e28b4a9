"""``replay:SESSION``: a recording at its own pace, as if its sensor were there."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from urllib.parse import urlencode

import numpy as np

from spf.errors import SensorError, SessionError
from spf.live.source import About, Capture, LiveSource
from spf.live.uri import LiveUri
from spf.sessions import Session, open_session

__all__ = ["Replay"]

_CHOICES = {"topic": "/camera/depth", "camera": "camera.json", "camera_info": "/camera/info", "unit": "0.001"}
_OPTIONS = {"speed": "1", "loop": "0", **_CHOICES}
_LOOK = 0.2  # s after which a wait lets its user look whether to stop


class Replay(LiveSource):
    """A session as a live source; frames that are due are given whether or not somebody is ready, as a sensor does.

    Options: ``speed`` (2: twice as fast), ``loop=1`` (begin again at its end), and what is chosen of the recording
    (:mod:`spf.sessions.choice`).

    Raises:
        SensorError: an option is wrong.
    """

    warm_up = float("inf")
    remedy = "look at the recording with 'spf info'"

    def __init__(self, uri: LiveUri) -> None:
        uri.check_options(_OPTIONS)
        self._uri = uri
        self._speed = uri.number("speed", 1.0, 0.01, 100.0)
        self._loop = bool(uri.number("loop", 0, 0, 1))
        self._session: Session | None = None

    def open(self, stopped: Callable[[], bool] = lambda: False) -> About:
        """Open the session.

        Raises:
            SensorError: it cannot be opened.
        """
        chosen = {name: value for name, value in self._uri.options.items() if name in _CHOICES}
        try:
            session = open_session(self._uri.place + ("?" + urlencode(chosen) if chosen else ""))
        except SessionError as error:
            raise SensorError(str(error)) from error
        self._session = session
        gaps = np.diff(session.times)
        rate = float(self._speed / np.median(gaps)) if len(gaps) else 0.0
        sensor = session.metadata.get("sensor", "") or session.format
        metadata = {**session.metadata, "sensor": sensor, "replay_of": session.name}
        return About(sensor, session.camera, session.depth_unit, rate, session.side, metadata, session.warnings)

    def captures(self) -> Iterator[Capture | None]:
        """Yield the frames when they are due.

        Raises:
            SensorError: a frame cannot be read.
        """
        session = self._session
        assert session is not None
        began, number = time.monotonic(), 0
        # After its last frame a session that begins again waits for as long as between its first two.
        length = int(session.times_ns[-1]) + (int(session.times_ns[1]) if len(session) > 1 else 33_333_333)
        while True:
            turn, index = divmod(number, len(session))
            if turn and not self._loop:
                return
            time_ns = round((turn * length + int(session.times_ns[index])) / self._speed)
            due = began + time_ns / 1e9
            while due - time.monotonic() > _LOOK:
                time.sleep(_LOOK)
                yield None
            try:
                raw, colour = session.raw_depth(index), session.colour(index)
            except SessionError as error:
                raise SensorError(str(error)) from error
            time.sleep(max(due - time.monotonic(), 0.0))
            yield Capture(number, time_ns, due, raw, colour)
            number += 1

    def close(self) -> None:
        """Close the session."""
        if self._session is not None:
            self._session.close()
            self._session = None
