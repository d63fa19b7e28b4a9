"""The particles of the frame shown as a table; rows picked here are picked in the plane and in the 3-D pictures."""

from __future__ import annotations

from typing import Any

import numpy as np
import pandas as pd
import panel as pn
from bokeh.models.widgets.tables import NumberFormatter

from app.state import State
from app.views.follower import Follower
from app.views.particles import Particles

__all__ = ["ParticleTable"]

#: Column of the source → (heading, decimals or None for words, width in pixels).
_COLUMNS: dict[str, tuple[str, int | None, int]] = {
    "particle": ("#", 0, 44), "origin": ("proposal", None, 96), "ancestor": ("ancestor", None, 104),
    "cost_before": ("E before", 1, 84), "cost_after": ("E after", 1, 80),
    "log_l_before": ("log p before", 1, 104), "log_l_after": ("log p after", 1, 98),
    "log_c_before": ("log₁₀ c before", 2, 116), "log_c_after": ("log₁₀ c after", 2, 108),
    "weight_before": ("weight before, %", 1, 128), "weight_after": ("weight after, %", 1, 120),
}  # fmt: skip
_SMALL = """
.tabulator, .tabulator .tabulator-row .tabulator-cell { font: 12px Roboto, sans-serif !important; }
.tabulator .tabulator-header .tabulator-col .tabulator-col-content { padding: 4px 6px !important; font-size: 12px; }
.tabulator .tabulator-row .tabulator-cell { padding: 4px 8px !important; height: auto !important; }
.tabulator .tabulator-row { min-height: 24px !important; }
"""


class ParticleTable(Follower):
    """The pane; its rows are those of the source."""

    tab = "particles"

    def __init__(self, state: State, particles: Particles) -> None:
        super().__init__(state, look=("selected",))
        self._particles = particles
        self.pane = pn.widgets.Tabulator(
            _frame(particles), show_index=False, disabled=True, selectable=True, layout="fit_data_stretch",
            theme="simple", stylesheets=[_SMALL], sizing_mode="stretch_both", margin=0, pagination=None,  # it scrolls
            widths={heading: width for heading, _, width in _COLUMNS.values()},
            formatters={
                heading: NumberFormatter(format=f"{0:.{decimals}f}", nan_format="–")
                for heading, decimals, _ in _COLUMNS.values()
                if decimals is not None
            },
            text_align={heading: "right" for heading, decimals, _ in _COLUMNS.values() if decimals is not None},
        )  # fmt: skip
        self.pane.param.watch(self._on_picked, "selection")

    def _on_picked(self, event: Any) -> None:
        self.state.look.selected = tuple(sorted(event.new))

    def draw(self) -> None:
        """Show the rows of the source, and which are picked."""
        rows = _frame(self._particles)
        picked = self.state.look.picked(len(rows))
        if not rows.equals(self.pane.value):
            self.pane.value = rows
        if self.pane.selection != picked:
            self.pane.selection = picked


def _frame(particles: Particles) -> pd.DataFrame:
    """The columns of the source that are shown; a number that does not exist is a dash."""
    data = particles.source.data
    frame = pd.DataFrame({heading: data[name] for name, (heading, _, _) in _COLUMNS.items()})
    return frame.replace([np.inf, -np.inf], np.nan)
