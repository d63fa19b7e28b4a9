"""Step sizes of Stochastic Meta-Descent (19) of one particle: every entry of the pose, over the iterations."""

from __future__ import annotations

import numpy as np
from bokeh.models import (
    BasicTicker,
    ColorBar,
    ColumnDataSource,
    CustomJSHover,
    FactorRange,
    FixedTicker,
    HoverTool,
    LinearColorMapper,
)
from bokeh.palettes import PuOr11, interp_palette

from app.state import State
from app.views.entries import short_name
from app.views.plots import CALM, Plot, calm_figure, heading
from spf.hand.model import DOF_NAMES

__all__ = ["StepSizes"]

_DECADES = 1.0  # of a/a₀, to either side of 1, that the colours cover
_NAMES = [short_name(name) for name in DOF_NAMES]
_TICKS = {-1.0: "≤ 0.1", -0.5: "0.3", 0.0: "1", 0.5: "3", 1.0: "≥ 10"}


class StepSizes(Plot):
    """The pane."""

    tab = "particles"

    def __init__(self, state: State) -> None:
        self.source = ColumnDataSource({"image": [], "x": [], "y": [], "dw": [], "dh": []})
        plot = calm_figure("iteration", "", x_range=(0, 80), y_range=FactorRange(*reversed(_NAMES)))
        colours = LinearColorMapper(
            palette=interp_palette(PuOr11, 255), low=-_DECADES, high=_DECADES, nan_color="rgba(128, 128, 128, 0.25)"
        )
        picture = plot.image("image", "x", "y", "dw", "dh", source=self.source, color_mapper=colours)
        plot.add_layout(
            ColorBar(
                color_mapper=colours, ticker=FixedTicker(ticks=list(_TICKS)), major_label_overrides=_TICKS, width=10,
                padding=4, label_standoff=4,
            ),
            "right",
        )  # fmt: skip
        plot.xaxis.ticker = BasicTicker(min_interval=1)
        plot.yaxis.axis_label = None
        plot.grid.visible = False
        hover = plot.select_one(HoverTool)
        hover.renderers = [picture]
        hover.formatters = {"@image": CustomJSHover(code="return Math.pow(10, value).toFixed(2);")}
        hover.tooltips = [("entry", "$y"), ("iteration", "$x{0}"), ("a/a₀", "@image{custom}")]
        super().__init__(state, plot, "", look=("selected",))

    def draw(self) -> None:
        """Show the first particle picked, or the heaviest."""
        info = self.state.entry.result.info if self.state.entry is not None else None
        if info is None or not info.trajectories:
            self._show_nothing("nothing is optimised here")
            return
        picked = self.state.look.picked(len(info.trajectories))
        particle = picked[0] if picked else int(np.argmax(info.optimised_weights))
        steps = info.trajectories[particle].step_sizes[:, : len(DOF_NAMES)]
        if not (np.isfinite(steps).all() and (steps > 0).all()):
            self._show_nothing("this optimiser has none")
            return
        relative = np.log10(steps / steps[0])
        count = len(relative)
        self.source.data = {"image": [relative.T[::-1]], "x": [0], "y": [0], "dw": [count], "dh": [len(_NAMES)]}
        self.figure.x_range.update(start=0, end=count)
        which = "picked" if picked else "the heaviest"
        self.heading.object = heading(f"Step sizes a/a₀ of particle {particle + 1}", ("", CALM, which))

    def _show_nothing(self, why: str) -> None:
        self.source.data = {name: [] for name in self.source.data}
        self.heading.object = heading("Step sizes", ("", CALM, why))
