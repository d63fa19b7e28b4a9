"""A quantity over the frames, one line for each lane shown; frames in which a lane lost the hand are marked."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from bokeh.models import ColumnDataSource, HoverTool

from app.lane import Lane
from app.results import Summary
from app.state import COLOURS, State
from app.views.plots import CALM, LOSS, FramePlot, calm_figure, heading

__all__ = ["ERROR", "ESS", "GOLDEN", "MILLISECONDS", "OVERLAP", "Curves", "Quantity"]

_STRIP = 0.06  # share of the height that the losses of one of several lanes take
_DASHES = ("solid", "dashed", "dotdash", "dotted")  # so that lines are told apart without colours too


class Quantity(NamedTuple):
    """What is plotted.

    Attributes:
        name, title, label: of its column, of the plot and of the axis.
        value: in a frame.
        top, highest: least and greatest upper end of the axis.
        within: percentage of the values that the axis has to hold.
    """

    name: str
    title: str
    label: str
    value: Callable[[Summary], float]
    top: float
    highest: float = np.inf
    within: float = 100.0


ERROR = Quantity("error", "Mean joint error", "error, mm", lambda summary: 1000 * summary.error, 20.0)
ESS = Quantity("ess", "Effective sample size", "ESS, samples", lambda summary: summary.ess, 2.0)
GOLDEN = Quantity("golden", "Golden energy", "0 explains all", lambda summary: summary.golden, 0.2)
OVERLAP = Quantity("overlap", "Overlap of silhouettes", "IoU", lambda summary: summary.overlap, 1.05, 1.05)
MILLISECONDS = Quantity("ms", "Time of a frame", "ms", lambda summary: 1000 * summary.seconds, 50.0, within=95.0)


class Curves(FramePlot):
    """The pane."""

    def __init__(self, state: State, quantity: Quantity, mode: str = "one") -> None:
        self._quantity, self._alone = quantity, mode == "one"
        plot = calm_figure("frame", quantity.label, x_range=(-1, 120), y_range=(0, quantity.top))
        colours = (CALM,) if self._alone else COLOURS
        self.lines = {colour: ColumnDataSource({"frame": [], quantity.name: []}) for colour in colours}
        self.dots = ColumnDataSource({"frame": [], "value": [], "colour": []})
        self.losses = ColumnDataSource({"frame": [], "low": [], "high": [], "colour": []})
        if quantity is ERROR:
            plot.vbar(
                "frame", bottom="low", top="high", width=1, source=self.losses, color="colour", alpha=0.35, line_color=None
            )  # fmt: skip
        lines = [
            plot.line("frame", quantity.name, source=source, color=colour, line_width=1.5, line_dash=dash)
            for dash, (colour, source) in zip(_DASHES, self.lines.items(), strict=False)
        ]
        plot.scatter("frame", "value", source=self.dots, color="colour", size=3)
        hover = plot.select_one(HoverTool)
        hover.renderers, hover.mode = lines, "vline"
        hover.tooltips = [("frame", "@frame"), (quantity.title, f"@{quantity.name}{{0.00}}")]
        super().__init__(state, plot, heading(quantity.title), mode, also=("lanes", "lane", "rules", "mode"))

    def draw_frames(self) -> None:
        """Show the frames that the lanes have tracked so far."""
        quantity, session = self._quantity, self.state.session
        if quantity is ERROR:
            no_truth = session is not None and not session.has_truth
            title = f"{quantity.title}: no truth in this session" if no_truth else quantity.title
            self.heading.object = heading(title, ("▮", LOSS if self._alone else CALM, "hand lost"))
        drawn = self._lanes()
        values = [np.array([quantity.value(s) for s in lane.results.summaries]) for _, lane in drawn]
        known = np.concatenate([np.empty(0), *(part[np.isfinite(part)] for part in values)])
        highest = 1.15 * float(np.percentile(known, quantity.within)) if len(known) else 0.0
        top = min(max(quantity.top, highest), quantity.highest)
        self.figure.y_range.update(start=0, end=top)
        frames = [np.array([s.frame for s in lane.results.summaries], dtype=int) for _, lane in drawn]
        shown = {colour: (at, part) for (colour, _), at, part in zip(drawn, frames, values, strict=True)}
        for colour, source in self.lines.items():
            at, part = shown.get(colour, ([], []))
            source.data = {"frame": at, quantity.name: part}
        self.dots.data = {
            "frame": np.concatenate([np.empty(0, dtype=int), *frames]),
            "value": np.concatenate([np.empty(0), *values]),
            "colour": [colour for (colour, _), part in zip(drawn, values, strict=True) for _ in part],
        }
        self._mark_losses(drawn, top)

    def _lanes(self) -> list[tuple[str, Lane]]:
        """The lanes shown, with the colour of each one's line."""
        if self._alone:
            return [(CALM, self.state.lane)]
        by_colour = {lane.colour: lane for lane in self.state.lanes}
        return [(colour, by_colour[colour]) for colour in COLOURS if colour in by_colour]

    def _mark_losses(self, drawn: list[tuple[str, Lane]], top: float) -> None:
        """Mark the frames without a hand: over the whole height, or in a strip for each of several lanes."""
        columns: dict[str, list[Any]] = {"frame": [], "low": [], "high": [], "colour": []}
        for position, (colour, lane) in enumerate(drawn):
            low, high = (0, 1) if self._alone else (1 - _STRIP * (position + 1), 1 - _STRIP * position)
            for summary in lane.results.summaries:
                if summary.lost:
                    row = summary.frame, top * low, top * high, LOSS if self._alone else colour
                    for column, value in zip(columns.values(), row, strict=True):
                        column.append(value)
        self.losses.data = columns
