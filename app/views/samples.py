"""Effective sample size and the optimised samples' share of the weight over the frames, with resampling marked."""

from __future__ import annotations

import numpy as np
from bokeh.models import ColumnDataSource, HoverTool, LinearAxis, Range1d

from app.state import State
from app.views.plots import AFTER, FramePlot, calm_figure, heading

__all__ = ["SamplesOverFrames"]

_COLUMNS = ("frame", "ess_now", "share", "resampled", "zero")


class SamplesOverFrames(FramePlot):
    """The pane."""

    tab = "particles"

    def __init__(self, state: State) -> None:
        self.source = ColumnDataSource({name: [] for name in _COLUMNS})
        self.resampled = ColumnDataSource({"frame": [], "zero": []})
        plot = calm_figure("frame", "ESS, samples", x_range=(-1, 120), y_range=(0, 2))
        plot.extra_y_ranges = {"share": Range1d(0, 105)}
        axis = LinearAxis(y_range_name="share", axis_label="share, %")
        axis.ticker.desired_num_ticks, axis.minor_tick_line_color = 4, None
        axis.axis_label_text_font_style, axis.axis_label_text_font_size = "normal", "11px"
        plot.add_layout(axis, "right")
        share = plot.line(
            "frame", "share", source=self.source, y_range_name="share", color=AFTER, line_width=2, line_dash="6 3"
        )
        plot.line("frame", "ess_now", source=self.source, color="#009e73", line_width=2)
        plot.scatter("frame", "ess_now", source=self.source, color="#009e73", size=3)
        plot.scatter(
            "frame", "zero", source=self.resampled, marker="triangle", size=7, color="#cc79a7", y_range_name="share"
        )
        hover = plot.select_one(HoverTool)
        hover.renderers, hover.mode = [share], "vline"
        hover.tooltips = [
            ("frame", "@frame"), ("ESS", "@ess_now{0.0}"), ("optimised", "@share{0.0} %"), ("resampled", "@resampled"),
        ]  # fmt: skip
        keys = ("━", "#009e73", "effective sample size"), ("┅", AFTER, "weight on optimised samples")
        super().__init__(state, plot, heading("Samples", *keys, ("▲", "#cc79a7", "resampled")))

    def draw_frames(self) -> None:
        """Show the frames tracked so far."""
        summaries = self.state.lane.results.summaries
        resampled = [s.frame for s in summaries if s.resampled]
        self.source.data = {
            "frame": [s.frame for s in summaries],
            "ess_now": [s.ess for s in summaries],
            "share": [100 * s.optimised_share for s in summaries],
            "resampled": ["yes" if s.resampled else "no" for s in summaries],
            "zero": [0] * len(summaries),
        }
        self.resampled.data = {"frame": resampled, "zero": [2] * len(resampled)}
        known = [s.ess for s in summaries if np.isfinite(s.ess)]
        self.figure.y_range.update(start=0, end=max(2.0, 1.1 * max(known, default=0.0)))
