"""In the page's head: what goes on in the background, how far it is, and a way to give it up."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import panel_material_ui as pmu

from app.state import State

__all__ = ["Status"]

_LIGHT = {"color": "white", "borderColor": "rgba(255, 255, 255, 0.7)"}


class Status:
    """A line of text, a bar and a button; it takes no room from the page, whether there is something to say or not."""

    def __init__(self, state: State, cancel: Callable[[], None]) -> None:
        self._state = state
        self._text = pmu.Typography("", variant="body2", margin=(6, 8), sx={"color": "white", "whiteSpace": "nowrap"})
        self._bar = pmu.LinearProgress(value=0, max=100, width=150, margin=(14, 8), variant="indeterminate", sx={
            "backgroundColor": "rgba(255, 255, 255, 0.3)", "& .MuiLinearProgress-bar": {"backgroundColor": "white"},
        })  # fmt: skip
        self._stop = pmu.Button(
            label="Cancel", icon="close", size="small", variant="outlined", on_click=lambda _event: cancel(),
            margin=(2, 8), sx=_LIGHT,
        )  # fmt: skip
        state.param.watch(self._follow, ["task", "share", "left", "preparing"])
        self.panel = pmu.Row(self._text, self._bar, self._stop, visible=False, margin=(6, 0, 0, 0))
        self._follow()

    def _follow(self, *_events: Any) -> None:
        state = self._state
        text = state.task or state.preparing
        self._text.object = f"{text} · {state.left}" if state.left and state.task else text
        self._stop.visible = bool(state.task)
        self._bar.param.update(
            value=round(100 * state.share), variant="determinate" if state.share > 0 else "indeterminate"
        )
        self.panel.visible = bool(text)
