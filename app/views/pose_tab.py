"""The tab in which a hand is posed over the depth: handles on the picture, sliders and the hand's shape beside it."""

from __future__ import annotations

import asyncio
from typing import Any, ClassVar

import panel as pn
import panel_material_ui as pmu

from app.placed import pixels_of
from app.posing import Posing
from app.views.follower import Follower
from app.views.grid import card
from app.views.overlay import BEHIND, IN_FRONT, focus_of, overlay_of, picture_of
from app.views.plots import heading
from app.views.pose_controls import PoseControls
from app.views.shape_controls import ShapeControls
from app.views.sheet import Sheet
from app.views.words import noted
from spf.errors import SessionError
from spf.hand.handles import HANDLES

__all__ = ["PoseTab"]

_HEIGHT = 620
_STEP = 0.005  # m that a turn of the wheel with Shift moves the hand
_NOTE = "Drag a handle. Wheel: zoom; with Shift: nearer, farther. Right button: move the picture. Ctrl Z: undo, 0: all of it."
_LABELS = {"palm": "move", "wrist": "turn", "knuckle": "tilt"}
_KINDS = {"palm": "move", "wrist": "turn", "knuckle": "turn"}


class PoseTab(Follower):
    """The tab."""

    tab: ClassVar[str] = "pose"
    pictures: ClassVar[None] = None

    def __init__(self, posing: Posing) -> None:
        super().__init__(posing.state, also=("session", "task"))
        self._posing = posing
        self._shown: tuple[str, int] | None = None  # recording and frame of the picture
        self.sheet = Sheet(
            self._wish, alt="The hand over the depth image", hint="Choose a session to pose a hand in it.",
            sizing_mode="stretch_both", margin=0,
        )  # fmt: skip
        self._controls, self._shape = PoseControls(posing), ShapeControls(posing)
        keys = ("■", f"rgb{IN_FRONT}", "in front"), ("■", f"rgb{BEHIND}", "behind the surface")
        picture = pmu.Column(
            self.sheet, pn.pane.HTML(noted(_NOTE), margin=(2, 4, 0, 4), sizing_mode="stretch_width"), sizing_mode="stretch_both",
            margin=0,
        )  # fmt: skip
        self.panel = pn.Row(
            card(picture, heading("The hand over the depth", *keys), _HEIGHT, least_width=340),
            pmu.Column(self._controls.panel, self._shape.panel, width=300, margin=0, styles={"flex": "0 0 300px"}),
            sizing_mode="stretch_width", margin=(0, 8, 8, 8), styles={"gap": "8px"},
        )  # fmt: skip
        posing.param.watch(self._redraw, ["placed", "compared"])
        self.draw()

    def draw(self) -> None:
        """Show the frame shown, with the hand that is posed."""
        state, posing = self.state, self._posing
        if state.session is None:
            return
        if posing.placed is None:
            asyncio.get_running_loop().create_task(posing.begin())
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
            posing.judge()
        self._redraw()

    def _redraw(self, *_events: Any) -> None:
        placed = self._posing.placed
        if placed is None:
            self.sheet.param.update(lines=[], handles=[], tint=b"")
            return
        frame = self._posing.seen()
        over = overlay_of(placed.hand, placed.stance, frame)
        before = self._posing.compared
        lines = over.lines
        if before is not None:
            dashed = overlay_of(before.hand, before.stance, frame).lines
            lines = [{**line, "kind": "before"} for line in dashed if line["kind"] == "outline"] + lines
        pixels = pixels_of(placed, frame)
        handles = [
            {
                "name": name, "u": pixels[name][0], "v": pixels[name][1], "kind": _KINDS.get(name, "tip"),
                "label": _LABELS.get(name, name.removesuffix("_tip")), "quiet": name not in _LABELS,
            }
            for name in reversed(HANDLES)
        ]  # fmt: skip
        with pn.io.hold():
            self.sheet.param.update(lines=lines, handles=handles, tint=over.tint, tint_box=over.box)
            self.sheet.echo += 1

    def _wish(self, wish: dict[str, Any]) -> None:
        posing, kind = self._posing, wish["kind"]
        if kind == "begin":
            posing.begin_drag()
        elif kind == "move":
            posing.drag(wish["handle"], wish["start"], wish["at"])
        elif kind == "end":
            if wish["at"] != wish["start"]:
                posing.drag(wish["handle"], wish["start"], wish["at"])
            posing.judge()
        elif kind == "push":
            posing.push(_STEP * wish["steps"])
        elif kind == "undo":
            posing.undo()
