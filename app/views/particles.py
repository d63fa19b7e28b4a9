"""The particles of the frame shown as one data source, which the plane and the table share: what is picked in one is
picked in all."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from bokeh.models import ColumnDataSource

from app.results import Entry
from app.state import State
from app.views.entries import in_units
from app.views.follower import Follower
from spf.filters.step import StepInfo

__all__ = ["PARTICLE_COLUMNS", "Particles"]

PARTICLE_COLUMNS = (
    "particle", "origin", "ancestor", "x0", "y0", "x1", "y1", "cost_before", "cost_after", "log_l_before", "log_l_after",
    "log_c_before", "log_c_after", "weight_before", "weight_after", "size_before", "size_after",
)  # fmt: skip
_LEAST_SIZE, _MOST_SIZE = 7.0, 17.0  # pixels of a marker without weight, and of the heaviest


class Particles(Follower):
    """Keeps the source and the look's selection in step."""

    tab = "particles"

    def __init__(self, state: State) -> None:
        super().__init__(state, look=("across", "upwards", "selected"))
        self.source = ColumnDataSource({name: [] for name in PARTICLE_COLUMNS})
        self.source.selected.on_change("indices", self._on_picked)

    def _on_picked(self, _name: str, _old: Any, new: list[int]) -> None:
        self.state.look.selected = tuple(sorted(new))

    def draw(self) -> None:
        """Take the particles of the frame shown."""
        entry, look = self.state.entry, self.state.look
        info = None if entry is None else entry.result.info
        if info is None:
            self.source.data = {name: [] for name in PARTICLE_COLUMNS}
            return
        before = self.state.lane.entry(self.state.frame - 1)
        self.source.data = {
            **_table(info, _ancestors(info, before)),
            **_plane(info, look.across, look.upwards),
        }
        picked = look.picked(len(info.predicted))
        if list(self.source.selected.indices) != picked:
            self.source.selected.indices = picked


def _table(info: StepInfo, ancestors: list[str]) -> dict[str, Any]:
    count, optimised = len(info.predicted), len(info.optimised)
    absent = np.full(count, math.nan)

    def halves(values: Any) -> tuple[Any, Any]:
        return values[:count], values[count:] if optimised else absent

    likelihood, correction = halves(info.log_likelihood), halves(info.log_correction / math.log(10.0))
    before, after = info.predicted_weights, info.optimised_weights if optimised else np.zeros(count)
    heaviest = max(before.max(initial=0.0), after.max(initial=0.0)) or 1.0
    sizes = (_LEAST_SIZE + (_MOST_SIZE - _LEAST_SIZE) * np.sqrt(half / heaviest) for half in (before, after))
    return {
        "particle": np.arange(1, count + 1),
        "origin": list(info.origins),
        "ancestor": ancestors,
        "cost_before": info.cost_before,
        "cost_after": info.cost_after if optimised else absent,
        **dict(zip(("log_l_before", "log_l_after"), likelihood, strict=True)),
        **dict(zip(("log_c_before", "log_c_after"), correction, strict=True)),
        "weight_before": 100 * before,
        "weight_after": 100 * after if optimised else absent,
        **dict(zip(("size_before", "size_after"), sizes, strict=True)),
    }


def _plane(info: StepInfo, across: int, upwards: int) -> dict[str, Any]:
    nothing = np.full(len(info.predicted), math.nan)
    columns: dict[str, Any] = {}
    for axis, index in (("x", across), ("y", upwards)):
        columns[f"{axis}0"] = in_units(index) * info.predicted[:, index]
        columns[f"{axis}1"] = in_units(index) * info.optimised[:, index] if len(info.optimised) else nothing
    return columns


def _ancestors(info: StepInfo, before: Entry | None) -> list[str]:
    """Which sample of the last frame each particle comes from, in words."""
    last = None if before is None else before.result.info
    if last is None:
        return [f"sample {index + 1}" for index in info.ancestors]
    count = len(last.predicted)
    return [f"{index % count + 1} {'predicted' if index < count else 'optimised'}" for index in info.ancestors]
