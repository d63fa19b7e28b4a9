"""The plots of a report: what was found over the frames, and how good it is."""

from __future__ import annotations

import json
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from markupsafe import Markup
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from spf.report.svg import COLOURS, axes_of, inlined

__all__ = ["Line", "Panel", "Plot", "bar_plot", "curve_plot", "frame_plot", "stage_plot"]

Array = NDArray[np.float64]
_DIGITS = 4  # of the values that a pointer shows
_LINES = ("s1", "s2", "s3", "s4", "s5")
_DASHES = ("-", (0, (5, 2)), (0, (4, 1.5, 1, 1.5)), (0, (1.5, 1.5)), (0, (7, 2)))  # told apart without colours too


class Line(NamedTuple):
    """A quantity over the frames: its name, its (N,) values, NaN where unknown, and the name of its colour."""

    name: str
    values: Array
    colour: str = ""
    thin: bool = False


class Panel(NamedTuple):
    """Axes of a plot over the frames: the label of y with its unit, the lines, and whether y begins at 0."""

    label: str
    lines: tuple[Line, ...]
    from_zero: bool = True
    top: float | None = None


class Plot(NamedTuple):
    """A figure of the report.

    Attributes:
        title, note: that stand above and below it.
        svg: the drawing.
        legend: (colour, name) of its lines.
        hover: JSON for the pointer, or nothing.
    """

    title: str
    note: str
    svg: Markup
    legend: tuple[tuple[str, str], ...]
    hover: str = ""


def frame_plot(
    name: str, title: str, frames: NDArray[np.int64], panels: Sequence[Panel], lost: NDArray[np.bool_], note: str = ""
) -> Plot:
    """Draw quantities over the frames, one panel above the other; frames without a hand are shaded.

    Args:
        name: unique in the report.
        title: of the plot.
        frames: (N,) indices in the session.
        panels: what is drawn.
        lost: (N,) whether the hand is lost.
        note: one sentence below the plot.
    """
    figure, all_axes = axes_of(len(panels), height=0.55 + (1.5 if len(panels) == 1 else 1.05) * len(panels))
    drawn: list[tuple[str, str, Array]] = []
    for axes, panel in zip(all_axes, panels, strict=True):
        for place, line in enumerate(panel.lines):
            colour = line.colour or _LINES[place % len(_LINES)]
            dash = _DASHES[place % len(_DASHES)]
            axes.plot(frames, line.values, color=COLOURS[colour], linewidth=0.8 if line.thin else 1.4, linestyle=dash)
            drawn.append((colour, line.name, line.values))
        axes.set_ylabel(panel.label)
        if panel.from_zero:
            axes.set_ylim(bottom=0, top=panel.top)
        _shade(axes, frames, lost)
    all_axes[-1].set_xlabel("frame")
    first, last = float(frames[0]), float(max(frames[-1], frames[0] + 1))
    all_axes[0].set_xlim(first, last)
    svg = inlined(figure, name, f"{title}, over the frames {frames[0]} to {frames[-1]}")
    legend = [(colour, text) for colour, text, _ in drawn]
    if lost.any():
        legend.append(("lost", "hand lost"))
    return Plot(title, note, svg, tuple(dict.fromkeys(legend)), _hover(figure, all_axes, frames, drawn))


def _shade(axes: Axes, frames: NDArray[np.int64], lost: NDArray[np.bool_]) -> None:
    edges = np.diff(np.concatenate([[0], lost.astype(np.int8), [0]]))
    for begin, end in zip(np.flatnonzero(edges == 1), np.flatnonzero(edges == -1), strict=True):
        axes.axvspan(frames[begin] - 0.5, frames[end - 1] + 0.5, color=COLOURS["lost"], alpha=0.22, linewidth=0)


def _hover(figure: Figure, all_axes: list[Axes], frames: NDArray[np.int64], drawn: list[tuple[str, str, Array]]) -> str:
    """Where the axes lie, as shares of the drawing, and the values at each frame."""
    boxes = [axes.get_position() for axes in all_axes]
    low, high = all_axes[0].get_xlim()
    content = {
        "left": boxes[0].x0,
        "right": boxes[0].x1,
        "top": 1 - boxes[0].y1,
        "bottom": 1 - boxes[-1].y0,
        "low": low,
        "high": high,
        "frames": frames.tolist(),
        "lines": [{"name": name, "values": [_short(value) for value in values]} for _, name, values in drawn],
    }
    return json.dumps(content, separators=(",", ":"))


def _short(value: float) -> float | None:
    return float(f"{value:.{_DIGITS}g}") if np.isfinite(value) else None


def stage_plot(
    name: str, title: str, frames: NDArray[np.int64], stages: dict[str, Array], lost: NDArray[np.bool_], note: str
) -> Plot:
    """Draw the time of each frame as a stack of its stages: name → (N,) seconds, NaN where there was none."""
    figure, (axes,) = axes_of(height=2.3)
    colours = [_LINES[place % len(_LINES)] for place in range(len(stages))]
    values = [1e3 * np.nan_to_num(part) for part in stages.values()]
    axes.stackplot(frames, values, colors=[COLOURS[colour] for colour in colours], alpha=0.75, linewidth=0)
    total = np.sum(values, axis=0)
    axes.set(xlabel="frame", ylabel="ms", xlim=(frames[0], max(frames[-1], frames[0] + 1)))
    axes.set_ylim(0, 1.1 * float(np.percentile(total, 98)) or 1.0)
    _shade(axes, frames, lost)
    drawn = [(colour, text, part) for colour, text, part in zip(colours, stages, values, strict=True)]
    svg = inlined(figure, name, f"{title}, over the frames {frames[0]} to {frames[-1]}")
    legend = tuple((colour, text) for colour, text, _ in drawn)
    return Plot(title, note, svg, legend, _hover(figure, [axes], frames, drawn))


def bar_plot(name: str, title: str, values: dict[str, Any], label: str, note: str = "") -> Plot:
    """Draw a bar for each name; None where a value is not known."""
    figure, (axes,) = axes_of(height=2.5, width=_HALF)
    places = np.arange(len(values))
    heights = [np.nan if value is None else value for value in values.values()]
    axes.bar(places, heights, color=COLOURS["s1"], width=0.72)
    axes.set_xticks(places, [text.replace("_", " ") for text in values], rotation=60, ha="right", fontsize=7)
    axes.grid(axis="x", visible=False)
    axes.set_ylabel(label)
    described = ", ".join(f"{text} {value:.1f}" for text, value in values.items() if value is not None)
    return Plot(title, note, inlined(figure, name, f"{title}: {described}"), ())


_HALF = 6.0  # inches of a plot that has a neighbour


def curve_plot(
    name: str, title: str, x: list[float], lines: dict[str, list[float]], label: str, note: str = ""
) -> Plot:
    """Draw shares (0 to 1) against thresholds, in percent."""
    figure, (axes,) = axes_of(height=2.5, width=_HALF)
    legend = []
    for place, (text, values) in enumerate(lines.items()):
        axes.plot(x, 100 * np.asarray(values), color=COLOURS[_LINES[place]], linewidth=1.5, linestyle=_DASHES[place])
        legend.append((_LINES[place], text))
    axes.set(xlim=(x[0], x[-1]), ylim=(0, 101), xlabel=label, ylabel="%")
    return Plot(title, note, inlined(figure, name, title), tuple(legend))
