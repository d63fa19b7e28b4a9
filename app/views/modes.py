"""Which part of the page is seen: one tracker, or several compared; the second is made when it is first asked for."""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable
from typing import Any

import panel as pn
import panel_material_ui as pmu

from app.state import MODES, State
from app.views.comparison import Comparison
from app.views.detail import Detail
from app.views.three_d import ThreeD
from spf.render import Renderer

__all__ = ["Modes"]


_A_MOMENT = 0.1  # s in which the browser says what it is about to do, for it then is busy
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
        self._one = Detail(state, renderer)
        self._several: Comparison | None = None
        self.panel = pn.Column(self._one.panel, sizing_mode="stretch_width", margin=0)
        state.param.watch(self._follow, "mode")

    def switch(self, show: Callable[[str], Awaitable[None]]) -> pmu.RadioButtonGroup:
        """Return the switch.

        Args:
            show: shows a mode.
        """
        group = pmu.RadioButtonGroup(
            options=MODES, value=self._state.mode, size="small", margin=(8, 16), width=190, sx=_SWITCH
        )

        async def picked(event: Any) -> None:
            if event.new == "compare" and self._several is None:
                self._state.preparing = "Laying out the comparison"
                await asyncio.sleep(_A_MOMENT)
            await show(event.new)
            self._state.preparing = ""

        group.param.watch(picked, "value")
        return group

    @property
    def pictures(self) -> ThreeD:
        """The pictures that are seen."""
        return self._one.pictures if self._several is None or self._state.mode == "one" else self._several.pictures

    async def drawn(self) -> None:
        """Wait until the browser shows the latest frame."""
        await self.pictures.drawn()

    def _follow(self, *_events: Any) -> None:
        several = self._state.mode == "compare"
        if several and self._several is None:
            self._several = Comparison(self._state, self._renderer)
            self.panel.append(self._several.panel)
        self._one.panel.visible = not several
        if self._several is not None:
            self._several.panel.visible = several
        self.pictures.request()
