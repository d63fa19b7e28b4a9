"""Off-screen pictures under one view: quick ones while something moves, sharp ones when it has settled."""

from __future__ import annotations

import asyncio
import logging
import time
from collections.abc import AsyncIterator, Callable
from typing import Any
from uuid import uuid4

import panel as pn

from app.lane import Lane
from app.look import Shown
from app.results import Entry
from app.state import State
from app.views.picture import Picture
from app.views.scenes import view_of
from spf.errors import RenderError, RenderUnavailableError
from spf.render import Renderer, Scene, ViewCamera

__all__ = ["ThreeD"]

Size = tuple[int, int]
_SIZES: tuple[Size, Size] = (368, 276), (736, 552)  # quick, sharp
_SETTLED = 0.3  # s without a movement after which the sharp pictures are drawn
_PATIENCE = 1.0  # s that playing waits for a browser that shows nothing, such as a hidden tab
_WITHOUT = "Then start the server again; everything else on this page works without."
_WHEN_LOST = (
    "It is looked for in every frame: go on with Step or Play, or re-run from a frame before with other settings."
)
_log = logging.getLogger(__name__)


class ThreeD:
    """Draws what the state shows whenever it changes; the newest wins, and one drawing is in flight.

    Args:
        state: of the page.
        renderer: of the server.
        mode: of the page that the pictures are seen in.
        names: name of each picture → what it shows, for who cannot see it.
        lanes: returns the lane that each picture shows; a name without one is a picture that shows nothing.
        scene: makes the scene of a picture, None when there is nothing to draw.
        tab: of the page of one tracker that the pictures are seen in.
        sizes: (width, height) in pixels of quick pictures, and of sharp ones.
    """

    def __init__(
        self,
        state: State,
        renderer: Renderer,
        mode: str,
        names: dict[str, str],
        lanes: Callable[[], dict[str, Lane]],
        scene: Callable[[str, Entry, Shown], Scene | None],
        *,
        tab: str = "overview",
        sizes: tuple[Size, Size] = _SIZES,
    ) -> None:
        self._state, self._renderer, self._lanes, self._scene = state, renderer, lanes, scene
        self._mode, self._tab, self._sizes = mode, tab, sizes
        group = uuid4().hex
        self.panes = {
            name: Picture(
                on_shown=self._on_shown, on_orbit=self._on_orbit, on_pan=self._on_pan, on_reset=state.reset_view,
                alt=alt, group=group, sizing_mode="stretch_both", margin=0,
            )
            for name, alt in names.items()
        }  # fmt: skip
        self._made: dict[str, tuple[Entry, Shown, Scene | None]] = {}
        self._wanted = False
        self._moved = 0.0
        self._view: ViewCamera | None = None  # of the last picture
        self._drawing: asyncio.Task[None] | None = None
        self._is_drawing = False
        self._brought: list[tuple[int, Picture, bytes]] = []  # with the request that each was drawn for
        self._asked = self._sent = self._seen = self._before = 0  # requests so far: made, sent, seen, at the last wait
        self._all_shown = asyncio.Event()
        state.param.watch(self.request, ["revision", "task", "preparing", "azimuth", "elevation", "zoom", "playing"])
        state.look.param.watch(self.request, ["tab", "layers", "colouring", "selected", "pan", "anchor"])

    def request(self, *events: Any) -> None:
        """Have the present state drawn soon; a new frame quickly first, and sharp when it has settled."""
        if any(event.name == "revision" for event in events):
            self._moved = time.monotonic()
        state = self._state
        if state.mode != self._mode or (self._mode == "one" and state.look.tab != self._tab):
            return
        self._wanted = True
        self._asked += 1
        state.awaited = True
        if self._drawing is None or self._drawing.done():
            self._drawing = asyncio.get_running_loop().create_task(self._draw_until_settled())

    async def drawn(self) -> None:
        """Wait until the browser shows what was requested before the last wait; at most a second.

        So one frame is drawn while the next one is tracked, and never two.
        """
        goal, self._before = self._before, self._asked
        deadline = time.monotonic() + _PATIENCE
        while self._seen < goal:
            self._all_shown.clear()
            try:
                await asyncio.wait_for(self._all_shown.wait(), deadline - time.monotonic())
            except TimeoutError:
                self._seen = self._asked  # nobody is looking: go on without

    @property
    def asked(self) -> int:
        """The number of the last request."""
        return self._asked

    def bring(self, pane: Picture, content: bytes, asked: int) -> None:
        """Show another picture in one message with those of its frame, for messages are dear; at once while none is drawn.

        Args:
            pane: that shows it, none of these.
            content: a JPEG file.
            asked: number of the last request when it began to be drawn.
        """
        self._brought.append((asked, pane, content))
        if not self._is_drawing:
            self._send({}, self._asked)

    def _on_shown(self) -> None:
        self._seen = max(self._seen, self._sent)
        self._all_shown.set()
        self._state.pictured += 1

    def _on_orbit(self, right: float, up: float, magnify: float) -> None:
        self._moved = time.monotonic()
        self._state.orbit(right, up, magnify)

    def _on_pan(self, right: float, up: float) -> None:
        """Move the eye against a drag, given in heights of the picture."""
        self._moved = time.monotonic()
        if self._view is not None:
            seen, pan = self._view.extent / self._view.zoom, self._state.look.pan
            self._state.look.pan = (pan[0] - seen * right, pan[1] - seen * up)

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
                self._state.awaited = False
                await asyncio.sleep(_SETTLED)
        except RenderUnavailableError as error:
            for pane in self.panes.values():
                pane.param.update(source="", hint=f"{error} {_WITHOUT}")
        except RenderError as error:
            self._state.error = str(error)
        except Exception:
            _log.exception("A 3-D picture could not be drawn")
            self._state.error = "A 3-D picture could not be drawn; the server's log says why."
        finally:
            self._state.awaited = False

    async def _draw(self, *, sharp: bool) -> None:
        """Draw and send the pictures, and what was brought meanwhile, whether they could be drawn or not."""
        asked, frame, pictures, self._is_drawing = self._asked, self._state.frame, dict[Picture, bytes](), True
        try:
            pictures = await self._pictures(sharp=sharp)
        finally:
            self._is_drawing = False
            if pictures:
                self._sent = asked
            else:
                self._seen = asked
            self._state.sent = frame
            self._send(pictures, asked)

    def _send(self, pictures: dict[Picture, bytes], asked: int) -> None:
        """Send pictures, with those brought for the same request or one before; what is newer goes with its own."""
        ready = {pane: content for at, pane, content in self._brought if at <= asked}  # the last of each
        with pn.io.hold():
            for pane, content in {**ready, **pictures}.items():
                pane.show(content)
            self._brought = [brought for brought in self._brought if brought[0] > asked]
            self._state.sending += 1

    async def _pictures(self, *, sharp: bool) -> dict[Picture, bytes]:
        """Have each picture drawn as soon as its scene is made, while the next scene is."""
        state, lanes = self._state, self._lanes()
        entries = {name: entry for name, lane in lanes.items() if (entry := lane.entry(state.frame)) is not None}
        with_hand = [entry for entry in entries.values() if entry.result.info is not None and entry.seen is not None]
        if with_hand:
            self._view = view_of(with_hand, state)
        size, quality = (self._sizes[1], 92) if sharp else (self._sizes[0], 80)
        futures = {}
        async for name, scene in self._scenes(entries):
            if scene is not None:
                assert self._view is not None
                picture = self._renderer.submit(scene, self._view, size, encoding="jpeg", quality=quality, smooth=sharp)
                futures[name] = asyncio.wrap_future(picture)
        for name, lane in lanes.items():
            if name not in futures:
                self.panes[name].param.update(source="", hint=self._hint(lane))
        contents = await asyncio.gather(*futures.values())
        return {self.panes[name]: content for name, content in zip(futures, contents, strict=True)}

    async def _scenes(self, entries: dict[str, Entry]) -> AsyncIterator[tuple[str, Scene | None]]:
        """The scenes of entries, one after the other, made beside the event loop unless they were drawn last."""
        loop, shown = asyncio.get_running_loop(), self._state.look.shown
        self._made = {name: made for name, made in self._made.items() if name in entries}
        for name, entry in entries.items():
            last = self._made.get(name)
            if last is None or last[0] is not entry or last[1] != shown:
                last = entry, shown, await loop.run_in_executor(None, self._scene, name, entry, shown)
                self._made[name] = last
            yield name, last[2]

    def _hint(self, lane: Lane) -> str:
        """What is said in place of a picture."""
        state, summary = self._state, lane.summary(self._state.frame)
        if state.session is None:
            return "Choose a session on the left, or open another one there."
        if lane.loss(state.frame):
            return f"{lane.loss(state.frame)}. {_WHEN_LOST}"
        if summary is None and (state.task or state.preparing):
            return f"{state.task or state.preparing} …"
        if state.origin is None:
            return "Press Start: each tracked frame is drawn here."
        entry = lane.entry(state.frame)
        if entry is not None:
            return "This tracker keeps no trajectories." if entry.result.info is not None else "Nothing to draw."
        if summary is not None:
            return "The particles of this frame are no longer in memory; its results are in the plots."
        return "This frame is not tracked yet: step, play or jump further."
