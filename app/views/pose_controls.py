"""Buttons of a posed hand, and a slider for every entry of its pose, in millimetres and degrees."""

from __future__ import annotations

from collections.abc import Awaitable, Callable
from functools import partial
from typing import Any

import panel as pn
import panel_material_ui as pmu

from app.posing import Posing
from app.views.download import Download
from app.views.entries import axis_label, in_units
from app.views.words import facts
from spf.errors import SpfError
from spf.hand.handles import entries_of
from spf.hand.model import FINGERS

__all__ = ["PoseControls"]

_GROUPS = {"Palm": "palm", **{finger.capitalize(): finger for finger in FINGERS}}
_PALM_ENDS = ((-600.0, 600.0), (-600.0, 600.0), (100.0, 2000.0), *((-180.0, 180.0),) * 3)  # mm and degrees
_TURNS = "Turns are counted from the last drag or fit."


class PoseControls:
    """The column beside the picture."""

    def __init__(self, posing: Posing) -> None:
        self._posing, self._following = posing, False
        self.download = Download(width=0, height=0, margin=0)
        self._sliders: dict[int, Any] = {}
        self._hint = pn.pane.HTML("", sizing_mode="stretch_width", margin=(2, 6))
        self._group = pmu.RadioButtonGroup(
            options=_GROUPS, value="palm", size="small", margin=(4, 2), sizing_mode="stretch_width",
            sx={"& .MuiToggleButton-root": {"textTransform": "none", "padding": "2px 4px", "flex": "1 1 0"}},
        )  # fmt: skip
        self._column = pmu.Column(sizing_mode="stretch_width", margin=0)
        self._group.param.watch(self._show_group, "value")
        self._buttons = {
            "fit": self._button("Fit from here", "auto_fix_high", posing.fit, "contained"),
            "undo": self._button("Undo pose", "undo", posing.undo),
            "suggest": self._button("Suggest a pose", "search", posing.suggest),
            "tracked": self._button("As tracked", "my_location", posing.take_tracked),
            "use": self._button("Use as first pose", "flag", posing.use, "contained"),
            "save": self._button("Save pose", "download", self._save),
        }
        names = list(self._buttons)
        rows = [
            pmu.Row(*(self._buttons[name] for name in names[at : at + 2]), sizing_mode="stretch_width", margin=0)
            for at in (0, 2, 4)
        ]
        self.panel = pmu.Column(
            *rows, self._hint, self._group, self._column, self.download, sizing_mode="stretch_width", margin=0
        )
        posing.param.watch(self._follow, ["placed", "explained", "told"])
        posing.state.param.watch(self._follow, ["task", "playing", "revision"])
        self._show_group()

    def _button(
        self, label: str, icon: str, act: Callable[[], Awaitable[None] | None], variant: str = "outlined"
    ) -> pmu.Button:
        async def clicked(_event: Any) -> None:
            done = act()
            if done is not None:
                await done

        return pmu.Button(
            label=label, icon=icon, size="small", variant=variant, margin=(3, 3), sizing_mode="stretch_width",
            on_click=clicked, sx={"whiteSpace": "nowrap"},
        )  # fmt: skip

    def _save(self) -> None:
        try:
            self.download.hand_over(*self._posing.file_of_pose())
        except SpfError as error:
            self._posing.state.error = str(error)

    # ---- sliders

    def _show_group(self, *_events: Any) -> None:
        """Make the sliders of the group chosen."""
        self._sliders = {entry: self._slider(entry) for entry in entries_of(self._group.value)}
        self._column.objects = list(self._sliders.values())
        self._follow()

    def _slider(self, entry: int) -> pmu.FloatSlider:
        low, high = _PALM_ENDS[entry] if entry < 6 else self._limits(entry)
        slider = pmu.FloatSlider(
            label=axis_label(entry), value=0.5 * (low + high), start=low, end=high, step=1.0 if entry < 6 else 0.5,
            format="0.0", size="small", sizing_mode="stretch_width", margin=(2, 16, 0, 12),
            description=_TURNS if 3 <= entry < 6 else "",
        )  # fmt: skip
        slider.param.watch(partial(self._moved, entry), "value")
        return slider

    def _limits(self, entry: int) -> tuple[float, float]:
        placed = self._posing.placed
        if placed is None:
            return -180.0, 180.0
        low, high = placed.hand.limits[entry] * in_units(entry)
        return round(float(low), 1), round(float(high), 1)

    def _moved(self, entry: int, event: Any) -> None:
        if not self._following and event.new is not None:
            self._posing.set_entry(entry, event.new / in_units(entry))

    def _follow(self, *_events: Any) -> None:
        posing, state = self._posing, self._posing.state
        placed = posing.placed
        self._following = True
        for entry, slider in self._sliders.items():
            if placed is None:
                continue
            low, high = _PALM_ENDS[entry] if entry < 6 else self._limits(entry)
            value = round(float(placed.stance.pose[entry]) * in_units(entry), 1)
            slider.param.update(start=min(low, value), end=max(high, value), value=value)
        self._following = False
        free = placed is not None and not state.busy
        for name, can in {
            "fit": free, "undo": posing.can_undo, "suggest": free, "tracked": posing.tracked is not None,
            "use": placed is not None, "save": placed is not None,
        }.items():  # fmt: skip
            self._buttons[name].disabled = not can
        self._hint.object = self._words()

    def _words(self) -> str:
        posing = self._posing
        if posing.placed is None:
            words = "The hand is placed when a session is open."
        elif posing.explained is None:
            words = "<b>Nothing is seen where the hand is.</b> Drag it over the hand; Shift and wheel sets its depth."
        else:
            golden, overlap = posing.explained
            words = (
                f"Frame {posing.state.frame}: silhouettes overlap by <b>{100 * overlap:.0f} %</b>, golden energy "
                f"<b>{golden:.2f}</b> (0 explains all)."
            )
        return facts(words, posing.told, name="pose-told")
