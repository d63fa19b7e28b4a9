"""Track again with the present settings: from here on, all of it, or this frame alone."""

from __future__ import annotations

from collections.abc import Awaitable, Callable
from typing import Any

import panel_material_ui as pmu

from app.reruns import Reruns
from app.state import State

__all__ = ["AgainCard"]


class AgainCard:
    """The buttons; what was tracked before is kept as a run of its own."""

    def __init__(self, state: State, reruns: Reruns) -> None:
        self._state = state

        def button(label: str, icon: str, act: Callable[[], Awaitable[None]]) -> pmu.Button:
            async def clicked(_event: Any) -> None:
                await act()

            return pmu.Button(
                label=label, icon=icon, size="small", variant="outlined", margin=(3, 4),
                sizing_mode="stretch_width", on_click=clicked,
            )  # fmt: skip

        self._buttons = [
            button("Re-run from here", "fast_forward", lambda: reruns.rerun(state.frame)),
            button("Re-run all", "replay", reruns.rerun),
            button("This frame again", "refresh", reruns.again),
            button("… with the next seed", "casino", lambda: reruns.again(other_seed=True)),
        ]  # fmt: skip
        rows = [pmu.Row(*self._buttons[at : at + 2], sizing_mode="stretch_width", margin=(0, 6)) for at in (0, 2)]
        state.param.watch(self._follow, ["revision", "task", "playing", "lane", "origin"])
        self._follow()
        self.panel = pmu.Column(*rows, sizing_mode="stretch_width", margin=0)

    def _follow(self, *_events: Any) -> None:
        state = self._state
        ready = state.origin is not None and not state.busy
        here = ready and state.lane.summary(state.frame) is not None
        for button, can in zip(self._buttons, (here, ready and state.lane.results.last is not None, here, here),
                               strict=True):  # fmt: skip
            button.disabled = not can
