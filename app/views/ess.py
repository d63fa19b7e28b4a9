"""Effective sample size over the frames."""

from __future__ import annotations

from bokeh.models import ColumnDataSource, HoverTool

from app.state import State
from app.views.plots import CALM, FramePlot, calm_figure, heading

__all__ = ["EffectiveSamples"]


class EffectiveSamples(FramePlot):
    """The pane."""

    def __init__(self, state: State) -> None:
        self.source = ColumnDataSource({"frame": [], "ess": []})
        plot = calm_figure("frame", "ESS, samples", x_range=(-1, 120), y_range=(0, 8))
        line = plot.line("frame", "ess", source=self.source, color=CALM, line_width=1.5)
        plot.scatter("frame", "ess", source=self.source, color=CALM, size=3)
        hover = plot.select_one(HoverTool)
        hover.renderers, hover.mode = [line], "vline"
        hover.tooltips = [("frame", "@frame"), ("ESS", "@ess{0.0}")]
        super().__init__(state, plot, heading("Effective sample size"))

    def draw_frames(self) -> None:
        """Show the frames tracked so far; the axis ends at the number of samples, 2N."""
        summaries = self.state.results.summaries
        self.source.data = {"frame": [s.frame for s in summaries], "ess": [s.ess for s in summaries]}
        self.figure.y_range.end = 2.0 * getattr(self.state.settings, "n", 1) + 0.5
