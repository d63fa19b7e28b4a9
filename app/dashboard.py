"""The layout of the page, and what belongs to one visitor."""

from __future__ import annotations

from typing import Any

import panel as pn
import panel_material_ui as pmu
import param

from app.controller import Controller
from app.runner import Runner
from app.server import bundled, open_shared, renderer
from app.state import State
from app.uploads import Uploads
from app.views.costs import Costs
from app.views.depth import Depth
from app.views.errors import JointErrors
from app.views.ess import EffectiveSamples
from app.views.fit import Fit
from app.views.messages import Messages
from app.views.plots import BEFORE, heading
from app.views.scenes import PICTURES
from app.views.session_card import SessionCard
from app.views.settings_card import SettingsCard
from app.views.start_card import StartCard
from app.views.three_d import ThreeD
from app.views.transport import Transport
from app.views.weights import Weights

__all__ = ["page"]

_TITLE = "Smart Particle Filter"
_THEME = {"palette": {"primary": {"main": "#1f4e79"}}, "typography": {"fontSize": 13}}
_PICTURE_HEIGHT, _PLOT_HEIGHT = 268, 196


def page() -> pmu.Page:
    """Build the page of one visitor."""
    pn.extension()
    state, samples, uploads = State(), bundled(), Uploads()
    three_d = ThreeD(state, renderer())
    controller = Controller(state, Runner(), open_shared, three_d.drawn)
    session = SessionCard(state, controller.open, samples, uploads)
    start, settings = StartCard(state, controller.start), SettingsCard(state)
    main = [
        Transport(state, controller).panel,
        Messages(state, controller.cancel).panel,
        _grid(state, three_d),
    ]
    sidebar = [
        session.panel, pmu.Divider(margin=(2, 10)), start.panel, pmu.Divider(margin=(2, 10)), settings.panel,
    ]  # fmt: skip

    async def first() -> None:
        three_d.request()
        if samples:
            await controller.open(next(iter(samples.values())))

    def gone(_context: Any) -> None:
        controller.close()
        uploads.close()

    pn.state.onload(first)
    pn.state.on_session_destroyed(gone)
    built = pmu.Page(
        title=_TITLE, main=main, sidebar=sidebar, sidebar_width=330, sidebar_resizable=False, theme_toggle=False,
        theme_config=_THEME, busy_indicator=None,
    )  # fmt: skip
    with param.edit_constant(built):
        built.busy = False  # it follows every message otherwise, and the browser lays the whole page out anew each time
    return built


def _grid(state: State, three_d: ThreeD) -> pmu.Column:
    """Three rows of three: the pictures; the depth image and this frame's particles; the plots over the frames."""
    depth = Depth(state)
    truth = pmu.Switch.from_param(
        state.param.with_truth, label="Truth", description="", size="small", margin=(0, 4), align="center"
    )
    pictures = [_framed(three_d.panes[name], heading(title), _PICTURE_HEIGHT) for name, title in PICTURES.items()]
    keys = ("●", "white", "estimate"), ("●", BEFORE, "truth")
    now = [
        _framed(depth.pane, heading("Depth", *keys), _PICTURE_HEIGHT, truth),
        *(_framed(plot.pane, plot.heading, _PICTURE_HEIGHT) for plot in (Costs(state), Weights(state))),
    ]
    over = (JointErrors(state), EffectiveSamples(state), Fit(state))
    frames = [_framed(plot.pane, plot.heading, _PLOT_HEIGHT) for plot in over]
    rows = [pmu.Row(*row, sizing_mode="stretch_width", margin=0) for row in (pictures, now, frames)]
    return pmu.Column(*rows, sizing_mode="stretch_width", margin=(0, 6))


def _framed(pane: Any, head: Any, height: int, *tools: Any) -> pmu.Paper:
    """Return a pane in a card of a height, under a heading."""
    words = pn.pane.HTML(head, margin=(2, 4), sizing_mode="stretch_width") if isinstance(head, str) else head
    return pmu.Paper(
        pmu.Row(words, *tools, sizing_mode="stretch_width", margin=0, height=28), pane,
        sizing_mode="stretch_width", height=height, margin=4, elevation=0, variant="outlined",
        sx={"p": "4px", "overflow": "hidden"},
    )  # fmt: skip
