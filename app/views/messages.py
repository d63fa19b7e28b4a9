"""What goes on in the background, and what went wrong: one sentence each."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import panel_material_ui as pmu

from app.state import State

__all__ = ["Messages"]


class Messages:
    """Alerts that take no room while there is nothing to say."""

    def __init__(self, state: State, cancel: Callable[[], None]) -> None:
        self._state = state
        options = {"sizing_mode": "stretch_width", "visible": False, "margin": (4, 8), "variant": "outlined"}
        self._error = pmu.Alert(severity="error", css_classes=["message-error"], **options)
        self._warning = pmu.Alert(severity="warning", css_classes=["message-warning"], **options)
        self._loss = pmu.Alert(severity="warning", css_classes=["message-loss"], **{**options, "variant": "filled"})
        self._text = pmu.Typography("", variant="body2", margin=(10, 8), width=250)
        self._bar = pmu.LinearProgress(
            value=0, max=100, sizing_mode="stretch_width", margin=(18, 8), variant="determinate"
        )
        stop = pmu.Button(
            label="Cancel",
            icon="close",
            size="small",
            variant="outlined",
            on_click=lambda _event: cancel(),
            margin=(4, 8),
        )
        self._work = pmu.Row(self._text, self._bar, stop, visible=False, sizing_mode="stretch_width")
        state.param.watch(self._follow, ["error", "warning", "task", "share", "revision", "frame"])
        self.panel = pmu.Column(self._work, self._error, self._warning, self._loss, sizing_mode="stretch_width")

    def _follow(self, *_events: Any) -> None:
        state = self._state
        self._work.visible = bool(state.task)
        if state.task:
            self._text.object = state.task
            self._bar.param.update(
                value=round(100 * state.share), variant="determinate" if state.share > 0 else "indeterminate"
            )
        for alert, text in ((self._error, state.error), (self._warning, state.warning), (self._loss, state.loss)):
            alert.param.update(title=text, visible=bool(text))
