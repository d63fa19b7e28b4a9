"""The shape of the posed hand: its numbers, to change and to compare with those before, measured from the depth, saved."""

from __future__ import annotations

from functools import partial
from typing import Any

import panel as pn
import panel_material_ui as pmu

from app.placed import SHAPE_PARTS, Placed, part_of
from app.posing import Posing
from app.views.download import Download
from app.views.words import facts
from spf.errors import SpfError

__all__ = ["ShapeControls"]

_RANGES = {"scale": (0.4, 2.0)}
_RANGE = (0.5, 1.8)


class ShapeControls:
    """The part of the column beside the picture that is about the hand itself."""

    def __init__(self, posing: Posing) -> None:
        self._posing, self._following = posing, False
        self.download = Download(width=0, height=0, margin=0)
        button: dict[str, Any] = {
            "size": "small",
            "variant": "outlined",
            "margin": (3, 3),
            "sizing_mode": "stretch_width",
        }
        self._measure = pmu.Button(label="Fit shape", icon="straighten", on_click=self._on_measure, **button)
        self._save = pmu.Button(label="Save hand", icon="download", on_click=self._on_save, **button)
        self._side = pmu.RadioButtonGroup(
            options={"Right hand": "right", "Left hand": "left"}, value="right", size="small", margin=(4, 3),
            sizing_mode="stretch_width",
            sx={"& .MuiToggleButton-root": {"textTransform": "none", "padding": "2px 6px", "flex": "1 1 0"}},
        )  # fmt: skip
        self._side.param.watch(self._on_side, "value")
        self._facts = pn.pane.HTML("", sizing_mode="stretch_width", margin=(2, 6))
        self._fields: dict[str, pmu.FloatInput] = {}
        for label, part in SHAPE_PARTS.items():
            low, high = _RANGES.get(part, _RANGE)
            field = pmu.FloatInput(
                label=label,
                value=1.0,
                start=low,
                end=high,
                step=0.01,
                size="small",
                width=136,
                margin=(4, 4),
                format="0.000",
            )
            field.param.watch(partial(self._changed, part), "value")
            self._fields[part] = field
        grid = pn.FlexBox(*self._fields.values(), sizing_mode="stretch_width", margin=0)
        self.panel = pmu.Column(
            pmu.Typography("Hand", variant="subtitle2", margin=(8, 6, 0, 6)), self._side,
            pmu.Row(self._measure, self._save, sizing_mode="stretch_width", margin=0), self._facts, grid, self.download,
            sizing_mode="stretch_width", margin=0,
        )  # fmt: skip
        posing.param.watch(self._follow, ["placed", "compared"])
        posing.state.param.watch(self._follow, ["task", "playing"])
        self._follow()

    async def _on_measure(self, _event: Any) -> None:
        await self._posing.calibrate()

    def _on_save(self, _event: Any) -> None:
        try:
            self.download.hand_over(*self._posing.file_of_hand())
        except SpfError as error:
            self._posing.state.error = str(error)

    def _on_side(self, event: Any) -> None:
        if not self._following:
            self._posing.set_side(event.new)

    def _changed(self, part: str, event: Any) -> None:
        if not self._following and event.new is not None:
            self._posing.set_shape(part, event.new)

    def _follow(self, *_events: Any) -> None:
        posing = self._posing
        placed = posing.placed
        self._measure.disabled = placed is None or posing.state.busy
        self._save.disabled = placed is None
        if placed is None:
            self._facts.object = ""
            return
        self._following = True
        self._side.value = placed.shape.side
        for part, field in self._fields.items():
            field.value = round(part_of(placed.shape, part), 3)
        self._following = False
        self._facts.object = _told(placed, posing.compared)


def _told(placed: Placed, before: Placed | None) -> str:
    """HTML: the hand's length, and what was changed by a fit."""
    words = (
        f"<b>{1000 * placed.hand.length:.0f} mm</b> from wrist to middle fingertip. <i>Fit shape</i> tracks "
        "up to 48 frames from the one shown on, and fits these factors to their depth."
    )
    if before is not None:
        rows = [("Length, mm", 1000 * before.hand.length, 1000 * placed.hand.length, "0f")]
        rows += [
            (label, part_of(before.shape, part), part_of(placed.shape, part), "3f")
            for label, part in SHAPE_PARTS.items()
        ]
        cells = "".join(
            f"<tr><td>{label}</td><td>{was:.{digits}}</td><td>{now:.{digits}}</td></tr>"
            for label, was, now, digits in rows
        )
        words += (
            "<table class='shape-change' style='width:100%;font-variant-numeric:tabular-nums;text-align:right'>"
            f"<tr><th></th><th>before</th><th>fitted</th></tr>{cells}</table>"
        )
    style = "<style>.shape-change td:first-child{text-align:left}.shape-change th{font-weight:500}</style>"
    return style + facts(words)
