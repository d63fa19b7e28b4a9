"""A line for each lane: its mean error so far, its losses, and what a frame costs."""

from __future__ import annotations

import html

import numpy as np
import panel as pn

from app.lane import Lane
from app.state import State
from app.views.follower import Follower
from spf.evaluate import count_losses

__all__ = ["Table", "measures"]

_INK = "var(--panel-on-background-color,#5c6873)"  # the page's own, whether it is light or dark

_COLUMNS = ("", "error, mm", "overlap", "losses", "lost frames", "ms a frame")
_STYLE = """<style>
.lanes { border-collapse: collapse; width: 100%; font: 12.5px/1.35 Roboto, sans-serif;
         color: var(--panel-on-background-color, #2a3038); }
.lanes th { font-weight: 400; color: inherit; opacity: 0.8; text-align: right; padding: 2px 5px; }
.lanes td { text-align: right; padding: 4px 5px; border-top: 1px solid var(--divider-color, #e6eaee);
            font-variant-numeric: tabular-nums; }
.lanes td:first-child { text-align: left; border-left: 5px solid var(--lane); }
.lanes small { color: var(--warning-text-color, #8a4b00); }
</style>"""


class Table(Follower):
    """The pane."""

    def __init__(self, state: State) -> None:
        super().__init__(state, "compare", ("lanes", "lane", "rules", "mode"))
        self.pane = pn.pane.HTML("", sizing_mode="stretch_both", margin=(0, 2), styles={"overflow": "auto"})

    def draw(self) -> None:
        """Measure all lanes over the frames that every lane has."""
        state = self.state
        head = "".join(f"<th>{name}</th>" for name in _COLUMNS)
        rows = "".join(_row(lane, state.last) for lane in state.lanes)
        first = None if state.origin is None else state.origin.start.frame
        frames = "No frame is tracked yet" if state.last is None else f"Frames {first} to {state.last}"
        mixed = any(lane.is_mixed for lane in state.lanes)
        note = " Mixed: the settings were changed on the way; restart to compare." if mixed else ""
        self.pane.object = (
            f"{_STYLE}<table class='lanes'><tr>{head}</tr>{rows}</table>"
            f"<div style='font:12px/1.6 Roboto,sans-serif;color:{_INK};padding:4px 5px'>{frames}; means, and the median "
            f"time.{note}</div>"
        )


def measures(lane: Lane, last: int | None) -> tuple[float, float, int, int, float]:
    """Measure what a lane has tracked up to a frame.

    Returns:
        (mean joint error mm, mean overlap, losses, frames lost, median ms a frame); NaN where nothing is known.
    """
    summaries = [s for s in lane.results.summaries if last is not None and s.frame <= last]
    losses = count_losses(np.array([s.lost for s in summaries], dtype=bool))
    seconds = np.array([s.seconds for s in summaries])
    return (
        1000 * _mean([s.error for s in summaries]), _mean([s.overlap for s in summaries]), losses.losses,
        losses.frames_lost, 1000 * float(np.median(seconds)) if len(seconds) else float("nan"),
    )  # fmt: skip


def _mean(values: list[float]) -> float:
    known = np.array(values)[np.isfinite(values)] if values else np.empty(0)
    return float(known.mean()) if len(known) else float("nan")


def _row(lane: Lane, last: int | None) -> str:
    error, overlap, losses, lost, milliseconds = measures(lane, last)
    mixed = " <small>(mixed)</small>" if lane.is_mixed else ""
    known = last is not None
    cells = (
        _number(error, ".1f"), _number(overlap, ".2f"), str(losses) if known else "–", str(lost) if known else "–",
        _number(milliseconds, ".0f"),
    )  # fmt: skip
    name = f"<td style='--lane:{lane.colour}'>{html.escape(lane.title)}{mixed}</td>"
    return f"<tr>{name}{''.join(f'<td>{cell}</td>' for cell in cells)}</tr>"


def _number(value: float, form: str) -> str:
    return format(value, form) if np.isfinite(value) else "–"
