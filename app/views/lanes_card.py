"""The trackers that are compared: choose the one whose settings are edited, add one, remove one."""

from __future__ import annotations

from collections.abc import Awaitable, Callable
from typing import Any

import panel_material_ui as pmu

from app.controller import Controller
from app.lane import Lane
from app.state import COLOURS, State

__all__ = ["LanesCard"]


class LanesCard:
    """A row for each lane; there are as many as there are colours, and those of no lane are not seen."""

    def __init__(self, state: State, controller: Controller) -> None:
        self._state, self._controller = state, controller
        self._rows = {colour: _Row(colour, self._act(controller.choose), self._remove) for colour in COLOURS}
        self._add = pmu.Button(
            label="Add a tracker", icon="add", variant="text", size="small", margin=(0, 6), on_click=self._on_add
        )
        hint = pmu.Typography(
            "All begin with one start and one seed. The settings below are those of the tracker chosen here.",
            variant="caption", margin=(0, 10), sx={"opacity": 0.8, "lineHeight": 1.3},
        )  # fmt: skip
        state.param.watch(self._follow, ["mode", "lanes", "lane", "rules"])
        self.panel = pmu.Column(
            *(row.panel for row in self._rows.values()), self._add, hint, sizing_mode="stretch_width", margin=0
        )
        self._follow()

    def _act(self, action: Callable[[Lane], Awaitable[None]]) -> Callable[[str], Awaitable[None]]:
        async def act(colour: str) -> None:
            for lane in self._state.lanes:
                if lane.colour == colour:
                    await action(lane)

        return act

    async def _remove(self, colour: str) -> None:
        await self._act(self._controller.remove_lane)(colour)

    async def _on_add(self, _event: Any) -> None:
        await self._controller.add_lane()

    def _follow(self, *_events: Any) -> None:
        state = self._state
        lanes = {lane.colour: lane for lane in state.lanes}
        for colour, row in self._rows.items():
            row.follow(lanes.get(colour), chosen=lanes.get(colour) is state.lane, removable=len(lanes) > 2)
        self._add.disabled = len(lanes) == len(COLOURS)
        self.panel.visible = state.mode == "compare"


class _Row:
    """One lane's buttons."""

    def __init__(
        self, colour: str, choose: Callable[[str], Awaitable[None]], remove: Callable[[str], Awaitable[None]]
    ) -> None:
        async def on_choose(_event: Any) -> None:
            await choose(colour)

        async def on_remove(_event: Any) -> None:
            await remove(colour)

        self._colour = colour
        self._choose = pmu.Button(
            label="", size="small", sizing_mode="stretch_width", margin=(2, 2, 2, 10), on_click=on_choose,
            css_classes=["lane-button"],
        )  # fmt: skip
        self._remove = pmu.IconButton(
            icon="close", size="small", margin=(2, 6, 2, 0), on_click=on_remove, css_classes=["lane-remove"],
            description="Compare without this tracker",
        )  # fmt: skip
        self.panel = pmu.Row(self._choose, self._remove, sizing_mode="stretch_width", margin=0)

    def follow(self, lane: Lane | None, *, chosen: bool, removable: bool) -> None:
        """Show a lane, or nothing."""
        self.panel.visible = lane is not None
        self._remove.disabled = not removable
        if lane is None:
            return
        self._choose.param.update(
            label=lane.title,
            sx={
                "justifyContent": "flex-start", "textAlign": "left", "lineHeight": 1.25, "color": "#20262c !important",
                "borderLeft": f"6px solid {self._colour}", "backgroundColor": "#dde6ef" if chosen else "#f4f6f8",
                "fontWeight": 600 if chosen else 400, "&:hover": {"backgroundColor": "#e6edf4"},
            },
        )  # fmt: skip
