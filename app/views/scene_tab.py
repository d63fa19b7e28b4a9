"""One large 3-D picture with layers: particles, paths, the hand, the points; what the colours say stands above it."""

from __future__ import annotations

from typing import Any

import panel as pn
import panel_material_ui as pmu

from app.look import COLOURINGS, LAYERS
from app.state import State
from app.views.follower import Follower
from app.views.grid import card, cards
from app.views.layers import SCALE_COLOURS, Scale, layered, scale_of
from app.views.plots import AFTER, BEFORE, css, heading
from app.views.three_d import ThreeD
from spf.render import Renderer
from spf.render.palette import OBSERVED, RESIDUAL
from spf.render.scenes import RESIDUAL_FULL

__all__ = ["SceneTab", "scene_card"]

_HEIGHT = 620
_SIZES = (640, 480), (1120, 840)


class Key(Follower):
    """What the colours of the scene stand for."""

    def __init__(self, state: State, tab: str) -> None:
        self.tab = tab  # type: ignore[misc]  # the scene is seen in two tabs
        super().__init__(state, look=("layers", "colouring"))
        self.pane = pn.pane.HTML("", margin=(2, 4), sizing_mode="stretch_width")

    def draw(self) -> None:
        """Say it for the frame shown."""
        look, entry = self.state.look, self.state.entry
        keys: list[tuple[str, str, str]] = []
        scale = None if entry is None else scale_of(entry, look.colouring)
        if scale is None:
            keys = [("■", BEFORE, "predicted"), ("■", AFTER, "optimised")]
        words = heading("Scene", *keys)[: -len("</div>")]
        if scale is not None:
            words += _bar(scale, SCALE_COLOURS[::24])
        if "residuals" in look.layers:
            ends = css(OBSERVED), css(RESIDUAL)
            words += _bar(Scale("point to hand", 0, 1000 * RESIDUAL_FULL, "mm"), ends)
        self.pane.object = words + "</div>"


def _bar(scale: Scale, colours: tuple[str, ...]) -> str:
    """HTML of a colour bar with its ends."""
    numbers = [f"{end:.3g}" for end in (scale.low, scale.high)]
    return (
        f"<span style='font-weight:400;font-size:12px;margin-left:12px'>{scale.title} {numbers[0]} "
        f"<span style='display:inline-block;width:70px;height:9px;border:1px solid #8a949e;"
        f"background:linear-gradient(90deg,{','.join(colours)})'></span> {numbers[1]} {scale.unit}</span>"
    )


def scene_card(state: State, renderer: Renderer, tab: str, height: int) -> tuple[ThreeD, Any]:
    """Return the pictures and the card of the scene in a tab."""
    pictures = ThreeD(
        state, renderer, "one", {"scene": "Scene"}, lambda: {"scene": state.lane},
        lambda _name, entry, shown: layered(entry, shown), tab=tab, sizes=_SIZES,
    )  # fmt: skip
    look, key = state.look, Key(state, tab)
    key.draw()
    layers = pmu.CheckButtonGroup.from_param(
        look.param.layers, name="", options=LAYERS, size="small", margin=(4, 4),
        sx={"& .MuiToggleButton-root": {"textTransform": "none", "padding": "2px 6px"}},
    )  # fmt: skip
    colouring = pmu.Select.from_param(
        look.param.colouring, label="Colour by", options=COLOURINGS, size="small", margin=(4, 4), width=150
    )
    content = pn.Column(
        pn.FlexBox(layers, colouring, sizing_mode="stretch_width", margin=0), pictures.panes["scene"],
        sizing_mode="stretch_both", margin=0,
    )  # fmt: skip
    return pictures, card(content, key.pane, height, least_width=420)


class SceneTab:
    """The tab."""

    def __init__(self, state: State, renderer: Renderer) -> None:
        self.pictures, shown = scene_card(state, renderer, "scene", _HEIGHT)
        self.panel = cards(shown)
