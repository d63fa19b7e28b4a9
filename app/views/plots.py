"""What all plots have in common: a small calm figure whose data are replaced in place, seldom while playing."""

from __future__ import annotations

from abc import abstractmethod
from typing import Any

import panel as pn
from bokeh.models import CategoricalTicker, Span
from bokeh.plotting import figure

from app.state import State
from app.views.follower import Follower
from spf.render.palette import OPTIMISED, PREDICTED, RESIDUAL

__all__ = ["AFTER", "BEFORE", "CALM", "LOSS", "FramePlot", "Plot", "calm_figure", "css", "heading"]

_LEAST_FRAMES, _ROOM = 30, 1.25  # that the axis of frames shows at least, and of what is tracked


def css(colour: tuple[float, float, float]) -> str:
    """Return a colour of the renders as the browser writes it."""
    return "#" + "".join(f"{round(255 * part):02x}" for part in colour)


_INK = "var(--panel-on-background-color, #2a3038)"  # the page's own, whether it is light or dark

#: Before and after optimisation, as in the renders; a calm third one; loss.
BEFORE, AFTER, CALM, LOSS = css(PREDICTED), css(OPTIMISED), "#76828e", css(RESIDUAL)


def calm_figure(x_label: str, y_label: str, **options: Any) -> figure:
    """Return an empty figure in the page's style."""
    plot = figure(
        x_axis_label=x_label, y_axis_label=y_label, sizing_mode="stretch_both", min_height=110,
        tools="hover", toolbar_location=None, min_border_left=58, min_border_right=14, min_border_top=6,
        outline_line_color=None, **options,
    )  # fmt: skip
    for axis in plot.axis:
        axis.axis_label_text_font_style, axis.axis_label_text_font_size = "normal", "11px"
        axis.major_label_text_font_size, axis.axis_label_standoff = "10px", 4
        axis.axis_line_color, axis.minor_tick_line_color, axis.major_tick_line_color = "#9aa4ae", None, "#9aa4ae"
    plot.grid.grid_line_color = "#e6eaee"
    if not isinstance(plot.yaxis[0].ticker, CategoricalTicker):
        plot.yaxis.ticker.desired_num_ticks = 4
    return plot


def heading(title: str, *keys: tuple[str, str, str]) -> str:
    """Return HTML that stands above a plot: its title and (sign, colour, meaning) of what is drawn in it."""
    legend = "".join(
        f" &nbsp;<span style='color:{colour};-webkit-text-stroke:0.4px #2a3038'>{sign}</span> {meaning}"
        for sign, colour, meaning in keys
    )
    return (
        f"<div style='font:500 13px/24px Roboto,sans-serif;color:{_INK};white-space:nowrap'>"
        f"{title}<span style='font-weight:400;font-size:12px;opacity:0.85'>{legend}</span></div>"
    )


class Plot(Follower):
    """A pane that follows the state, under a heading."""

    def __init__(
        self, state: State, plot: figure, title: str, mode: str = "one", also: tuple[str, ...] = (),
        look: tuple[str, ...] = (),
    ) -> None:  # fmt: skip
        super().__init__(state, mode, also, look)
        self.figure = plot
        self.heading = pn.pane.HTML(title, margin=(2, 4), sizing_mode="stretch_width")
        self.pane = pn.pane.Bokeh(plot, sizing_mode="stretch_both", margin=0)


class FramePlot(Plot):
    """A plot over the frames of the session, with a line at the one shown."""

    every = 3.0  # it changes little from frame to frame, and the time line says where we are

    def __init__(self, state: State, plot: figure, title: str, mode: str = "one", also: tuple[str, ...] = ()) -> None:
        super().__init__(state, plot, title, mode, also)
        self._here = Span(location=0, dimension="height", line_color="#9aa4ae", line_width=1)
        plot.add_layout(self._here)

    def draw(self) -> None:
        """Replace the data and move the line."""
        state = self.state
        self._here.location = state.frame
        if state.session is not None:
            furthest = max([state.frame, *(lane.results.last or 0 for lane in state.active)])
            end = min(len(state.session), max(_LEAST_FRAMES, _ROOM * furthest))
            self.figure.x_range.update(start=-0.02 * end, end=end)
        self.draw_frames()

    @abstractmethod
    def draw_frames(self) -> None:
        """Replace the data by the frames tracked so far."""
