"""The three off-screen pictures under one view: quick ones while something moves, a sharp one when it has settled."""

from __future__ import annotations

import asyncio
import logging
import time
from typing import Any

import panel as pn

from app.results import Entry
from app.state import State
from app.views.picture import Picture
from app.views.scenes import PICTURES, scenes_of, view_of
from spf.errors import RenderError, RenderUnavailableError
from spf.render import Renderer, Scene

__all__ = ["ThreeD"]

_QUICK, _SHARP = (368, 276), (736, 552)
_SETTLED = 0.3  # s without a movement after which the sharp pictures are drawn
_PATIENCE = 1.0  # s that playing waits for a browser that shows nothing, such as a hidden tab
_log = logging.getLogger(__name__)


class ThreeD:
    """Draws what the state shows whenever it changes; the newest wins, and one drawing is in flight."""

    def __init__(self, state: State, renderer: Renderer) -> None:
        self._state, self._renderer = state, renderer
        self.panes = {
            name: Picture(
                on_shown=self._on_shown, on_orbit=self._on_orbit, on_reset=state.reset_view,
                alt=heading, sizing_mode="stretch_both", margin=0,
            )
            for name, heading in PICTURES.items()
        }  # fmt: skip
        self._scenes: tuple[Entry | None, dict[str, Scene]] = (None, {})
        self._wanted = False
        self._moved = 0.0
        self._drawing: asyncio.Task[None] | None = None
        self._awaited = 0  # pictures sent to the browser that it has not shown yet
        self._all_shown = asyncio.Event()
        state.param.watch(self.request, ["revision", "task", "azimuth", "elevation", "zoom", "playing"])

    def request(self, *_events: Any) -> None:
        """Have the present state drawn soon."""
        self._wanted = True
        if self._drawing is None or self._drawing.done():
            self._drawing = asyncio.get_running_loop().create_task(self._draw_until_settled())

    async def drawn(self) -> None:
        """Wait until the browser shows what was last requested; at most a second."""
        if self._drawing is not None:
            await self._drawing
        if self._awaited:
            try:
                await asyncio.wait_for(self._all_shown.wait(), _PATIENCE)
            except TimeoutError:
                self._awaited = 0  # nobody is looking: go on without

    def _on_shown(self) -> None:
        self._awaited = max(self._awaited - 1, 0)
        if not self._awaited:
            self._all_shown.set()

    def _on_orbit(self, right: float, up: float, magnify: float) -> None:
        self._moved = time.monotonic()
        self._state.orbit(right, up, magnify)

    async def _draw_until_settled(self) -> None:
        """Draw until nothing newer is wanted; then, unless playing, once more and sharp."""
        try:
            while True:
                self._wanted = False
                moving = self._state.playing or time.monotonic() - self._moved < _SETTLED
                await self._draw(sharp=not moving)
                if self._wanted:
                    continue
                if self._state.playing or not moving:
                    return
                await asyncio.sleep(_SETTLED)
        except RenderUnavailableError as error:
            self._blank(str(error))
        except RenderError as error:
            self._state.error = str(error)
        except Exception:
            _log.exception("A 3-D picture could not be drawn")
            self._state.error = "A 3-D picture could not be drawn; the server's log says why."

    async def _draw(self, *, sharp: bool) -> None:
        state, entry = self._state, self._state.entry
        if entry is None or entry.result.info is None:
            self._blank(self._hint())
            return
        if self._scenes[0] is not entry:
            self._scenes = (entry, await asyncio.get_running_loop().run_in_executor(None, scenes_of, entry))
        view = view_of(entry, state.azimuth, state.elevation, state.zoom)
        size, quality = (_SHARP, 92) if sharp else (_QUICK, 80)
        futures = {
            name: asyncio.wrap_future(
                self._renderer.submit(scene, view, size, encoding="jpeg", quality=quality, smooth=sharp)
            )
            for name, scene in self._scenes[1].items()
        }
        pictures = dict(zip(futures, await asyncio.gather(*futures.values()), strict=True))
        self._all_shown.clear()
        self._awaited = len(pictures)
        with pn.io.hold():
            for name, picture in pictures.items():
                self.panes[name].image = picture

    def _blank(self, hint: str) -> None:
        for pane in self.panes.values():
            pane.param.update(image=b"", hint=hint)

    def _hint(self) -> str:
        state = self._state
        if state.loss:
            return state.loss
        if state.task and state.summary is None:
            return f"{state.task} …"
        if state.origin is None:
            return "Press Start: the particles of each frame are drawn here."
        if state.summary is not None:
            return "The particles of this frame are no longer in memory; its results are in the plots."
        return "This frame is not tracked yet: step, play or jump further."
