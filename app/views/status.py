"""In the page's head: what goes on in the background, how far it is, and a way to give it up."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import panel_material_ui as pmu

from app.state import State

__all__ = ["Status"]

_LIGHT = {"color": "white", "borderColor": "rgba(255, 255, 255, 0.7)"}
_ONE_LINE = {
    "color": "white",
    "whiteSpace": "nowrap",
    "overflow": "hidden",
    "textOverflow": "ellipsis",
    "lineHeight": 1.4,
}
_SHRINKING = {
    "flex": "1 1 0",
    "min-width": "0",
}  # with the head of the page, so that the button is never pushed out of it


class Status:
    """A line of text over a bar, cut short where the page is narrow, and a button that is not.

    It takes no room from the page, whether there is something to say or not.
    """

    def __init__(self, state: State, cancel: Callable[[], None]) -> None:
        self._state = state
        self._text = pmu.Typography("", variant="body2", margin=0, sizing_mode="stretch_width", sx=_ONE_LINE)
        self._bar = pmu.LinearProgress(
            value=0, max=100, margin=(4, 0, 0, 0), sizing_mode="stretch_width", variant="indeterminate", sx={
                "backgroundColor": "rgba(255, 255, 255, 0.3)", "& .MuiLinearProgress-bar": {"backgroundColor": "white"},
            },
        )  # fmt: skip
        said = pmu.Column(self._text, self._bar, margin=(7, 8), styles=_SHRINKING | {"max-width": "300px"})
        self._stop = pmu.Button(
            label="Cancel", icon="close", size="small", variant="outlined", on_click=lambda _event: cancel(),
            margin=(8, 8), sx=_LIGHT,
        )  # fmt: skip
        state.param.watch(self._follow, ["task", "share", "left", "preparing"])
        self.panel = pmu.Row(said, self._stop, visible=False, margin=0, styles=_SHRINKING)
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
