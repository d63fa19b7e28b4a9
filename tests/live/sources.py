"""Sources that a test controls: what they give, when they fail and how fast they are."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence

import numpy as np

from spf.errors import SensorError
from spf.frame import Camera
from spf.live.source import About, Capture, LiveSource

CAMERA = Camera(32, 24, 30.0, 31.0, 15.5, 11.5)
ABOUT = About("fake № 7", CAMERA, 0.0005, 30.0, "left", {"serial": "F7"})


def raw_of(number: int) -> np.ndarray:
    """The image with a number, different for each."""
    return np.random.default_rng(number).integers(0, 65536, (CAMERA.height, CAMERA.width), dtype=np.uint16)


class Scripted(LiveSource):
    """Plays scripts, one for each time it is opened.

    A script is a sequence of: int, the number of a capture to give (stamps are numbers / 30 s); SensorError, to raise;
    float, seconds to wait; None, nothing came. A SensorError as a whole script fails the opening.
    """

    def __init__(self, *scripts: Sequence[object] | SensorError, first_stamp_ns: Sequence[int] = (0,)) -> None:
        self.scripts = list(scripts)
        self.about = ABOUT
        self.opened = self.closed = 0
        self._stamps = first_stamp_ns

    def open(self, stopped: Callable[[], bool] = lambda: False) -> About:
        script = self.scripts[min(self.opened, len(self.scripts) - 1)]
        self.opened += 1
        if isinstance(script, SensorError):
            raise script
        self._script = script
        self._stamp = self._stamps[min(self.opened - 1, len(self._stamps) - 1)]
        return self.about

    def captures(self) -> Iterator[Capture | None]:
        for step in self._script:
            if isinstance(step, SensorError):
                raise step
            if isinstance(step, float):
                time.sleep(step)
            elif step is None:
                yield None
            else:
                assert isinstance(step, int)
                yield Capture(step, self._stamp + round(step / 30 * 1e9), time.monotonic(), raw_of(step))

    def close(self) -> None:
        self.closed += 1


def finish(feed) -> None:
    """Wait until a feed has ended."""
    while not feed.state.ended:
        time.sleep(0.005)
