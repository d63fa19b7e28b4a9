"""The cost of every particle over the iterations of its optimisation."""

from __future__ import annotations

import math

import numpy as np
from bokeh.models import ColumnDataSource, HoverTool

from app.state import State
from app.views.plots import AFTER, CALM, Plot, calm_figure, heading

__all__ = ["Descents"]


class Descents(Plot):
    """The pane."""

    tab = "particles"

    def __init__(self, state: State) -> None:
        self.source = ColumnDataSource({"xs": [], "ys": [], "particle": [], "origin": [], "width": [], "colour": []})
        plot = calm_figure(
            "iteration", "E on its points", y_axis_type="log", x_range=(0, 80), y_range=(1, 100)
        )  # fmt: skip
        lines = plot.multi_line(
            "xs", "ys", source=self.source, line_color="colour", line_width="width", line_alpha=0.85
        )
        hover = plot.select_one(HoverTool)
        hover.renderers = [lines]
        hover.tooltips = [("particle", "@particle (@origin)"), ("iteration", "$x{0}"), ("E", "$y{0.0}")]
        super().__init__(state, plot, "", look=("selected",))

    def draw(self) -> None:
        """Show the frame shown."""
        info = self.state.entry.result.info if self.state.entry is not None else None
        traces = () if info is None else info.trajectories
        picked = self.state.look.picked(len(traces))
        strong = picked or list(range(len(traces)))
        costs = [np.where(trace.costs > 0, trace.costs, math.nan) for trace in traces]
        self.source.data = {
            "xs": [np.arange(len(path)) for path in costs],
            "ys": costs,
            "particle": np.arange(1, len(traces) + 1),
            "origin": [] if info is None else list(info.origins[: len(traces)]),
            "width": [2.5 if index in picked else 1.2 for index in range(len(traces))],
            "colour": [AFTER if index in strong else "#b6bec6" for index in range(len(traces))],
        }
        known = np.concatenate([np.empty(0), *costs])
        known = known[np.isfinite(known)]
        if len(known):
            self.figure.x_range.update(start=0, end=max(len(path) for path in costs) - 1)
            self.figure.y_range.update(start=0.9 * float(known.min()), end=1.1 * float(known.max()))
        words = "the points are drawn anew in each iteration" if traces else "nothing is optimised here"
        self.heading.object = heading("Cost during optimisation", ("", CALM, words))
