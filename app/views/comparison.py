"""Several trackers at the same frame: their hands beside each other, one depth image, shared curves and a table."""

from __future__ import annotations

import html
from typing import Any

import panel as pn

from app.lane import Lane
from app.look import Shown
from app.results import Entry
from app.state import COLOURS, State
from app.views.curves import ERROR, ESS, GOLDEN, MILLISECONDS, OVERLAP, Curves
from app.views.depth import Depth
from app.views.detail import truth_switch
from app.views.difference import Difference
from app.views.grid import card, cards
from app.views.plots import BEFORE, heading
from app.views.scenes import reconstruction_of
from app.views.table import Table
from app.views.three_d import ThreeD
from spf.render import Colour, Renderer, Scene

__all__ = ["Comparison"]

_HAND_HEIGHT, _DEPTH_HEIGHT, _PLOT_HEIGHT = 256, 304, 196
_PALE = 0.35  # share of white in a hand of a lane's colour, so that its shading is seen


class Comparison:
    """The part of the page that is seen in the mode of comparison."""

    def __init__(self, state: State, renderer: Renderer) -> None:
        self._state = state
        self.pictures = ThreeD(
            state,
            renderer,
            "compare",
            {colour: f"Hand {i}" for i, colour in enumerate(COLOURS, 1)},
            self._lanes,
            _scene,
        )
        self._heads = {colour: pn.pane.HTML("", margin=(2, 4), sizing_mode="stretch_width") for colour in COLOURS}
        self._hands = {
            colour: card(self.pictures.panes[colour], self._heads[colour], _HAND_HEIGHT, least_width=220)
            for colour in COLOURS
        }
        depth, table, difference = Depth(state, self.pictures, "compare"), Table(state), Difference(state)
        error, *others = [Curves(state, q, "compare") for q in (ERROR, GOLDEN, OVERLAP, ESS, MILLISECONDS)]
        middle = (
            card(depth.pane, heading("Depth", ("●", BEFORE, "truth")), _DEPTH_HEIGHT, truth_switch(state)),
            card(error.pane, error.heading, _DEPTH_HEIGHT),
            card(table.pane, heading("So far"), _DEPTH_HEIGHT, least_width=340),
        )
        curves = (card(plot.pane, plot.heading, _PLOT_HEIGHT, least_width=220) for plot in (difference, *others))
        self.panel = pn.Column(
            cards(*self._hands.values()), cards(*middle), cards(*curves), sizing_mode="stretch_width", margin=0
        )
        state.param.watch(self._follow, ["lanes", "rules", "revision"])
        self._follow()
        for drawn in (depth.draw, table.draw, error.draw, difference.draw, *(plot.draw for plot in others)):
            drawn()

    def _lanes(self) -> dict[str, Lane]:
        return {lane.colour: lane for lane in self._state.lanes}

    def _follow(self, *_events: Any) -> None:
        lanes = self._lanes()
        for colour, hand in self._hands.items():
            hand.visible = colour in lanes
            if colour in lanes:
                self._heads[colour].object = _heading(lanes[colour], self._state.frame)


def _heading(lane: Lane, frame: int) -> str:
    loss = f" <span style='color:#b33c00'>{lane.loss(frame)}</span>" if lane.loss(frame) else ""
    return heading(f"<span style='color:{lane.colour}'>■</span> {html.escape(lane.title)}{loss}")


def _scene(colour: str, entry: Entry, _shown: Shown) -> Scene | None:
    return reconstruction_of(entry, _pale(colour))


def _pale(css: str) -> Colour:
    """A colour ``#rrggbb`` between 0 and 1, lightened."""
    red, green, blue = (int(css[at : at + 2], 16) / 255 for at in (1, 3, 5))
    return (red + _PALE * (1 - red), green + _PALE * (1 - green), blue + _PALE * (1 - blue))
