"""How a run begins: the first pose, the hand's shape, the seed, and the button."""

from __future__ import annotations

from collections.abc import Awaitable, Callable
from typing import Any

import panel_material_ui as pmu

from app.state import INITS, State, shapes_of

__all__ = ["StartCard"]


class StartCard:
    """The card."""

    def __init__(self, state: State, start: Callable[[], Awaitable[None]]) -> None:
        self._state, self._start = state, start
        self._init = pmu.Select.from_param(
            state.param.init, label="First pose", options=INITS, size="small", sizing_mode="stretch_width"
        )
        pose_file = pmu.TextInput.from_param(
            state.param.pose_file,
            label="Path of the pose file",
            size="small",
            visible=False,
            sizing_mode="stretch_width",
        )
        self._shape = pmu.Select.from_param(
            state.param.shape, label="Hand", options=shapes_of(state.init), size="small", sizing_mode="stretch_width"
        )
        hand_file = pmu.TextInput.from_param(
            state.param.hand_file,
            label="Path of the hand file",
            size="small",
            visible=False,
            sizing_mode="stretch_width",
        )
        seed = pmu.IntInput.from_param(
            state.param.seed, label="Seed", size="small", start=0, width=110,
            description="Of all randomness: the same seed and settings give the same track.",
        )  # fmt: skip
        self._button = pmu.Button(
            label="Start", icon="play_circle", sizing_mode="stretch_width", on_click=self._on_start, margin=(10, 10)
        )
        state.param.watch(lambda event: setattr(pose_file, "visible", event.new == "file"), "init")
        state.param.watch(self._name_shapes, "init")
        state.param.watch(lambda event: setattr(hand_file, "visible", event.new == "file"), "shape")
        state.param.watch(self._follow, ["session", "task", "playing"])
        self._follow()
        self.panel = pmu.Column(
            self._init, pose_file, self._shape, hand_file, pmu.Row(seed, self._button, sizing_mode="stretch_width"),
            sizing_mode="stretch_width",
        )  # fmt: skip

    @property
    def hands(self) -> list[str]:
        """The ways to the hand's shape that are offered, in words."""
        return list(self._shape.options)

    def _name_shapes(self, _event: Any) -> None:
        self._shape.options = shapes_of(self._state.init)
        self._shape.param.trigger("value")  # the browser shows the words of the old options otherwise

    async def _on_start(self, _event: Any) -> None:
        await self._start()

    def _follow(self, *_events: Any) -> None:
        session = self._state.session
        self._button.disabled = session is None or self._state.busy
        self._init.disabled_options = ["truth"] if session is not None and not session.has_truth else []
