"""How the hand's shape was refined, over the frames: by how much its parts differ from the start's."""

from __future__ import annotations

import numpy as np
from bokeh.models import ColumnDataSource, HoverTool

from app.state import State
from app.views.plots import FramePlot, calm_figure, heading
from spf.hand.shape import UNCHANGED, percent_of

__all__ = ["ShapeOverFrames"]

#: Colours after Okabe and Ito, and dashes, of the parts of the hand in their order.
_LINES = (
    ("#44505c", "solid", "━"), ("#d55e00", "6 3", "┅"), ("#0072b2", "6 3", "┅"), ("#009e73", "2 2", "┉"), ("#cc79a7", "2 2", "┉"),
)  # fmt: skip
_LEAST = 2.0  # per cent, that the axis holds


class ShapeOverFrames(FramePlot):
    """The pane."""

    tab = "particles"

    def __init__(self, state: State) -> None:
        self.parts = tuple(percent_of(UNCHANGED))
        self.source = ColumnDataSource({name: [] for name in ("frame", *self.parts)})
        plot = calm_figure("frame", "change, %", x_range=(-1, 120), y_range=(-_LEAST, _LEAST))
        lines = [
            plot.line("frame", part, source=self.source, color=colour, line_width=2, line_dash=dash)
            for part, (colour, dash, _) in zip(self.parts, _LINES, strict=True)
        ]
        hover = plot.select_one(HoverTool)
        hover.renderers, hover.mode = lines[:1], "vline"
        hover.tooltips = [("frame", "@frame"), *((part, f"@{{{part}}}{{+0.0}} %") for part in self.parts)]
        keys = [(sign, colour, part) for part, (colour, _, sign) in zip(self.parts, _LINES, strict=True)]
        super().__init__(state, plot, heading("The hand's shape since the start", *keys))

    def draw_frames(self) -> None:
        """Show the frames tracked so far."""
        summaries = self.state.lane.results.summaries
        changes = percent_of(np.array([s.shape_change for s in summaries]))
        self.source.data = {"frame": [s.frame for s in summaries], **changes}
        farthest = max((float(np.abs(values).max(initial=0.0)) for values in changes.values()), default=0.0)
        reach = max(_LEAST, 1.15 * farthest)
        self.figure.y_range.update(start=-reach, end=reach)
