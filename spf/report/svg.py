"""Figures as inline SVG whose colours follow the page's, light or dark, and whose text is the page's font."""

from __future__ import annotations

import io
import re

import matplotlib as mpl
from markupsafe import Markup, escape
from matplotlib.axes import Axes
from matplotlib.figure import Figure

__all__ = ["COLOURS", "axes_of", "inlined"]

#: Name of a colour of the page's style sheet → what stands for it while a figure is drawn.
COLOURS = {
    "ink": "#101112",
    "muted": "#505152",
    "grid": "#d0d1d2",
    "s1": "#0072b3",
    "s2": "#d55e01",
    "s3": "#009e74",
    "s4": "#cc79a8",
    "s5": "#b58901",
    "lost": "#e35c12",
}
_WIDTH = 9.6  # inches, at 72 units each


def axes_of(rows: int = 1, columns: int = 1, *, height: float, width: float = _WIDTH) -> tuple[Figure, list[Axes]]:
    """Return an empty figure of the report and its axes, those in a column over one axis of x."""
    figure = Figure(figsize=(width, height), layout="constrained")
    grid = figure.subplots(rows, columns, sharex="col", squeeze=False)
    for axes in (found := list(grid.ravel())):
        axes.set_facecolor("none")
        axes.grid(color=COLOURS["grid"], linewidth=0.6)
        axes.set_axisbelow(True)
        axes.spines[["top", "right"]].set_visible(False)
        axes.spines[["left", "bottom"]].set_color(COLOURS["muted"])
        axes.tick_params(colors=COLOURS["muted"], length=3, width=0.6)
        axes.xaxis.label.set_color(COLOURS["ink"])
        axes.yaxis.label.set_color(COLOURS["ink"])
    return figure, found


def inlined(figure: Figure, name: str, description: str) -> Markup:
    """Return a figure as an ``<svg>`` that may stand in a page beside others.

    Args:
        figure: from :func:`axes_of`, drawn with :data:`COLOURS`.
        name: of the figure, unique in the page.
        description: what it shows, for who cannot see it.
    """
    file = io.StringIO()
    with mpl.rc_context({"svg.fonttype": "none", "svg.hashsalt": "spf"}):
        figure.savefig(file, format="svg", transparent=True, metadata={"Date": None})
    text = file.getvalue()
    text = text[text.index("<svg") :]
    text = re.sub(r"<metadata>.*?</metadata>", "", text, flags=re.DOTALL)
    root, end, rest = text.partition(">")  # inside HTML it needs no namespaces, and the page says how wide it is
    text = re.sub(r'\s(xmlns(:\w+)?|version|width|height)="[^"]*"', "", root) + end + rest
    text = re.sub(r"font: ([\d.]+px) [^;\"]+", r"font-size: \1", text)
    text = re.sub(r'\bid="', f'id="{name}-', text)
    text = text.replace("url(#", f"url(#{name}-").replace('href="#', f'href="#{name}-')
    for variable, colour in COLOURS.items():
        text = text.replace(colour, f"var(--{variable})")
    label = f'<svg role="img" aria-label="{escape(description)}"'
    return Markup(text.replace("<svg", label, 1))
