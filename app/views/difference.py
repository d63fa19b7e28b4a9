"""How far the hands of the other lanes are from that of the first, over the frames that both have tracked."""

from __future__ import annotations

import numpy as np
from bokeh.models import ColumnDataSource, HoverTool

from app.state import COLOURS, State
from app.views.plots import FramePlot, calm_figure, heading

__all__ = ["Difference"]

_LEAST = 5.0  # mm that the axis shows


class Difference(FramePlot):
    """The pane."""

    def __init__(self, state: State) -> None:
        plot = calm_figure("frame", "apart, mm", x_range=(-1, 120), y_range=(0, _LEAST))
        self.lines = {colour: ColumnDataSource({"frame": [], "apart": []}) for colour in COLOURS}
        drawn = [
            plot.line("frame", "apart", source=source, color=colour, line_width=1.5)
            for colour, source in self.lines.items()
        ]
        hover = plot.select_one(HoverTool)
        hover.renderers, hover.mode = drawn, "vline"
        hover.tooltips = [("frame", "@frame"), ("joints apart", "@apart{0.0} mm")]
        also = ("lanes", "lane", "rules", "mode")
        super().__init__(state, plot, heading("Joints apart from the first tracker's"), "compare", also=also)

    def draw_frames(self) -> None:
        """Show the frames that the lanes have tracked so far."""
        lanes = self.state.lanes
        first = {summary.frame: summary.joints for summary in lanes[0].results.summaries}
        shown: dict[str, dict[str, list[float]]] = {}
        for lane in lanes[1:]:
            both = [summary for summary in lane.results.summaries if summary.frame in first]
            apart = [
                1000 * float(np.linalg.norm(summary.joints - first[summary.frame], axis=1).mean()) for summary in both
            ]
            shown[lane.colour] = {"frame": [float(summary.frame) for summary in both], "apart": apart}
        for colour, source in self.lines.items():
            source.data = shown.get(colour, {"frame": [], "apart": []})
        values = [value for data in shown.values() for value in data["apart"]]
        self.figure.y_range.update(start=0, end=max(_LEAST, 1.15 * max(values, default=0.0)))
