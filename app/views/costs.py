"""Cost of each particle before and after Stochastic Meta-Descent."""

from __future__ import annotations

import numpy as np
from bokeh.models import ColumnDataSource, HoverTool

from app.state import State
from app.views.plots import AFTER, BEFORE, Plot, calm_figure, heading

__all__ = ["Costs"]


class Costs(Plot):
    """The pane."""

    def __init__(self, state: State) -> None:
        self.source = ColumnDataSource({"particle": [], "before": [], "after": []})
        plot = calm_figure("particle", "cost E", y_range=(0, 1), x_range=(0.4, 4.6))
        plot.segment("particle", "before", "particle", "after", source=self.source, color="#b6bec6", line_width=2)
        before = plot.scatter("particle", "before", source=self.source, color=BEFORE, size=8, marker="square")
        after = plot.scatter("particle", "after", source=self.source, color=AFTER, size=9)
        after.glyph.line_color = before.glyph.line_color = "#2a3038"
        hover = plot.select_one(HoverTool)
        hover.renderers = [before, after]
        hover.tooltips = [("particle", "@particle"), ("before", "@before{0.0}"), ("after", "@after{0.0}")]
        plot.xaxis.ticker.min_interval = 1
        title = heading("Cost of each particle", ("■", BEFORE, "predicted"), ("●", AFTER, "optimised"))
        super().__init__(state, plot, title)

    def draw(self) -> None:
        """Show the particles of the frame shown."""
        info = self.state.entry.result.info if self.state.entry is not None else None
        before = np.empty(0) if info is None else info.cost_before
        after = np.empty(0) if info is None else info.cost_after
        if not len(after):  # a filter that optimises nothing
            after = np.full(len(before), np.nan)
        self.source.data = {"particle": np.arange(1, len(before) + 1), "before": before, "after": after}
        if len(before):
            self.figure.y_range.update(start=0, end=1.1 * float(np.nanmax([*before, *after])))
            self.figure.x_range.update(start=0.4, end=len(before) + 0.6)
