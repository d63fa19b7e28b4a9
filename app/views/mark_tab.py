"""The tab in which joints are marked as truth: the picture to click on, the joints with what is known of each, what is kept."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, ClassVar

import numpy as np
import panel as pn
import panel_material_ui as pmu

from app.marking import Marking
from app.views.follower import Follower
from app.views.grid import card
from app.views.mark_controls import MarkControls
from app.views.overlay import focus_of, lines_of, picture_of
from app.views.plots import heading
from app.views.sheet import Sheet
from app.views.words import noted
from spf.errors import SessionError
from spf.frame import JOINT_NAMES
from spf.sessions.marks import joints_of_marks

__all__ = ["MarkTab"]

_HEIGHT = 620
_NOTE = (
    "Click: place the joint chosen. Drag: move it. Arrows: 1 pixel (with Shift ¼). [ ]: 1 mm nearer, farther. H: hidden. "
    "Delete: unset. , .: other joint. N: next frame. Enter: keep what is suggested. Wheel: zoom. Right button: move the "
    "picture. 0: all of it."
)
_ARROWS = {"ArrowLeft": (-1, 0), "ArrowRight": (1, 0), "ArrowUp": (0, -1), "ArrowDown": (0, 1)}
_FINE = 0.25  # pixels of an arrow with Shift
_MILLIMETRE = 0.001


class MarkTab(Follower):
    """The tab."""

    tab: ClassVar[str] = "marks"
    pictures: ClassVar[None] = None

    def __init__(self, marking: Marking) -> None:
        super().__init__(marking.state, also=("session", "frame"))
        self._marking = marking
        self._shown: tuple[str, int] | None = None  # recording and frame of the picture
        self._acts: dict[str, Callable[[], None]] = {
            "h": marking.hide, "H": marking.hide, "Delete": marking.unset, "Backspace": marking.unset, "n": marking.onward,
            "N": marking.onward, "Enter": marking.confirm, ",": lambda: self._other(-1), ".": lambda: self._other(1),
            "[": lambda: self._deeper(-_MILLIMETRE), "]": lambda: self._deeper(_MILLIMETRE),
        }  # fmt: skip
        self.sheet = Sheet(
            self._wish, alt="The depth image with the joints marked", hint="Choose a session to mark joints in it.", places=True,
            keys=[*_ARROWS, *self._acts], sizing_mode="stretch_both", margin=0,
        )  # fmt: skip
        self._controls = MarkControls(marking)
        keys = ("●", "#3f9e42", "marked"), ("○", "#3f9e42", "suggested, not kept")
        picture = pmu.Column(
            self.sheet, pn.pane.HTML(noted(_NOTE), margin=(2, 4, 0, 4), sizing_mode="stretch_width"), sizing_mode="stretch_both",
            margin=0,
        )  # fmt: skip
        self.panel = pn.Row(
            card(picture, heading("Joints over the depth", *keys), _HEIGHT, least_width=340),
            pmu.Column(self._controls.panel, width=300, margin=0, styles={"flex": "0 0 300px"}),
            sizing_mode="stretch_width", margin=(0, 8, 8, 8), styles={"gap": "8px"},
        )  # fmt: skip
        marking.param.watch(self._redraw, ["joints", "chosen"])
        self.draw()

    def draw(self) -> None:
        """Show the frame shown, with its marks."""
        state = self.state
        if state.session is None:
            return
        if self._shown != (state.session.uri, state.frame):
            try:
                camera = state.session.camera
                if self._shown is None or self._shown[0] != state.session.uri:
                    self.sheet.focus = focus_of(state.session, state.frame)
                self.sheet.param.update(
                    image=picture_of(state.session, state.frame), size=[camera.width, camera.height], hint=""
                )
            except SessionError as error:
                state.error = str(error)
                return
            self._shown = state.session.uri, state.frame
        self._redraw()

    def _redraw(self, *_events: Any) -> None:
        marking = self._marking
        if self.state.session is None:
            return
        joints = joints_of_marks({name: placing.mark for name, placing in marking.joints.items()})
        camera, handles = self.state.session.camera, []
        for name in reversed(JOINT_NAMES):
            at = marking.pixel_of(name)
            if at is not None:
                kind = "suggested" if marking.joints[name].suggested else "mark"
                handles.append(
                    {"name": name, "label": name.replace("_", " "), "u": at[0], "v": at[1], "kind": kind, "quiet": True}
                )
        lines = lines_of(np.asarray(joints), camera, "mark")
        with pn.io.hold():
            self.sheet.param.update(lines=lines, handles=handles, chosen=marking.chosen)
            self.sheet.echo += 1

    def _wish(self, wish: dict[str, Any]) -> None:
        marking, kind = self._marking, wish["kind"]
        if kind == "begin":
            marking.choose(wish["handle"])
        elif kind == "move":
            self.sheet.echo += 1  # the browser shows where it is; it is placed where it is dropped
        elif kind == "end" and wish["at"] != wish["start"]:
            marking.place(wish["at"][0], wish["at"][1], wish["handle"])
        elif kind == "place":
            marking.place(wish["at"][0], wish["at"][1])
        elif kind == "undo":
            marking.undo()
        elif kind == "key" and wish["key"] in _ARROWS:
            right, down = _ARROWS[wish["key"]]
            step = _FINE if wish["shift"] else 1.0
            marking.nudge(step * right, step * down)
        elif kind == "key":
            self._acts[wish["key"]]()

    def _other(self, steps: int) -> None:
        place = JOINT_NAMES.index(self._marking.chosen) + steps
        self._marking.choose(JOINT_NAMES[place % len(JOINT_NAMES)])

    def _deeper(self, metres: float) -> None:
        placing = self._marking.joints.get(self._marking.chosen)
        if placing is not None and placing.mark.point is not None:
            self._marking.deepen(metres)
