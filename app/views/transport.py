"""Restart, step, play, pause and the slider over the frames."""

from __future__ import annotations

from typing import Any

import panel as pn
import panel_material_ui as pmu
import param

from app.controller import Controller
from app.state import State

__all__ = ["Transport"]

# What the slider's throttled value is put back to after each jump, so that a jump to the same frame is an event again.
# The value itself won't do: the browser echoes what the server sets, late, and that would be taken for a jump back.
_NOWHERE = -1


class Transport:
    """The row under the heading."""

    def __init__(self, state: State, controller: Controller) -> None:
        self._state, self._controller = state, controller
        button = {"variant": "outlined", "size": "small", "margin": (8, 4)}
        self._restart = pmu.Button(label="Restart", icon="replay", on_click=self._on_restart, **button)
        self._step = pmu.Button(label="Step", icon="skip_next", on_click=self._on_step, **button)
        self._play = pmu.Button(label="Play", icon="play_arrow", on_click=self._on_play, width=104, size="small",
                                margin=(8, 4))  # fmt: skip
        self._slider = pmu.IntSlider(
            label="", show_value=False, css_classes=["frame-slider"], start=0, end=1, value=0, disabled=True,
            sizing_mode="stretch_width", margin=(8, 18), size="small",
        )  # fmt: skip
        self._count = pn.pane.HTML("", width=290, margin=(12, 8), align="center")
        self._rearm()
        self._slider.param.watch(self._on_slide, "value_throttled")
        state.param.watch(
            self._follow, ["session", "frame", "revision", "task", "playing", "origin", "mode", "lanes", "lane"]
        )
        self._follow()
        self.panel = pmu.Row(
            self._restart, self._step, self._play, self._slider, self._count, sizing_mode="stretch_width"
        )

    async def _on_restart(self, _event: Any) -> None:
        await self._controller.restart()

    async def _on_step(self, _event: Any) -> None:
        await self._controller.step()

    async def _on_play(self, _event: Any) -> None:
        if self._state.playing:
            self._controller.pause()
        else:
            await self._controller.play()

    async def _on_slide(self, event: Any) -> None:
        if event.new == _NOWHERE:
            return
        self._rearm()
        await self._controller.jump(event.new)

    def _rearm(self) -> None:
        with param.edit_constant(self._slider):
            self._slider.value_throttled = _NOWHERE

    def _follow(self, *_events: Any) -> None:
        state = self._state
        ready = state.origin is not None and not state.task
        can_go = ready and state.next_frame is not None
        self._restart.disabled = not ready
        self._step.disabled = not can_go or state.playing
        self._play.param.update(
            disabled=not (can_go or state.playing),
            label="Pause" if state.playing else "Play",
            icon="pause" if state.playing else "play_arrow",
        )
        if state.session is None:
            return
        self._slider.param.update(end=max(len(state.session) - 1, 1), value=state.frame, disabled=False)
        last = state.last
        summaries = [lane.summary(state.frame) for lane in state.active]
        tracked = "not tracked" if last is None else f"tracked to {last}"
        took = f" · {1000 * sum(s.seconds for s in summaries if s is not None):.0f} ms" if any(summaries) else ""
        lost = state.lane.loss(state.frame) if state.mode == "one" else ""
        what = f"<span style='color:#b33c00;font-weight:500'>{lost}</span>" if lost else f"{tracked}{took}"
        self._count.object = (
            "<div style='font:13px/1.3 Roboto,sans-serif;color:#2a3038;font-variant-numeric:tabular-nums'>"
            f"<b>Frame {state.frame}</b> of {len(state.session) - 1} · {what}</div>"
        )
