"""Which part of the page is seen: one tracker, several compared, or the help; each is made when it is first asked for."""

from __future__ import annotations

from collections.abc import Awaitable, Callable
from typing import Any

import panel_material_ui as pmu

from app.state import MODES, State
from app.views.comparison import Comparison
from app.views.detail import Detail
from app.views.help import Help
from app.views.parts import Parts
from app.views.scroll import Scroll
from app.views.three_d import ThreeD
from spf.render import Renderer

__all__ = ["Modes"]


_CALLED = {"compare": "the comparison", "help": "the help"}
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
        self._state = state
        self.detail = Detail(state, renderer)
        self._parts = Parts[Detail | Comparison | Help]("one", self.detail, _CALLED, self._arrived)
        self._parts.offer("compare", lambda: Comparison(state, renderer))
        self._parts.offer("help", lambda: Help(state, renderer))
        self.scroll = Scroll(place=state.mode, width=0, height=0, margin=0)
        self.panel = self._parts.panel
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
            if event.new != self._state.mode:
                await show(event.new)

        group.param.watch(picked, "value")
        self._state.param.watch(lambda event: setattr(group, "value", event.new), "mode")
        return group

    @property
    def pictures(self) -> ThreeD:
        """The pictures that are seen; those of one tracker while others are laid out."""
        return (self._parts.get(self._state.mode) or self.detail).pictures

    async def drawn(self) -> None:
        """Wait until the browser shows the latest frame."""
        await self.pictures.drawn()

    def _follow(self, event: Any) -> None:
        self.scroll.place = event.new  # first, while the part that is left is still in its place
        self._parts.show(event.new)

    def _arrived(self) -> None:
        self.pictures.request()
