"""Connect to a live sensor, see it tracked, record it with markers and notes, and open what was recorded."""

from __future__ import annotations

import asyncio
import datetime
import html
from collections.abc import Awaitable, Callable
from pathlib import Path
from typing import Any

import panel as pn
import panel_material_ui as pmu

from app.live import Live, LiveFacts
from app.state import State
from app.views.depth import depth_jpeg
from app.views.picture import Picture
from spf.errors import SpfError
from spf.live import SENSORS
from spf.live.tracking import Request
from spf.progress import Report
from spf.render import Skeleton

__all__ = ["LiveCard", "told"]

_ESTIMATE = (255, 255, 255)  # RGB
_PICTURE_EVERY = 1 / 20  # s between two pictures at the least
_FACTS_EVERY = 0.25  # s
_SIDES: dict[str, str] = {"Find its side": "", "Left": "left", "Right": "right"}


class LiveCard:
    """The card, and the picture that takes the place of the session's while a sensor is connected.

    Args:
        state: of the page; the chosen lane's tracker and settings are used.
        open_: opens a session.
        folder: that recordings are written to.
        kernels: waits until the kernels are compiled.
    """

    def __init__(
        self,
        state: State,
        open_: Callable[[str, str], Awaitable[None]],
        folder: Path,
        kernels: Callable[[Report], None],
    ) -> None:
        self._state, self._open, self._folder, self._kernels = state, open_, folder, kernels
        self.live: Live | None = None
        self._recorded: Path | None = None
        self._others: list[Any] = []
        self._picture = Picture(
            on_shown=self._arrived, hint="Waiting for the sensor's first frame.", alt="Live depth image",
            sizing_mode="stretch_width", height=560, margin=(4, 10),
        )  # fmt: skip
        self._facts = pn.pane.HTML("", sizing_mode="stretch_width", margin=(4, 12), css_classes=["live-facts"])
        self._shown = asyncio.Event()
        self.view = pmu.Column(self._picture, self._facts, sizing_mode="stretch_width", margin=0, visible=False)
        small = {"size": "small", "sizing_mode": "stretch_width"}
        self._uri = pmu.TextInput(
            label="Live sensor", value="realsense:", **small,
            description="; ".join(sensor.example for sensor in SENSORS.values()),
        )  # fmt: skip
        self._side = pmu.Select(label="Hand shown", options=_SIDES, value="", **small)
        self._connect = pmu.Button(label="Connect", icon="sensors", size="small", on_click=self._toggle)
        self._record = pmu.Button(
            label="Record", icon="fiber_manual_record", color="error", size="small", disabled=True,
            on_click=self._toggle_recording,
        )  # fmt: skip
        self._note = pmu.TextInput(label="Note (empty: a marker)", disabled=True, **small)
        self._mark = pmu.Button(label="Mark", icon="flag", size="small", disabled=True, on_click=self._set_mark)
        self._reopen = pmu.Button(
            label="Open the recording", icon="folder_open", size="small", visible=False, on_click=self._open_recorded
        )
        self.panel = pmu.Column(
            self._uri, self._side, pmu.Row(self._connect, self._record), self._note, pmu.Row(self._mark, self._reopen),
            sizing_mode="stretch_width", margin=0,
        )  # fmt: skip

    def replaces(self, *others: Any) -> None:
        """Say which parts of the page are hidden while a sensor is connected."""
        self._others = list(others)

    def close(self) -> None:
        """Disconnect when the page is left; a recording is ended whole."""
        live, self.live = self.live, None
        if live is not None:
            live.close()

    # ---- what the visitor wants

    async def _toggle(self, _event: Any) -> None:
        if self.live is not None:
            await self._disconnect()
            return
        lane = self._state.lane
        request = Request(lane.tracker, lane.preset, lane.settings, self._state.seed, side=self._side.value or None)
        uri = (self._uri.value_input or self._uri.value).strip()
        try:
            self.live = Live(uri, request, self._kernels)
        except SpfError as error:
            self._state.error = str(error)
            return
        self._state.param.update(error="", playing=False)
        self._picture.show(b"")
        self._lay_out()
        asyncio.ensure_future(self._show(self.live))  # noqa: RUF006 - it ends with the connection

    async def _disconnect(self) -> None:
        live, self.live = self.live, None
        assert live is not None
        recording = await asyncio.to_thread(live.close)
        if recording is not None:
            self._recorded = recording.path
        self._lay_out()

    async def _toggle_recording(self, _event: Any) -> None:
        live = self.live
        if live is None:
            return
        if live.facts.recording is not None:
            recording = await asyncio.to_thread(live.stop_recording)
            self._recorded = None if recording is None else recording.path
        else:
            name = f"live-{datetime.datetime.now():%Y-%m-%d-%H%M%S}.mcap"
            try:
                await asyncio.to_thread(live.record, self._folder / name)
                self._state.error = ""
            except (SpfError, OSError) as error:
                self._state.error = str(error)
        self._lay_out()

    def _set_mark(self, _event: Any) -> None:
        text = (self._note.value_input or self._note.value).strip()
        if self.live is None:
            return
        if self.live.note(text):
            self._note.param.update(value="", value_input="")
        else:
            self._state.error = "The marker was not kept, as nothing is recorded any more."

    async def _open_recorded(self, _event: Any) -> None:
        path = self._recorded
        if self.live is not None:
            await self._disconnect()
        if path is not None:
            await self._open(str(path), "")

    # ---- what is shown

    def _lay_out(self) -> None:
        live = self.live
        recording = live is not None and live.facts.recording is not None
        self._connect.param.update(
            label="Connect" if live is None else "Disconnect", icon="sensors" if live is None else "sensors_off"
        )
        self._uri.disabled = self._side.disabled = live is not None
        self._record.param.update(
            label="Stop recording" if recording else "Record",
            icon="stop" if recording else "fiber_manual_record",
            disabled=live is None,
        )
        self._note.disabled = self._mark.disabled = not recording
        self._reopen.visible = self._recorded is not None and not recording
        self.view.visible = live is not None
        for other in self._others:
            other.visible = live is None

    def _arrived(self) -> None:
        self._shown.set()

    async def _show(self, live: Live) -> None:
        """Show the newest picture, one in flight, and how it stands, until the sensor is disconnected."""
        number, told_at = -1, 0.0
        loop = asyncio.get_running_loop()
        while live is self.live:
            now = loop.time()
            if now - told_at > _FACTS_EVERY:
                told_at, facts = now, live.facts
                self._facts.object = told(facts)
                if facts.recording is not None and facts.recording.ended:
                    self._state.error = facts.recording.ended
                    await self._toggle_recording(None)
            picture = live.picture
            if picture is not None and picture.number != number:
                number = picture.number
                skeletons = [] if picture.joints is None else [Skeleton(picture.joints, _ESTIMATE)]
                image = await asyncio.to_thread(depth_jpeg, picture.frame, None, skeletons)
                self._shown.clear()
                self._picture.show(image)
                try:
                    await asyncio.wait_for(self._shown.wait(), 1.0)
                except TimeoutError:
                    continue  # a browser in the background says nothing: the next one is sent all the same
            await asyncio.sleep(max(_PICTURE_EVERY - (loop.time() - now), 0.01))


def told(facts: LiveFacts) -> str:
    """Return how a live sensor stands, as HTML."""
    feed = facts.feed
    sensor = feed.about.sensor if feed.about is not None else "no sensor yet"
    numbers = [f"{sensor}: {feed.rate:.0f} frames/s"]
    if facts.latency_ms is not None:
        middle, high = facts.latency_ms
        numbers.append(f"tracked {facts.tracked_rate:.0f}/s")
        numbers.append(f"latency {middle:.0f} ms, 95 % under {high:.0f} ms")
        numbers.append(f"{facts.dropped} dropped for newer ones")
        if facts.lost:
            numbers.append(f"hand lost in {facts.lost}")
    if feed.missing:
        numbers.append(f"{feed.missing} lost before this computer")
    if feed.reconnected:
        numbers.append(f"connected again {feed.reconnected}×")
    lines = [f"<b>{html.escape(facts.doing)}</b> · {html.escape(' · '.join(numbers))}"]
    recording = facts.recording
    if recording is not None:
        lost = f", <b>{recording.lost} not recorded</b>" if recording.lost else ""
        notes = f", <b>{recording.notes_lost} markers and notes not kept</b>" if recording.notes_lost else ""
        lines.append(
            f"<span style='color:#c62828'>●</span> Recording {html.escape(recording.path.name)}: {recording.frames} frames, "
            f"{recording.seconds:.0f} s, {recording.size / 1e6:.1f} MB{lost}{notes}"
        )
    warnings = [
        text for text in (facts.error, facts.warning, feed.message, recording.warning if recording else "") if text
    ]
    lines += [f"<span class='live-warning' style='color:#b26a00'>{html.escape(text)}</span>" for text in warnings]
    return f"<div style='font:13px/1.6 Roboto,sans-serif'>{'<br>'.join(lines)}</div>"
