"""Which proposal the heaviest particle came from, in every frame, and how often each one wins."""

from __future__ import annotations

from collections import Counter

from bokeh.models import ColumnDataSource, FactorRange, HoverTool

from app.state import State
from app.views.plots import FramePlot, calm_figure, heading

__all__ = ["Winners"]

#: Proposal → colour, after Okabe and Ito; in the order of the rows.
_COLOURS = {
    "dynamics": "#0072b2", "structured": "#d55e00", "learned": "#009e73", "recombined": "#cc79a7", "estimate": "#44505c",
    "beliefs": "#56b4e9",
}  # fmt: skip


class Winners(FramePlot):
    """The pane."""

    tab = "particles"

    def __init__(self, state: State) -> None:
        self.source = ColumnDataSource({"frame": [], "winner": [], "colour": []})
        self.rows = FactorRange()
        plot = calm_figure("frame", "", x_range=(-1, 120), y_range=self.rows)
        plot.yaxis.axis_label = None
        marks = plot.scatter("frame", "winner", source=self.source, color="colour", marker="square", size=6)
        hover = plot.select_one(HoverTool)
        hover.renderers, hover.tooltips = [marks], [("frame", "@frame"), ("heaviest", "@winner")]
        super().__init__(state, plot, heading("Proposal of the heaviest particle"))

    def draw_frames(self) -> None:
        """Show the frames tracked so far."""
        won = [(s.frame, s.winner) for s in self.state.lane.results.summaries if s.winner]
        counts = Counter(winner for _, winner in won)
        order = [name for name in _COLOURS if name in counts] + sorted(set(counts) - set(_COLOURS))
        labels = {name: f"{name} {100 * counts[name] / len(won):.0f} %" for name in order}
        self.source.data = {"frame": [], "winner": [], "colour": []}  # no row may be missing from the axis meanwhile
        self.rows.factors = [labels[name] for name in reversed(order)]
        self.source.data = {
            "frame": [frame for frame, _ in won],
            "winner": [labels[winner] for _, winner in won],
            "colour": [_COLOURS.get(winner, "#44505c") for _, winner in won],
        }
