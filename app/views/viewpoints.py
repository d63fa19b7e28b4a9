"""Where the 3-D pictures are seen from: the sensor, the palm's front, the side, the top; following the hand or not."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import panel_material_ui as pmu

from app.results import Entry
from app.state import State
from app.views.scenes import hand_view
from spf.hand.kinematics import rotation_about

__all__ = ["VIEWS", "palm_view", "viewpoints"]

_RIGHT = math.pi / 2


def palm_view(entry: Entry) -> tuple[float, float]:
    """Return azimuth and elevation, rad, from which the palm's inner side is seen."""
    result = entry.result
    palm = rotation_about(result.pose[3:6]) @ result.reference
    towards_fingers = result.joints[9] - result.joints[0]
    outward = np.cross(-palm[:, 0], towards_fingers)  # where fingertips go when fingers bend, about −x
    right, down, forward = hand_view(entry).axes()
    outward = outward / np.linalg.norm(outward)
    return math.atan2(outward @ right, -(outward @ forward)), math.asin(max(-1.0, min(1.0, -(outward @ down))))


#: Name → (what it is, azimuth and elevation of an entry, rad).
VIEWS: dict[str, tuple[str, Callable[[Entry], tuple[float, float]]]] = {
    "Sensor": ("from where the sensor is", lambda _entry: (0.0, 0.0)),
    "Front": ("onto the palm", palm_view),
    "Side": ("from the sensor's right", lambda _entry: (_RIGHT, 0.0)),
    "Top": ("from above", lambda _entry: (0.0, _RIGHT)),
}


def viewpoints(state: State) -> pmu.Row:
    """Return the buttons of the views and the switch that follows the hand."""

    def button(name: str) -> pmu.Button:
        words, angles = VIEWS[name]

        def look(_event: Any) -> None:
            if state.entry is not None:
                azimuth, elevation = angles(state.entry)
                state.param.update(azimuth=azimuth, elevation=elevation)
                state.look.pan = (0.0, 0.0)

        return pmu.Button(
            label=name, description=_in_one_line(f"{name}: {words}"), variant="text", color="default", size="small",
            margin=(0, 2), on_click=look, sx={"minWidth": "0", "textTransform": "none"},
        )  # fmt: skip

    follow = pmu.Switch(
        label="Follow", value=state.look.anchor is None, size="small", margin=(0, 6), align="center",
        sx={"& .MuiFormControlLabel-label": {"fontSize": "13px"}},
    )  # fmt: skip

    def toggle(event: Any) -> None:
        if event.new == (state.look.anchor is None):
            return  # it follows
        entry = state.entry
        state.look.anchor = None if event.new or entry is None else hand_view(entry)

    follow.param.watch(toggle, "value")
    state.look.param.watch(lambda event: follow.param.update(value=event.new is None), "anchor")
    return pmu.Row(_picked(state), *(button(name) for name in VIEWS), follow, margin=0, align="center")


def _in_one_line(text: str) -> str:
    """A description that is not broken into lines as narrow as the button."""
    return text.replace(" ", "\N{NO-BREAK SPACE}")


def _picked(state: State) -> pmu.Button:
    """Return a button that says how many particles are picked, and shows all again."""
    look = state.look
    every = pmu.Button(
        label="",
        icon="close",
        variant="outlined",
        size="small",
        margin=(0, 8),
        visible=False,
        sx={"textTransform": "none"},
    )

    def count(_event: Any) -> None:
        some = len(look.selected)
        every.param.update(label=f"{some} particle{'s' * (some != 1)} picked: show all", visible=some > 0)

    every.on_click(lambda _event: look.param.update(selected=()))
    look.param.watch(count, "selected")
    return every
