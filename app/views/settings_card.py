"""Tracker, preset and settings: four sliders, everything else folded away, and what differs from the preset."""

from __future__ import annotations

from functools import partial
from typing import Any

import panel as pn
import panel_material_ui as pmu

from app.state import State
from app.views.fold import folded
from spf.settings import SettingInfo
from spf.trackers import PRESETS, TRACKERS

__all__ = ["SettingsCard"]

#: Name → (heading, least, most, step) of the sliders: the part of the declared range that one usually wants.
SLIDERS: dict[str, tuple[str, float, float, float]] = {
    "k": ("normals against distances", 0.0, 10.0, 0.1),
    "mu": ("meta-step size", 0.0, 0.2, 0.005),
    "n": ("particles", 1, 32, 1),
    "h": ("window of the density", 0.1, 12.0, 0.1),
}


class SettingsCard:
    """The card."""

    def __init__(self, state: State) -> None:
        self._state = state
        tracker = pmu.Select.from_param(
            state.param.tracker, label="Tracker", options={t.title: t.name for t in TRACKERS.values()}, size="small",
            sizing_mode="stretch_width",
        )  # fmt: skip
        preset = pmu.Select.from_param(
            state.param.preset, label="Preset", options=list(PRESETS), size="small", width=120
        )
        self._infos = {info.name: info for row in TRACKERS.values() for info in row.settings.describe()}
        self._widgets: dict[str, Any] = {}
        for name in SLIDERS:
            self._add(name, _slider(self._infos[name]))
        self._hint = pn.pane.HTML("", sizing_mode="stretch_width", margin=(0, 10))
        self._back = pmu.Button(
            label="Back to the preset", icon="undo", variant="text", size="small", visible=False,
            on_click=lambda _event: state.back_to_preset(), margin=(0, 4),
        )  # fmt: skip
        state.param.watch(self._follow, "settings")
        self._follow()
        self.panel = pmu.Column(
            pmu.Row(tracker, preset, sizing_mode="stretch_width"), *(self._widgets[name] for name in SLIDERS),
            self._hint, self._back, folded("All other settings", self._others), sizing_mode="stretch_width",
        )  # fmt: skip

    def _add(self, name: str, widget: Any) -> Any:
        self._widgets[name] = widget
        widget.param.watch(partial(self._changed, name), "value")
        return widget

    def _others(self) -> list[Any]:
        """Return the fields of all other settings, under the headings of their groups."""
        groups: dict[str, list[Any]] = {}
        for name, info in self._infos.items():
            if name not in SLIDERS:
                groups.setdefault(info.group, []).append(self._add(name, _field(info)))
        self._follow()
        return [
            part
            for group, widgets in groups.items()
            for part in (pmu.Typography(group, variant="subtitle2", margin=(8, 10, 0, 10)), *widgets)
        ]

    def _changed(self, name: str, event: Any) -> None:
        value = event.new
        if value is None or not hasattr(self._state.settings, name) or value == getattr(self._state.settings, name):
            return
        self._state.change(name, value)

    def _follow(self, *_events: Any) -> None:
        settings = self._state.settings
        values = settings.to_dict()
        for name, widget in self._widgets.items():
            widget.disabled = name not in values
            if name in values and widget.value != values[name]:
                if name in SLIDERS:  # a preset may lie outside the usual part
                    _, least, most, _ = SLIDERS[name]
                    widget.param.update(start=min(least, values[name]), end=max(most, values[name]))
                widget.value = values[name]
        changed = self._state.differences
        self._back.visible = bool(changed)
        words = ", ".join(f"{name} {_short(was)} → {_short(now)}" for name, (was, now) in changed.items())
        style = "font:12px/1.4 Roboto,sans-serif;color:"
        self._hint.object = (
            f"<div style='{style}#8a4b00'>Differs from the preset: {words}</div>"
            if changed
            else f"<div style='{style}#5c6873'>As in the preset. A change takes effect with the next step.</div>"
        )


def _short(value: Any) -> str:
    return f"{value:g}" if isinstance(value, float) else str(value)


def _label(info: SettingInfo) -> str:
    words = info.name.replace("_", " ")
    name = f"{info.symbol} · {words}" if info.symbol and info.symbol != info.name else words
    return f"{name}, {info.unit}" if info.unit else name


def _slider(info: SettingInfo) -> Any:
    heading, least, most, step = SLIDERS[info.name]
    kind = pmu.IntSlider if info.kind is int else pmu.FloatSlider
    unit = f", {info.unit}" if info.unit else ""
    return kind(
        label=f"{info.symbol} · {heading}{unit}", value=info.default, start=info.kind(least), end=info.kind(most),
        step=info.kind(step), description=info.meaning, size="small",
        sizing_mode="stretch_width", margin=(4, 16, 0, 12),
    )  # fmt: skip


def _field(info: SettingInfo) -> Any:
    label, about = _label(info), info.meaning
    if info.kind is bool:
        return pmu.Checkbox(
            label=label, value=info.default, description=about, size="small", sizing_mode="stretch_width"
        )
    if info.kind is str:
        return pmu.Select(
            label=label, value=info.default, options=list(info.choices), description=about, size="small",
            sizing_mode="stretch_width",
        )  # fmt: skip
    kind = pmu.IntInput if info.kind is int else pmu.FloatInput
    return kind(
        label=label, value=info.default, start=info.low, end=info.high, description=about, size="small",
        sizing_mode="stretch_width",
    )  # fmt: skip
