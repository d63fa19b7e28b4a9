"""Weight of each sample, predicted and optimised, with the correction factor that keeps the density right (32)."""

from __future__ import annotations

import math

import numpy as np
from bokeh.models import ColumnDataSource, HoverTool, LinearAxis, Range1d

from app.state import State
from app.views.plots import AFTER, BEFORE, CALM, Plot, calm_figure, heading

__all__ = ["Weights"]

_COLUMNS = ("particle", "left", "right", "predicted", "optimised", "correction_left", "correction_right")


class Weights(Plot):
    """The pane."""

    def __init__(self, state: State) -> None:
        self.source = ColumnDataSource({name: [] for name in _COLUMNS})
        plot = calm_figure("particle", "weight, %", y_range=(0, 100), x_range=(0.4, 4.6))
        bars = [
            plot.vbar(x, top=name, width=0.36, source=self.source, color=colour)
            for x, name, colour in (("left", "predicted", BEFORE), ("right", "optimised", AFTER))
        ]
        plot.extra_y_ranges = {"correction": Range1d(-1, 1)}
        axis = LinearAxis(y_range_name="correction", axis_label="log₁₀ c")
        axis.axis_label_text_font_style, axis.axis_label_text_font_size = "normal", "11px"
        axis.major_label_text_font_size, axis.minor_tick_line_color, axis.axis_line_color = "10px", None, "#9aa4ae"
        axis.ticker.desired_num_ticks = 4
        plot.add_layout(axis, "right")
        for x, name in (("left", "correction_left"), ("right", "correction_right")):
            plot.scatter(
                x, name, source=self.source, y_range_name="correction", marker="diamond", size=9, color=CALM,
                line_color="white",
            )  # fmt: skip
        hover = plot.select_one(HoverTool)
        hover.renderers = bars
        hover.tooltips = [
            ("particle", "@particle"), ("predicted", "@predicted{0.0} %"), ("optimised", "@optimised{0.0} %"),
            ("log₁₀ c", "@correction_left{0.0}, @correction_right{0.0}"),
        ]  # fmt: skip
        plot.xaxis.ticker.min_interval = 1
        keys = ("■", BEFORE, "predicted"), ("■", AFTER, "optimised"), ("◆", CALM, "correction c")
        super().__init__(state, plot, heading("Weights", *keys))

    def draw(self) -> None:
        """Show the samples of the frame shown."""
        info = self.state.entry.result.info if self.state.entry is not None else None
        if info is None:
            self.source.data = {name: [] for name in _COLUMNS}
            return
        count = len(info.predicted)
        before, after = 100 * info.predicted_weights, 100 * info.optimised_weights
        left, right = np.split(info.log_correction / math.log(10), [count])
        if not len(after):  # a filter that optimises nothing
            after, right = np.zeros(count), np.full(count, np.nan)
        particle = np.arange(1, count + 1)
        columns = (particle, particle - 0.2, particle + 0.2, before, after, left, right)
        self.source.data = dict(zip(_COLUMNS, columns, strict=True))
        self.figure.y_range.update(start=0, end=1.1 * float(max(before.max(), after.max())))
        self.figure.x_range.update(start=0.4, end=count + 0.6)
        low, high = float(np.nanmin([*left, *right, 0.0])), float(np.nanmax([*left, *right, 0.0]))
        room = max(high - low, 1.0)
        self.figure.extra_y_ranges["correction"].update(start=low - 0.1 * room, end=high + 0.1 * room)
