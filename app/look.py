"""How a visitor looks at what was tracked: which part of the page, which particles, which layers, from where."""

from __future__ import annotations

from typing import NamedTuple

import param

from spf.render import ViewCamera

__all__ = ["COLOURINGS", "DENSITIES", "LAYERS", "TABS", "Look", "Shown"]

#: Parts of the page of one tracker, by the words of the page.
TABS = {
    "Overview": "overview", "What the filter thinks": "particles", "3-D scene": "scene", "Pose the hand": "pose",
    "Mark joints": "marks",
}  # fmt: skip

#: Layers of the scene, by the words of the page.
LAYERS = {
    "Points": "points", "Predicted": "predicted", "Optimised": "optimised", "Paths": "paths", "Hand": "hand",
    "Residuals": "residuals",
}  # fmt: skip

#: What the colours of particles say, by the words of the page.
COLOURINGS = {"before / after": "stage", "weight": "weight", "cost E": "cost", "distance": "distance"}

#: Kernel density estimates (27), (28), (31), by the words of the page.
DENSITIES = {"f": "f", "f⁺": "f_plus", "g": "g"}


class Shown(NamedTuple):
    """What the 3-D pictures show of a frame; see :class:`Look`."""

    layers: tuple[str, ...]
    colouring: str
    selected: tuple[int, ...]


class Look(param.Parameterized):
    """What all views of a page have in common, besides the frame."""

    tab: str = param.Selector(default="overview", objects=list(TABS.values()))
    selected: tuple[int, ...] = param.ClassSelector(class_=tuple, default=(), doc="particles picked out; () for all")

    across: int = param.Integer(5, bounds=(0, 29), doc="entry of a pose along the horizontal axis")
    upwards: int = param.Integer(0, bounds=(0, 29), doc="entry of a pose along the vertical axis")
    densities: list[str] = param.ListSelector(default=["f", "f_plus"], objects=list(DENSITIES.values()))

    layers: list[str] = param.ListSelector(
        default=["points", "predicted", "optimised", "paths"], objects=list(LAYERS.values())
    )
    colouring: str = param.Selector(default="stage", objects=list(COLOURINGS.values()))
    pan: tuple[float, float] = param.Tuple((0.0, 0.0), doc="m that the eye is moved to the right and up in the picture")
    anchor: ViewCamera | None = param.ClassSelector(
        class_=ViewCamera, doc="where the eye stays whatever the hand does; None to follow the hand"
    )

    @property
    def shown(self) -> Shown:
        """What the 3-D pictures show."""
        return Shown(tuple(self.layers), self.colouring, self.selected)

    def picked(self, count: int) -> list[int]:
        """Return the particles picked out of ``count``; [] when there are none, which stands for all."""
        return [index for index in self.selected if index < count]
