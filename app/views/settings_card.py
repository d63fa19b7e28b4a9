"""Tracker, preset and settings of the chosen lane: four sliders, all else folded away, and what differs from the preset."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any

import panel as pn
import panel_material_ui as pmu

from app.state import State
from app.views.fold import folded
from spf.errors import SettingError
from spf.presets import Presets
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

_AS_IT_IS = "As in the preset. A change is for the frames tracked from now on."


class SettingsCard:
    """The card; its fields are those that the tracker declares."""

    def __init__(self, state: State, presets: Presets | None = None) -> None:
        self._state, self._presets = state, presets or Presets()
        options: dict[str, Any] = {"size": "small", "sizing_mode": "stretch_width"}
        self._tracker = pmu.Select(label="Tracker", options={t.title: t.name for t in TRACKERS.values()}, **options)
        self._preset = pmu.Select(label="Preset", options=self._presets.names(state.lane.tracker), **options)
        self._infos: dict[str, SettingInfo] = {}
        self._fields: dict[str, Any] = {}
        self._made_for = ""
        self._sliders = pmu.Column(sizing_mode="stretch_width", margin=0)
        self._others = pmu.Column(sizing_mode="stretch_width", margin=0)
        self._unfolded = False
        self._hint = pn.pane.HTML("", sizing_mode="stretch_width", margin=(0, 10))
        small: dict[str, Any] = {"variant": "text", "size": "small", "margin": (0, 4)}
        self._undo = pmu.Button(label="Undo", icon="undo", on_click=lambda _event: state.lane.undo(), **small)
        self._back = pmu.Button(
            label="Back to the preset", icon="settings_backup_restore", visible=False,
            on_click=lambda _event: state.lane.back_to_preset(), **small,
        )  # fmt: skip
        self._name = pmu.TextInput(label="Name of a new preset", size="small", sizing_mode="stretch_width")
        save = pmu.Button(label="Save", icon="save", size="small", on_click=self._save, margin=(10, 10))
        self._asked = ""  # preset that was asked to be deleted once
        self._delete = pmu.Button(
            label="", icon="delete", size="small", variant="outlined", margin=(3, 10), visible=False,
            on_click=self._on_delete,
        )  # fmt: skip
        self._tracker.param.watch(self._picked("tracker"), "value")
        self._preset.param.watch(self._picked("preset"), "value")
        state.param.watch(self._follow, ["rules", "lane"])
        self._follow()
        self.panel = pmu.Column(
            self._tracker, self._preset, self._sliders, self._hint,
            pmu.Row(self._undo, self._back, margin=0),
            folded("All other settings", self._unfold),
            folded("Save as a preset", lambda: [pmu.Row(self._name, save, sizing_mode="stretch_width", margin=0)]),
            self._delete,
            sizing_mode="stretch_width",
        )  # fmt: skip

    def _picked(self, name: str) -> Callable[[Any], None]:
        def picked(event: Any) -> None:
            if event.new is None or event.new == getattr(self._state.lane, name):
                return
            lane = self._state.lane
            try:
                if name == "preset":
                    self._presets.settings(lane.tracker, event.new)  # one that is damaged is not taken
                setattr(lane, name, event.new)
            except SettingError as error:
                self._state.error = str(error)
                self._state.rules += 1  # puts the list back

        return picked

    def _save(self, _event: Any) -> None:
        lane, name = self._state.lane, (self._name.value_input or self._name.value).strip()
        try:
            self._presets.save(lane.tracker, name, lane.settings)
            lane.preset = name
            self._state.error = ""
        except SettingError as error:
            self._state.error = str(error)

    def _on_delete(self, _event: Any) -> None:
        lane = self._state.lane
        if self._asked != lane.preset:
            self._asked = lane.preset
            self._delete.param.update(label="Really delete?", color="error")
            return
        name = lane.preset
        try:
            self._presets.delete(lane.tracker, name)
        except SettingError as error:
            self._state.error = str(error)
            return
        for other in self._state.lanes:
            if (other.tracker, other.preset) == (lane.tracker, name):
                other.without_preset()

    def _unfold(self) -> list[Any]:
        self._unfolded = True
        self._make_others()
        return [self._others]

    def _make(self) -> None:
        """Make the fields of the chosen tracker's settings, those that are folded away only once they were asked for."""
        lane = self._state.lane
        infos = self._infos = {info.name: info for info in lane.settings.describe()}
        values = lane.settings.to_dict()
        self._made_for, self._fields = lane.tracker, {}
        self._sliders.objects = [
            self._add(name, _slider(infos[name], values[name])) for name in SLIDERS if name in infos
        ]
        self._make_others()

    def _make_others(self) -> None:
        infos, values, groups = self._infos, self._state.lane.settings.to_dict(), dict[str, list[Any]]()
        for name, info in infos.items():
            if self._unfolded and name not in SLIDERS:
                groups.setdefault(info.group, []).append(self._add(name, _field(info, values[name])))
        self._others.objects = [
            part
            for group, fields in groups.items()
            for part in (pmu.Typography(group, variant="subtitle2", margin=(8, 10, 0, 10)), *fields)
        ]

    def _add(self, name: str, field: Any) -> Any:
        self._fields[name] = field
        field.param.watch(partial(self._changed, name), "value")
        return field

    def _changed(self, name: str, event: Any) -> None:
        settings = self._state.lane.settings
        if event.obj is not self._fields.get(name) or event.new is None or event.new == getattr(settings, name):
            return  # a field of another tracker, or one that follows
        self._state.change(name, event.new)

    def _follow(self, *_events: Any) -> None:
        lane = self._state.lane
        self._tracker.value = lane.tracker
        names = self._presets.names(lane.tracker)
        self._preset.param.update(options=list(dict.fromkeys([*names, lane.preset])), value=lane.preset)
        self._asked = ""
        self._delete.param.update(
            label=f"Delete the preset {lane.preset}", color="default", visible=lane.preset in names[len(PRESETS) :]
        )
        self._undo.disabled = not lane.can_undo
        if self._made_for != lane.tracker:
            self._make()
        values = lane.settings.to_dict()
        for name, field in self._fields.items():
            if field.value != values[name]:
                if name in SLIDERS:
                    field.param.update(**_ends(self._infos[name], values[name]))
                field.value = values[name]
        changed = lane.differences
        self._back.visible = bool(changed)
        called = lane.settings.called()
        words = ", ".join(f"{called[name]} {_short(was)} → {_short(now)}" for name, (was, now) in changed.items())
        style = "font:12px/1.4 Roboto,sans-serif;color:"
        self._hint.object = (
            f"<div style='{style}var(--warning-text-color,#8a4b00)'>Differs from the preset: {words}</div>"
            if changed
            else f"<div style='{style}var(--panel-on-background-color,#5c6873);opacity:0.8'>{_AS_IT_IS}</div>"
        )


def _short(value: Any) -> str:
    return f"{value:g}" if isinstance(value, float) else str(value)


def _label(info: SettingInfo) -> str:
    words = info.name.replace("_", " ")
    name = f"{info.symbol} · {words}" if info.symbol and info.symbol != info.name else words
    return f"{name}, {info.unit}" if info.unit else name


def _described(info: SettingInfo) -> str:
    """Its meaning, range, unit and default."""
    default = _short(info.default) if info.kind is not bool else ("on" if info.default else "off")
    parts = [f"{info.meaning[0].upper()}{info.meaning[1:]}."]
    if info.low is not None and info.high is not None:
        parts.append(f"From {info.low:g} to {info.high:g}{' ' + info.unit if info.unit else ''}.")
    return " ".join([*parts, f"By default {default}; --set {info.name}=…"])


def _ends(info: SettingInfo, value: float) -> dict[str, float]:
    """Ends of a slider: the usual part of the range, widened for a tracker that wants more, and to hold the value."""
    _, least, most, _ = SLIDERS[info.name]
    high = most if info.default <= most else 2 * info.default
    low, high = min(least, value), max(high, value)
    return {
        "start": info.kind(low if info.low is None else max(low, info.low)),
        "end": info.kind(high if info.high is None else min(high, info.high)),
    }


def _slider(info: SettingInfo, value: Any) -> Any:
    heading, _, _, step = SLIDERS[info.name]
    kind = pmu.IntSlider if info.kind is int else pmu.FloatSlider
    unit = f", {info.unit}" if info.unit else ""
    return kind(
        label=f"{info.symbol or info.name} · {heading}{unit}", value=value, step=info.kind(step),
        description=_described(info), size="small", sizing_mode="stretch_width", margin=(4, 16, 0, 12), **_ends(info, value),
    )  # fmt: skip


def _field(info: SettingInfo, value: Any) -> Any:
    options: dict[str, Any] = {
        "label": _label(info), "value": value, "description": _described(info), "size": "small",
        "sizing_mode": "stretch_width",
    }  # fmt: skip
    if info.kind is bool:
        return pmu.Checkbox(**options)
    if info.kind is str:
        return pmu.Select(options=list(info.choices), **options)
    kind = pmu.IntInput if info.kind is int else pmu.FloatInput
    return kind(start=info.low, end=info.high, **options)
