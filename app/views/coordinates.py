"""Particles in the plane of two entries of a pose (Fig. 7), over the kernel density estimates f, f⁺ and g (27, 28, 31)."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import panel_material_ui as pmu
from bokeh.models import ColumnDataSource, HoverTool, TapTool
from bokeh.plotting.contour import contour_data
from numpy.typing import NDArray

from app.look import DENSITIES
from app.results import Entry
from app.state import State
from app.views.entries import ENTRIES, axis_label, in_units
from app.views.particles import Particles
from app.views.plots import AFTER, BEFORE, CALM, Plot, calm_figure, heading
from spf.filters.kde import marginal_density
from spf.filters.step import StepInfo
from spf.frame import Truth
from spf.hand.kinematics import angles_of, rotation_about

__all__ = ["Coordinates"]

Array = NDArray[np.float64]
_GRID = 72  # points along each axis at which the densities are evaluated
_LEVELS = (0.1, 0.3, 0.5, 0.7, 0.9)  # of each density's peak in the plane
_COLOURS, _DASHES = {"f": BEFORE, "f_plus": AFTER, "g": CALM}, {"f": "solid", "f_plus": "solid", "g": "4 3"}
_LEAST_SPAN = 4.0  # mm or degrees that an axis shows at least


class Coordinates(Plot):
    """The pane."""

    tab = "particles"

    def __init__(self, state: State, particles: Particles) -> None:
        look = state.look
        plot = calm_figure(axis_label(look.across), axis_label(look.upwards), x_range=(-1, 1), y_range=(-1, 1))
        plot.xaxis.ticker.desired_num_ticks = plot.yaxis.ticker.desired_num_ticks = 8
        self.contours = {name: ColumnDataSource({"xs": [], "ys": [], "alpha": []}) for name in _COLOURS}
        self.paths = ColumnDataSource({"xs": [], "ys": [], "alpha": [], "width": []})
        self.window = ColumnDataSource({"x": [], "y": [], "width": [], "height": []})
        self.marks = {name: ColumnDataSource({"x": [], "y": []}) for name in ("truth", "estimate")}
        for name, source in self.contours.items():
            plot.multi_line(
                "xs", "ys", source=source, color=_COLOURS[name], line_alpha="alpha", line_width=1.6,
                line_dash=_DASHES[name],
            )  # fmt: skip
        plot.ellipse(
            "x", "y", width="width", height="height", source=self.window, fill_color=None, line_color="#cc79a7",
            line_width=2, line_dash="8 4",
        )  # fmt: skip
        plot.multi_line(
            "xs", "ys", source=self.paths, color="#8a949e", line_alpha="alpha", line_width="width"
        )  # fmt: skip
        markers = [
            plot.scatter(
                f"x{half}", f"y{half}", source=particles.source, marker=marker, size=size, color=colour,
                line_color="#2a3038", alpha=0.95, nonselection_alpha=0.25, selection_line_width=2.5,
            )
            for half, marker, size, colour in (
                (0, "square", "size_before", BEFORE), (1, "circle", "size_after", AFTER),
            )
        ]  # fmt: skip
        plot.scatter("x", "y", source=self.marks["truth"], marker="cross", size=22, line_width=2.5, color="#009e73")
        plot.scatter("x", "y", source=self.marks["estimate"], marker="x", size=13, line_width=2.5, color="#d55e00")
        hover = plot.select_one(HoverTool)
        hover.renderers = markers
        hover.tooltips = [
            ("particle", "@particle (@origin)"), ("before", "@x0{0.0}, @y0{0.0}, @weight_before{0.0} %"),
            ("after", "@x1{0.0}, @y1{0.0}, @weight_after{0.0} %"),
        ]  # fmt: skip
        plot.add_tools(TapTool(renderers=markers))
        super().__init__(
            state, plot, "", also=("with_truth",), look=("across", "upwards", "densities", "selected"),
        )  # fmt: skip
        self.tools = _tools(state)

    def draw(self) -> None:
        """Show the particles of the frame shown."""
        entry, look = self.state.entry, self.state.look
        across, upwards = look.across, look.upwards
        self.figure.xaxis.axis_label, self.figure.yaxis.axis_label = axis_label(across), axis_label(upwards)
        info = None if entry is None else entry.result.info
        if entry is None or info is None:
            self._clear()
            return
        factors = np.array([in_units(across), in_units(upwards)])
        plane = [across, upwards]
        points = np.concatenate([info.predicted, info.optimised])[:, plane] * factors
        bandwidth = info.bandwidth[plane] * factors
        shown = look.densities if np.isfinite(bandwidth).all() else []
        low, high = _ranges(points, bandwidth if shown else np.zeros(2))
        self.figure.x_range.update(start=low[0], end=high[0])
        self.figure.y_range.update(start=low[1], end=high[1])
        self._draw_densities(points, len(info.predicted), bandwidth, (low, high), shown)
        self._draw_paths(info, factors)
        self._mark("estimate", info.estimate[plane] * factors)
        truth = self._truth(entry, info)
        self._mark("truth", None if truth is None else truth[plane] * factors)
        self.heading.object = _heading(info, shown, factors, bandwidth, truth is not None)

    def _clear(self) -> None:
        for source in (*self.contours.values(), self.paths, self.window, *self.marks.values()):
            source.data = {name: [] for name in source.data}
        self.heading.object = heading("Particles in two entries of the pose")

    def _mark(self, name: str, at: Array | None) -> None:
        self.marks[name].data = {"x": [], "y": []} if at is None else {"x": at[:1], "y": at[1:]}

    def _draw_densities(
        self, points: Array, count: int, bandwidth: Array, ends: tuple[Array, Array], shown: list[str]
    ) -> None:
        nothing: dict[str, Any] = {"xs": [], "ys": [], "alpha": []}
        if not shown:
            for source in self.contours.values():
                source.data = nothing
            self.window.data = {name: [] for name in self.window.data}
            return
        x, y = (np.linspace(low, high, _GRID) for low, high in zip(*ends, strict=True))
        f = marginal_density(x, y, points[:count], bandwidth)
        f_plus = marginal_density(x, y, points[count:], bandwidth)
        for name, density in (("f", f), ("f_plus", f_plus), ("g", 0.5 * (f + f_plus))):
            if name not in shown:
                self.contours[name].data = nothing
                continue
            lines = contour_data(x, y, density, np.array(_LEVELS) * density.max(), want_fill=False).line_data
            self.contours[name].data = {
                "xs": list(lines.xs), "ys": list(lines.ys), "alpha": [0.25 + 0.75 * level for level in _LEVELS],
            }  # fmt: skip
        middle = points[count:].mean(axis=0)
        self.window.data = {
            "x": middle[:1], "y": middle[1:], "width": 2 * bandwidth[:1], "height": 2 * bandwidth[1:],
        }  # fmt: skip

    def _draw_paths(self, info: StepInfo, factors: Array) -> None:
        look = self.state.look
        picked = look.picked(len(info.predicted))
        traces = [trace.poses[:, [look.across, look.upwards]] * factors for trace in info.trajectories]
        faint = [bool(picked) and index not in picked for index in range(len(traces))]
        self.paths.data = {
            "xs": [trace[:, 0] for trace in traces],
            "ys": [trace[:, 1] for trace in traces],
            "alpha": [0.2 if one else 0.9 for one in faint],
            "width": [1.0 if one else 1.6 for one in faint],
        }

    def _truth(self, entry: Entry, info: StepInfo) -> Array | None:
        """The true pose relative to the frame's reference orientation; None where it is not known or not shown."""
        state = self.state
        if not state.with_truth or state.session is None or not state.session.has_truth:
            return None
        truth = state.session[state.frame].truth
        return None if truth is None else _relative(truth, info.reference)


def _relative(truth: Truth, reference: Array) -> Array | None:
    if truth.pose is None or truth.orientation is None:
        return None
    turn = rotation_about(truth.pose[3:6]) @ truth.orientation @ reference.T
    return np.concatenate([truth.pose[:3], angles_of(turn), truth.pose[6:]])


def _ranges(points: Array, bandwidth: Array) -> tuple[Array, Array]:
    """Ends of both axes: all particles, and one window around them where densities are drawn."""
    low, high = points.min(axis=0), points.max(axis=0)
    span = np.maximum(high - low, _LEAST_SPAN)
    middle, half = 0.5 * (low + high), 0.5 * span * 1.25
    half = np.maximum(half, 0.5 * (high - low) + 1.35 * bandwidth)
    return middle - half, middle + half


def _heading(info: StepInfo, shown: list[str], factors: Array, bandwidth: Array, with_truth: bool) -> str:
    keys = [("■", BEFORE, "predicted"), ("●", AFTER, "optimised"), ("✕", "#d55e00", "estimate")]
    if with_truth:
        keys.append(("✚", "#009e73", "truth"))
    if shown:
        sizes = " × ".join(
            f"{size:.0f} {'mm' if factor == 1000.0 else '°'}" for size, factor in zip(bandwidth, factors, strict=True)
        )
        keys.append(("╌", "#cc79a7", f"window h = {info.window:.3g} ({sizes})"))
    elif not math.isfinite(info.window):
        keys.append(("", CALM, "no window here"))
    return heading("Particles", *keys)


def _tools(state: State) -> pmu.Row:
    """What stands above the plane: both entries, and which densities are drawn."""
    look = state.look
    options: dict[str, Any] = {"options": ENTRIES, "size": "small", "margin": (2, 4), "sizing_mode": "stretch_width"}
    densities = pmu.CheckButtonGroup.from_param(
        look.param.densities, name="", options=DENSITIES, size="small", margin=(6, 4), width=130,
        sx={"& .MuiToggleButton-root": {"textTransform": "none"}},
    )  # fmt: skip
    return pmu.Row(
        pmu.Select.from_param(look.param.across, label="Across", **options),
        pmu.Select.from_param(look.param.upwards, label="Upwards", **options),
        densities, sizing_mode="stretch_width", margin=0,
    )  # fmt: skip
