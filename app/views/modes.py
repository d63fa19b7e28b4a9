"""Which part of the page is seen: one tracker, several compared, or the help; each is made when it is first asked for."""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable
from typing import Any

import panel as pn
import panel_material_ui as pmu

from app.state import MODES, State
from app.views.comparison import Comparison
from app.views.detail import Detail
from app.views.help import Help
from app.views.three_d import ThreeD
from spf.render import Renderer

__all__ = ["Modes"]


_A_MOMENT = 0.1  # s in which the browser says what it is about to do, for it then is busy
_LAYING_OUT = {"compare": "Laying out the comparison", "help": "Opening the help"}
_SWITCH = {
    "& .MuiToggleButton-root": {
        "color": "white", "borderColor": "rgba(255, 255, 255, 0.5)", "padding": "3px 12px", "whiteSpace": "nowrap",
        "textTransform": "none",
    },
    "& .MuiToggleButton-root.Mui-selected": {"color": "#1f4e79", "backgroundColor": "white"},
    "& .MuiToggleButton-root.Mui-selected:hover": {"color": "#1f4e79", "backgroundColor": "#e6edf4"},
}  # fmt: skip


class Modes:
    """The switch in the page's head, and the part below."""

    def __init__(self, state: State, renderer: Renderer) -> None:
        self._state, self._renderer = state, renderer
        self.detail = Detail(state, renderer)
        self._parts: dict[str, Detail | Comparison | Help] = {"one": self.detail}
        self.panel = pn.Column(self.detail.panel, sizing_mode="stretch_width", margin=0)
        state.param.watch(self._follow, "mode")

    def switch(self, show: Callable[[str], Awaitable[None]]) -> pmu.RadioButtonGroup:
        """Return the switch.

        Args:
            show: shows a mode.
        """
        group = pmu.RadioButtonGroup(
            options=MODES, value=self._state.mode, size="small", margin=(8, 16), width=250, sx=_SWITCH
        )

        async def picked(event: Any) -> None:
            if event.new == self._state.mode:
                return
            if event.new not in self._parts:
                self._state.preparing = _LAYING_OUT[event.new]
                await asyncio.sleep(_A_MOMENT)
            await show(event.new)
            self._state.preparing = ""

        group.param.watch(picked, "value")
        self._state.param.watch(lambda event: setattr(group, "value", event.new), "mode")
        return group

    @property
    def pictures(self) -> ThreeD:
        """The pictures that are seen."""
        return self._parts[self._state.mode].pictures

    async def drawn(self) -> None:
        """Wait until the browser shows the latest frame."""
        await self.pictures.drawn()

    def _follow(self, *_events: Any) -> None:
        mode = self._state.mode
        if mode not in self._parts:
            made = Comparison if mode == "compare" else Help
            self._parts[mode] = made(self._state, self._renderer)
            self.panel.append(self._parts[mode].panel)
        for name, part in self._parts.items():
            part.panel.visible = name == mode
        self.pictures.request()
