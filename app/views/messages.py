"""What went wrong, what may be wrong, and why something is not done now: one sentence each."""

from __future__ import annotations

from typing import Any

import panel_material_ui as pmu

from app.state import State

__all__ = ["Messages"]


class Messages:
    """Alerts that take no room while there is nothing to say; the visitor may close them."""

    def __init__(self, state: State) -> None:
        self._state = state
        options = {"sizing_mode": "stretch_width", "visible": False, "margin": (2, 8), "sx": {"py": "0px"}}
        self._error = pmu.Alert(
            severity="error", closeable=True, variant="outlined", css_classes=["message-error"], **options
        )
        self._warning = pmu.Alert(
            severity="warning", closeable=True, variant="outlined", css_classes=["message-warning"], **options
        )
        self._answer = pmu.Alert(
            severity="info", closeable=True, variant="outlined", css_classes=["message-answer"], **options
        )
        self._error.param.watch(lambda event: self._close("error", event.new), "closed")
        self._warning.param.watch(lambda event: self._close("warning", event.new), "closed")
        self._answer.param.watch(lambda event: self._close("answer", event.new), "closed")
        state.param.watch(self._follow, ["error", "warning", "answer"])
        self.panel = pmu.Column(self._error, self._warning, self._answer, sizing_mode="stretch_width", margin=0)

    def _close(self, name: str, closed: bool) -> None:
        if closed:
            setattr(self._state, name, "")

    def _follow(self, *_events: Any) -> None:
        state = self._state
        shown = (self._error, state.error), (self._warning, state.warning), (self._answer, state.answer)
        for alert, text in shown:
            alert.param.update(title=text, visible=bool(text), closed=not text)
