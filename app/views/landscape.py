"""The cost E over two entries of the pose around the estimate, with the samples: it follows the settings at once."""

from __future__ import annotations

import html

import numpy as np
import panel as pn
import panel_material_ui as pmu
from bokeh.models import ColumnDataSource, LinearColorMapper

from app.state import State
from app.views.follower import Follower
from app.views.plots import AFTER, BEFORE, calm_figure, heading
from spf.hand.model import DOF_NAMES

__all__ = ["LandscapeCard"]

_PALETTE = "Viridis256"


class LandscapeCard(Follower):
    """The plot, what the settings change in words, and the choice of the two entries."""

    def __init__(self, state: State) -> None:
        plot = calm_figure("", "", x_range=(-1, 1), y_range=(-1, 1))
        plot.update(height=190, sizing_mode="stretch_width")  # among cards that take what room they need
        plot.grid.visible = False
        self.image = ColumnDataSource({"cost": [], "x": [], "y": [], "w": [], "h": []})
        self._mapper = LinearColorMapper(palette=_PALETTE)
        plot.image("cost", x="x", y="y", dw="w", dh="h", source=self.image, color_mapper=self._mapper)
        self.samples = ColumnDataSource({"x": [], "y": [], "colour": [], "marker": [], "size": []})
        plot.scatter(
            "x", "y", source=self.samples, color="colour", marker="marker", size="size", line_color="#20262c"
        )  # fmt: skip
        keys = ("■", BEFORE, "pred."), ("●", AFTER, "opt."), ("✚", "#ffffff", "estimate")
        super().__init__(state, None, also=("lane", "rules", "preview"))
        self.figure = plot
        self._heading = pn.pane.HTML(heading("Cost E", *keys), margin=(2, 10), sizing_mode="stretch_width")
        self._pane = pn.pane.Bokeh(plot, height=190, min_height=190, sizing_mode="stretch_width", margin=0)
        self.note = pn.pane.HTML("", sizing_mode="stretch_width", margin=(0, 10))
        options = {name.replace("_", " "): index for index, name in enumerate(DOF_NAMES)}
        self._entries = [
            pmu.Select(label=label, options=options, value=index, size="small", sizing_mode="stretch_width")
            for label, index in zip(("across", "up"), state.landscape_of, strict=True)
        ]
        for select in self._entries:
            select.param.watch(self._picked, "value")
        self.panel = pmu.Column(
            self.note, self._heading, self._pane, pmu.Row(*self._entries, sizing_mode="stretch_width"),
            sizing_mode="stretch_width", margin=0,
        )  # fmt: skip

    def _picked(self, _event: object) -> None:
        first, second = (int(select.value) for select in self._entries)
        self.state.landscape_of = (first, second)

    def draw(self) -> None:
        """Show the preview of the frame shown."""
        state = self.state
        preview = state.preview
        current = preview is not None and preview.base is state.lane.entry(state.frame)
        land = preview.landscape if preview is not None and current else None
        self.note.object = _note(preview.note) if preview is not None and current and preview.note else ""
        if preview is not None and current and land is None and preview.base.tracking.tracker == state.lane.tracker:
            return  # it comes in a moment
        if preview is None or land is None:
            self.image.data = {"cost": [], "x": [], "y": [], "w": [], "h": []}
            self.samples.data = {"x": [], "y": [], "colour": [], "marker": [], "size": []}
            return
        info = preview.entry.result.info
        assert info is not None
        scales = [1000.0 if index < 3 else 180.0 / np.pi for index in land.entries]
        (x0, x1), (y0, y1) = (
            (scale * values[0], scale * values[-1]) for scale, values in zip(scales, land.across, strict=True)
        )
        self.image.data = {"cost": [land.cost], "x": [x0], "y": [y0], "w": [x1 - x0], "h": [y1 - y0]}
        self._mapper.update(low=float(land.cost.min()), high=float(np.percentile(land.cost, 92)))
        points = np.concatenate([info.predicted, info.optimised, info.estimate[None]])[:, list(land.entries)] * scales
        kinds = [(BEFORE, "square", 7)] * len(info.predicted) + [(AFTER, "circle", 8)] * len(info.optimised)
        colours, markers, sizes = zip(*kinds, ("#ffffff", "cross", 13), strict=True)
        self.samples.data = {
            "x": points[:, 0], "y": points[:, 1], "colour": list(colours), "marker": list(markers), "size": list(sizes)
        }  # fmt: skip
        self.figure.x_range.update(start=x0, end=x1)
        self.figure.y_range.update(start=y0, end=y1)
        labels = [f"{DOF_NAMES[i].replace('_', ' ')}, {'mm' if i < 3 else '°'}" for i in land.entries]
        self.figure.xaxis.axis_label, self.figure.yaxis.axis_label = labels


def _note(text: str) -> str:
    style = "font:12px/1.4 Roboto,sans-serif;color:var(--panel-on-background-color,#2a3038)"
    return f"<div class='what-if' style='{style}'>{html.escape(text)}</div>"
