"""One tracker with all its particles: the pictures; the depth image and this frame's particles; curves over the frames."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Protocol

import panel as pn
import panel_material_ui as pmu

from app.look import TABS
from app.state import State
from app.views.costs import Costs
from app.views.curves import ERROR, ESS, Curves
from app.views.depth import SHARE, Depth
from app.views.fit import Fit
from app.views.grid import card, cards
from app.views.parts import Parts
from app.views.plots import BEFORE, heading
from app.views.scene_tab import SceneTab
from app.views.scenes import PICTURES, SCENES
from app.views.thinking import Thinking
from app.views.three_d import ThreeD
from app.views.viewpoints import viewpoints
from app.views.weights import Weights
from spf.render import Renderer

__all__ = ["Detail", "Overview", "truth_switch"]

_PICTURE_HEIGHT, _PLOT_HEIGHT = 268, 196


class Tab(Protocol):
    """A part of the page of one tracker; one without 3-D pictures has None."""

    panel: Any

    @property
    def pictures(self) -> ThreeD | None:
        """The 3-D pictures."""


class Detail:
    """The part of the page that is seen in the mode of one tracker: tabs, each made when it is first asked for."""

    def __init__(self, state: State, renderer: Renderer) -> None:
        self._state = state
        self._overview = Overview(state, renderer)
        called = {name: f"“{words}”" for words, name in TABS.items()}
        self._tabs = Parts[Tab]("overview", self._overview, called, self._arrived)
        self._tabs.offer("particles", lambda: Thinking(state, renderer))
        self._tabs.offer("scene", lambda: SceneTab(state, renderer))
        switch = pmu.RadioButtonGroup.from_param(
            state.look.param.tab, name="", options=TABS, size="small", margin=(0, 8),
            stylesheets=[":host { max-width: calc(100% - 16px); }"],
            sx={
                "flexWrap": "wrap",
                "& .MuiToggleButton-root": {
                    "textTransform": "none", "padding": "3px 14px", "whiteSpace": "nowrap", "width": "auto",
                },
            },
        )  # fmt: skip
        self._views = viewpoints(state)
        head = pn.FlexBox(
            switch, self._views, justify_content="space-between", align_items="center", sizing_mode="stretch_width",
            margin=(0, 8, 4, 0),
        )  # fmt: skip
        self.panel = pn.Column(head, self._tabs.panel, sizing_mode="stretch_width", margin=0)
        state.look.param.watch(lambda event: self._tabs.show(event.new), "tab")

    @property
    def pictures(self) -> ThreeD:
        """The pictures of the tab that is seen; the first tab's where it has none, or none yet."""
        return self._seen.pictures or self._overview.pictures

    @property
    def _seen(self) -> Tab:
        return self._tabs.get(self._state.look.tab) or self._overview

    def offer(self, tab: str, make: Callable[[], Tab]) -> None:
        """Say how a tab is made when it is first asked for."""
        self._tabs.offer(tab, make)

    def _arrived(self) -> None:
        self._views.visible = self._seen.pictures is not None
        self.pictures.request()


class Overview:
    """The tab that is seen first."""

    def __init__(self, state: State, renderer: Renderer) -> None:
        self.pictures = ThreeD(
            state, renderer, "one", PICTURES, lambda: dict.fromkeys(PICTURES, state.lane),
            lambda name, entry, shown: SCENES[name](entry, shown.selected),
        )  # fmt: skip
        depth = Depth(state, self.pictures)
        keys = ("●", "white", "estimate"), ("●", BEFORE, "truth")
        now: list[Any] = [Costs(state), Weights(state)]
        over: list[Any] = [Curves(state, ERROR), Curves(state, ESS), Fit(state)]
        self.panel = cards(
            *(card(self.pictures.panes[name], heading(title), _PICTURE_HEIGHT) for name, title in PICTURES.items()),
            card(depth.pane, heading("Depth", *keys), _PICTURE_HEIGHT, _spread_switch(state), truth_switch(state)),
            *(card(plot.pane, plot.heading, _PICTURE_HEIGHT) for plot in now),
            *(card(plot.pane, plot.heading, _PLOT_HEIGHT) for plot in over),
        )


def _spread_switch(state: State) -> pmu.Switch:
    """Return the switch that shows or hides how far off each joint may be."""
    return pmu.Switch.from_param(
        state.param.with_spread, label=f"± {100 * SHARE:.0f} %", size="small", margin=(0, 4), align="center",
        description="Around each joint of the estimate of the Smart Particle Filter: nine in ten are within.",
    )  # fmt: skip


def truth_switch(state: State) -> pmu.Switch:
    """Return the switch that shows or hides the truth in the depth image."""
    return pmu.Switch.from_param(
        state.param.with_truth, label="Truth", description="", size="small", margin=(0, 4), align="center"
    )
