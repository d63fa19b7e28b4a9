"""Joint error over the frames, where there is truth; frames in which the hand was lost are marked."""

from __future__ import annotations

import numpy as np
from bokeh.models import ColumnDataSource, HoverTool

from app.state import State
from app.views.plots import CALM, LOSS, FramePlot, calm_figure, heading

__all__ = ["JointErrors"]

_TITLE = "Mean joint error"
_LOST = ("▮", LOSS, "hand lost")


class JointErrors(FramePlot):
    """The pane."""

    def __init__(self, state: State) -> None:
        self.source = ColumnDataSource({"frame": [], "error": []})
        self.lost = ColumnDataSource({"frame": [], "height": []})
        plot = calm_figure("frame", "error, mm", x_range=(-1, 120), y_range=(0, 20))
        plot.vbar("frame", top="height", width=1, source=self.lost, color=LOSS, alpha=0.35, line_color=None)
        line = plot.line("frame", "error", source=self.source, color=CALM, line_width=1.5)
        plot.scatter("frame", "error", source=self.source, color=CALM, size=3)
        hover = plot.select_one(HoverTool)
        hover.renderers, hover.mode = [line], "vline"
        hover.tooltips = [("frame", "@frame"), ("error", "@error{0.0} mm")]
        super().__init__(state, plot, heading(_TITLE, _LOST))

    def draw_frames(self) -> None:
        """Show the frames tracked so far."""
        session, summaries = self.state.session, self.state.results.summaries
        no_truth = session is not None and not session.has_truth
        self.heading.object = heading(f"{_TITLE}: no truth in this session" if no_truth else _TITLE, _LOST)
        errors = 1000 * np.array([s.error for s in summaries])
        self.source.data = {"frame": np.array([s.frame for s in summaries]), "error": errors}
        known = errors[np.isfinite(errors)]
        top = max(20.0, 1.15 * float(known.max())) if len(known) else 20.0
        self.figure.y_range.update(start=0, end=top)
        lost = [s.frame for s in summaries if s.lost]
        self.lost.data = {"frame": lost, "height": [top] * len(lost)}
