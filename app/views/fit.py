"""How well the render of the estimate explains the depth, over the frames: golden energy and overlap of silhouettes."""

from __future__ import annotations

from bokeh.models import ColumnDataSource, HoverTool

from app.state import State
from app.views.plots import AFTER, CALM, FramePlot, calm_figure, heading

__all__ = ["Fit"]


class Fit(FramePlot):
    """The pane."""

    def __init__(self, state: State) -> None:
        self.source = ColumnDataSource({"frame": [], "golden": [], "overlap": []})
        plot = calm_figure("frame", "share, 0 to 1", x_range=(-1, 120), y_range=(0, 1.05))
        lines = [
            plot.line("frame", name, source=self.source, color=colour, line_width=2, line_dash=dash)
            for name, colour, dash in (
                ("overlap", AFTER, "solid"),
                ("golden", CALM, "4 2"),
            )
        ]
        hover = plot.select_one(HoverTool)
        hover.renderers, hover.mode = lines[:1], "vline"
        hover.tooltips = [("frame", "@frame"), ("overlap", "@overlap{0.00}"), ("golden", "@golden{0.00}")]
        keys = ("━", AFTER, "overlap"), ("┅", CALM, "golden energy")
        super().__init__(state, plot, heading("Render against depth", *keys))

    def draw_frames(self) -> None:
        """Show the frames tracked so far."""
        summaries = self.state.lane.results.summaries
        self.source.data = {
            "frame": [s.frame for s in summaries],
            "golden": [s.golden for s in summaries],
            "overlap": [s.overlap for s in summaries],
        }
