"""One tracker with all its particles: the pictures; the depth image and this frame's particles; curves over the frames."""

from __future__ import annotations

from typing import Any

import panel_material_ui as pmu

from app.state import State
from app.views.costs import Costs
from app.views.curves import ERROR, ESS, Curves
from app.views.depth import Depth
from app.views.fit import Fit
from app.views.grid import card, cards
from app.views.plots import BEFORE, heading
from app.views.scenes import PICTURES, SCENES
from app.views.three_d import ThreeD
from app.views.weights import Weights
from spf.render import Renderer

__all__ = ["Detail", "truth_switch"]

_PICTURE_HEIGHT, _PLOT_HEIGHT = 268, 196


class Detail:
    """The part of the page that is seen in the mode of one tracker."""

    def __init__(self, state: State, renderer: Renderer) -> None:
        self.pictures = ThreeD(
            state, renderer, "one", PICTURES, lambda: dict.fromkeys(PICTURES, state.lane),
            lambda name, entry: SCENES[name](entry),
        )  # fmt: skip
        depth = Depth(state)
        keys = ("●", "white", "estimate"), ("●", BEFORE, "truth")
        now: list[Any] = [Costs(state), Weights(state)]
        over: list[Any] = [Curves(state, ERROR), Curves(state, ESS), Fit(state)]
        self.panel = cards(
            *(card(self.pictures.panes[name], heading(title), _PICTURE_HEIGHT) for name, title in PICTURES.items()),
            card(depth.pane, heading("Depth", *keys), _PICTURE_HEIGHT, truth_switch(state)),
            *(card(plot.pane, plot.heading, _PICTURE_HEIGHT) for plot in now),
            *(card(plot.pane, plot.heading, _PLOT_HEIGHT) for plot in over),
        )


def truth_switch(state: State) -> pmu.Switch:
    """Return the switch that shows or hides the truth in the depth image."""
    return pmu.Switch.from_param(
        state.param.with_truth, label="Truth", description="", size="small", margin=(0, 4), align="center"
    )
