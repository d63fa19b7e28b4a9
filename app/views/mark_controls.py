"""The 21 joints with what is known of each in the frame shown, the depth of the one chosen, and what is done with all marks."""

from __future__ import annotations

import math
from collections.abc import Awaitable, Callable
from typing import Any

import panel as pn
import panel_material_ui as pmu

from app.marking import Marking
from app.views.download import Download
from app.views.words import facts
from spf.errors import SpfError
from spf.frame import JOINT_NAMES
from spf.sessions.marks import count_marks

__all__ = ["MarkControls"]

_ROWS = ("wrist", "thumb", "index", "middle", "ring", "little")
_COLOURS = {"unset": "default", "marked": "success", "suggested": "warning", "hidden": "default"}
_SMALL = {"minWidth": "0", "textTransform": "none", "padding": "1px 4px"}


class MarkControls:
    """The column beside the picture."""

    def __init__(self, marking: Marking) -> None:
        self._marking, self._following = marking, False
        self.download = Download(width=0, height=0, margin=0)
        self._joints = {name: self._joint(name) for name in JOINT_NAMES}
        rows = [
            pmu.Row(
                pmu.Typography(row.capitalize(), variant="body2", width=52, margin=(6, 2, 0, 4)),
                *(button for name, button in self._joints.items() if name.startswith(row)), sizing_mode="stretch_width", margin=0,
            )
            for row in _ROWS
        ]  # fmt: skip
        number: dict[str, Any] = {"size": "small", "width": 136, "margin": (6, 4), "format": "0.0"}
        self._offset = pmu.FloatInput(
            label="Behind the surface, mm", value=0.0, start=-50.0, end=100.0, step=0.5, **number
        )
        self._depth = pmu.FloatInput(label="Depth, mm", value=0.0, start=0.0, end=20_000.0, step=1.0, **number)
        self._offset.param.watch(self._on_offset, "value")
        self._depth.param.watch(self._on_depth, "value")
        self._buttons = {
            "hidden": self._button("Hidden", "visibility_off", marking.hide),
            "unset": self._button("Unset", "backspace", marking.unset),
            "undo": self._button("Undo mark", "undo", marking.undo),
            "clear": self._button("Unset all", "layers_clear", marking.unset_all),
            "onward": self._button("Next frame with these", "skip_next", marking.onward, "contained"),
            "confirm": self._button("Keep suggested", "done_all", marking.confirm, "contained"),
            "export": self._button("Marks CSV", "download", self._export),
            "embed": self._button("Write into session", "save", marking.embed),
        }
        names = list(self._buttons)
        pairs = [
            pmu.Row(*(self._buttons[name] for name in names[at : at + 2]), sizing_mode="stretch_width", margin=0)
            for at in range(0, len(names), 2)
        ]
        self._chosen, self._kept = (pn.pane.HTML("", sizing_mode="stretch_width", margin=(2, 6)) for _ in range(2))
        self.panel = pmu.Column(
            *rows, self._chosen, pmu.Row(self._offset, self._depth, margin=0), *pairs, self._kept, self.download,
            sizing_mode="stretch_width", margin=0,
        )  # fmt: skip
        marking.param.watch(self._follow, ["joints", "chosen", "told"])
        marking.state.param.watch(self._follow, ["session", "frame", "task", "playing"])
        self._follow()

    def _joint(self, name: str) -> pmu.Button:
        label = name.rpartition("_")[2]
        button = pmu.Button(
            label=label, size="small", variant="outlined", margin=(2, 2), sizing_mode="stretch_width", sx=_SMALL
        )
        button.on_click(lambda _event: self._marking.choose(name))
        return button

    def _button(
        self, label: str, icon: str, act: Callable[[], Awaitable[None] | None], variant: str = "outlined"
    ) -> pmu.Button:
        async def clicked(_event: Any) -> None:
            done = act()
            if done is not None:
                await done

        return pmu.Button(
            label=label, icon=icon, size="small", variant=variant, margin=(3, 3), sizing_mode="stretch_width",
            on_click=clicked, sx={"whiteSpace": "nowrap", "padding": "3px 6px"},
        )  # fmt: skip

    def _export(self) -> None:
        try:
            self.download.hand_over(*self._marking.file_of_marks())
        except SpfError as error:
            self._marking.state.error = str(error)

    def _on_offset(self, event: Any) -> None:
        if not self._following and event.new is not None:
            self._marking.set_offset(event.new / 1000)

    def _on_depth(self, event: Any) -> None:
        if not self._following and event.new is not None:
            self._marking.set_depth(event.new / 1000)

    # ---- what is known

    def _state_of(self, name: str) -> str:
        placing = self._marking.joints.get(name)
        if placing is None:
            return "unset"
        if placing.suggested:
            return "suggested"
        return "hidden" if placing.mark.point is None else "marked"

    def _follow(self, *_events: Any) -> None:
        marking = self._marking
        states = {name: self._state_of(name) for name in JOINT_NAMES}
        for name, button in self._joints.items():
            known = states[name]
            button.param.update(
                button_type="primary" if name == marking.chosen else _COLOURS[known],
                variant="contained" if name == marking.chosen or known == "marked" else "outlined",
                icon={"hidden": "visibility_off", "suggested": "help"}.get(known) if name != marking.chosen else None,
            )
        placing = marking.joints.get(marking.chosen)
        point = None if placing is None else placing.mark.point
        self._following = True
        for field in (self._offset, self._depth):
            field.disabled = point is None
        if placing is not None and point is not None:
            self._offset.value = None if math.isnan(placing.mark.offset) else round(1000 * placing.mark.offset, 1)
            self._depth.value = round(1000 * point[2], 1)
        self._following = False
        some, suggested = bool(marking.joints), "suggested" in states.values()
        for name, can in {
            "hidden": True, "unset": marking.chosen in marking.joints, "undo": marking.can_undo, "clear": some, "onward": some,
            "confirm": suggested, "export": bool(marking.marks),
            "embed": marking.is_native and bool(marking.marks) and not marking.state.busy,
        }.items():  # fmt: skip
            self._buttons[name].disabled = not can or marking.state.session is None
        self._chosen.object = facts(self._about_chosen(states[marking.chosen]), marking.told, name="marks-told")
        self._kept.object = facts(self._about_all(), name="marks-told")

    def _about_chosen(self, known: str) -> str:
        marking = self._marking
        name = f"<b>{marking.chosen.replace('_', ' ')}</b>"
        placing = marking.joints.get(marking.chosen)
        if known == "unset" or placing is None:
            default = 1000 * marking.offset_of(marking.chosen)
            return f"{name}: click where it is. It is put {default:.1f} mm behind the surface seen there."
        if placing.mark.point is None:
            return f"{name}: hidden in this frame."
        at, depth = marking.pixel_of(marking.chosen), 1000 * placing.mark.point[2]
        assert at is not None
        behind = 1000 * placing.mark.offset
        how = "" if math.isnan(behind) else f" = surface {depth - behind:.1f} + {behind:.1f}"
        kept = " Not kept yet." if known == "suggested" else ""
        return f"{name}: pixel {at[0]:.1f}, {at[1]:.1f}, depth {depth:.1f} mm{how}.{kept}"

    def _about_all(self) -> str:
        frames, joints = count_marks(self._marking.marks)
        if not frames:
            return "No joint of this session is marked. What is marked is kept beside it at once, and is its truth."
        return f"In this session: {joints} joint{'s' * (joints != 1)} in {frames} frame{'s' * (frames != 1)}, kept."
