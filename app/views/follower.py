"""What follows the state: drawn when something changed, seldom while frames go by, and only while it is seen."""

from __future__ import annotations

import time
from abc import ABC, abstractmethod
from typing import Any, ClassVar

import panel as pn

from app.state import State

__all__ = ["Follower"]

_PICTURES_FIRST = 400  # ms that the plots wait at most for the pictures of a frame, which are looked at first


class Follower(ABC):
    """A part of the page.

    Args:
        state: of the page.
        mode: of the page that it is seen in; None for both.
        also: parameters of the state that it is drawn after, besides what was tracked.
        look: parameters of the look that it is drawn after, besides the tab.
    """

    #: Tab of the page of one tracker that it is seen in.
    tab: ClassVar[str] = "overview"

    #: Seconds between two redraws while frames go by: playing, or tracked in the background.
    every: ClassVar[float] = 1.5

    def __init__(
        self, state: State, mode: str | None = "one", also: tuple[str, ...] = (), look: tuple[str, ...] = ()
    ) -> None:
        self.state, self._mode, self._drawn = state, mode, 0.0
        self._waiting: Any = None  # the document's callback that draws at the latest
        self._is_behind = False  # a redraw was left out
        state.param.watch(self._follow, ["revision", "playing", "previewed", *also])
        state.param.watch(self._pictured, "pictured")
        state.param.watch(self._catch_up, "task")
        state.look.param.watch(self._follow, ["tab", *look])

    def _follow(self, *events: Any) -> None:
        hidden = self._mode == "one" and self.state.look.tab != self.tab
        if self._mode is not None and (self.state.mode != self._mode or hidden):
            return
        now = time.monotonic()
        if (self.state.playing or self.state.task) and now - self._drawn < self.every:
            self._is_behind = True
            return  # the next frame comes soon, and the end of playing or of the task redraws in any case
        self._drawn, self._is_behind = now, False
        document = pn.state.curdoc
        if document is None or document.session_context is None:
            self.draw()
        elif any(event.name == "revision" for event in events):
            if self._waiting is None:
                self._waiting = document.add_timeout_callback(self._draw, _PICTURES_FIRST)
        else:  # Bokeh's own models are changed under the document's lock, which asynchronous actions don't hold
            document.add_next_tick_callback(self._draw)

    def _pictured(self, *_events: Any) -> None:
        document = pn.state.curdoc
        if self._waiting is not None and document is not None:
            document.remove_timeout_callback(self._waiting)
            self._waiting = None
            document.add_next_tick_callback(self._draw)

    def _draw(self) -> None:
        """Draw in one message, which keeps its place among those that Panel sends.

        Without it Bokeh may overtake what Panel has to send later because the connection is busy, and so speak of plots
        that the browser has not been sent yet.
        """
        self._waiting = None
        with pn.io.hold():
            self.draw()

    def _catch_up(self, _event: Any) -> None:
        if self._is_behind and not self.state.task:
            self._follow()

    @abstractmethod
    def draw(self) -> None:
        """Replace what is shown by what the state says."""
