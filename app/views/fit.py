"""How well the render of the estimate explains the depth, over the frames: golden energy and overlap of silhouettes."""

from __future__ import annotations

from bokeh.models import ColumnDataSource, HoverTool

from app.state import State
from app.views.plots import AFTER, CALM, FramePlot, calm_figure, small_legend

__all__ = ["Fit"]


class Fit(FramePlot):
    """The pane."""

    def __init__(self, state: State) -> None:
        self.source = ColumnDataSource({"frame": [], "golden": [], "overlap": []})
        plot = calm_figure("Render against depth", "frame", "share, 0 to 1", x_range=(-1, 120), y_range=(0, 1.3))
        lines = [
            plot.line("frame", name, source=self.source, color=colour, line_width=2, line_dash=dash, legend_label=label)
            for name, colour, dash, label in (
                ("overlap", AFTER, "solid", "overlap of silhouettes"),
                ("golden", CALM, "4 2", "golden energy (0 explains all)"),
            )
        ]
        hover = plot.select_one(HoverTool)
        hover.renderers, hover.mode = lines[:1], "vline"
        hover.tooltips = [("frame", "@frame"), ("overlap", "@overlap{0.00}"), ("golden", "@golden{0.00}")]
        small_legend(plot)
        super().__init__(state, plot)

    def draw_frames(self) -> None:
        """Show the frames tracked so far."""
        summaries = self.state.results.summaries
        self.source.data = {
            "frame": [s.index for s in summaries],
            "golden": [s.golden for s in summaries],
            "overlap": [s.overlap for s in summaries],
        }
