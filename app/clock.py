"""How long what is being done still takes."""

from __future__ import annotations

import time

__all__ = ["Clock"]

_SURE = 3  # parts after which an estimate is worth something


class Clock:
    """Estimates the time left from the time that the parts done so far have taken.

    Args:
        parts: of the work.
    """

    def __init__(self, parts: int) -> None:
        self._parts, self._began = parts, time.monotonic()

    def left(self, done: int) -> str:
        """Return the time left in words, nothing while it is not known."""
        if done < min(_SURE, self._parts):
            return ""
        seconds = (time.monotonic() - self._began) / done * (self._parts - done)
        if seconds < 90:
            return f"about {max(round(seconds), 1)} s left"
        return f"about {round(seconds / 60)} min left"
