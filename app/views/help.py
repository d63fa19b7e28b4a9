"""The method, step by step, each beside the live picture of what it does in the frame shown."""

from __future__ import annotations

from typing import Any, NamedTuple

import panel as pn

from app.state import State
from app.views.depth import Depth
from app.views.grid import card, cards
from app.views.plots import heading
from app.views.scenes import PICTURES, SCENES
from app.views.three_d import ThreeD
from spf.render import Renderer

__all__ = ["STAGES", "Help", "Stage"]

_HEIGHT = 300
_WORDS = "font:14px/1.55 Roboto,sans-serif;padding:0 8px 8px;overflow:auto;height:100%;box-sizing:border-box"


class Stage(NamedTuple):
    """A stage of the method: its title, HTML of what it does and where to look, and the picture that shows it."""

    title: str
    words: str
    picture: str


STAGES = (
    Stage(
        "1 · Observe",
        "<p>The sensor gives a distance for every pixel. Around the place where the hand was, the surface that hangs together "
        "is cut out: it is in colour here, all else is grey. Its points are what the hand has to explain.</p>"
        "<p>The white skeleton is what the tracker found; the orange one, where the session has it, is the truth.</p>"
        "<p><b>To start</b>, choose a session on the left and press <b>Start</b>: the hand, its side and its size are found in "
        "the depth. Then <b>Step</b> or <b>Play</b>; the pictures here follow.</p>",
        "depth",
    ),
    Stage(
        "2 · Predict and propose",
        "<p>The filter believes in N hands at once, its <b>particles</b>: poses of 26 angles and lengths, each with a weight. "
        "Every frame they move as they moved before, with noise added (orange). Some are given a structured change, and one may "
        "come from a small network that looks at the depth.</p>"
        "<p>More particles (<b>N</b>) survive faster movement, and take more time.</p>",
        "particles",
    ),
    Stage(
        "3 · Optimise by Stochastic Meta-Descent",
        "<p>Each particle walks downhill on its own cost: how far its surface lies from the depth, how its normals differ "
        "(<b>k</b>), what it covers. Only some points are looked at in an iteration, and every angle has a step size of its own, "
        "which grows while the gradients agree and shrinks when they do not (<b>μ</b>).</p>"
        "<p>The paths of the wrist and the fingertips lead from orange to blue. Long paths that end in one place: the descent "
        "works. Paths that end in several places: several explanations, and it is good to have particles.</p>",
        "trajectories",
    ),
    Stage(
        "4 · Correct, weigh, estimate",
        "<p>Optimised particles no longer come from the prediction, so that their weights are corrected by "
        "c&nbsp;=&nbsp;f&nbsp;/&nbsp;g, densities that are estimated with a window <b>h</b>: the posterior stays Bayes' own. A "
        "small h trusts the predicted samples, a large one the optimised ones.</p>"
        "<p>The weighted mean is the estimate: the blue hand among the observed points. The <b>effective sample size</b> says "
        "how many particles carry the weight; 1 means that a single one does.</p>"
        "<p>When the estimate explains the depth much worse than usual for three frames, or the network sees no hand "
        "there, the hand counts as <b>lost</b> and is searched for in the whole picture.</p>",
        "reconstruction",
    ),
)


class Help:
    """The part of the page that is seen in the mode of help."""

    def __init__(self, state: State, renderer: Renderer) -> None:
        names = {name: f"Help: {title}" for name, title in PICTURES.items()}
        self.pictures = ThreeD(
            state, renderer, "help", names, lambda: dict.fromkeys(names, state.lane),
            lambda name, entry, *_shown: SCENES[name](entry, ()),
        )  # fmt: skip
        depth = Depth(state, self.pictures, "help")
        shown: dict[str, Any] = {"depth": depth.pane, **self.pictures.panes}
        titles = {"depth": "Depth", **PICTURES}
        rows = [
            cards(
                card(_words(stage), heading(stage.title), _HEIGHT, least_width=340),
                card(
                    shown[stage.picture],
                    heading(f"{titles[stage.picture]}, in the frame shown"),
                    _HEIGHT,
                    least_width=340,
                ),
            )
            for stage in STAGES
        ]
        self.panel = pn.Column(*rows, sizing_mode="stretch_width", margin=0)
        depth.draw()


def _words(stage: Stage) -> pn.pane.HTML:
    return pn.pane.HTML(f"<div tabindex='0' style='{_WORDS}'>{stage.words}</div>", sizing_mode="stretch_both", margin=0)
