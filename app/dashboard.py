"""The layout of the page, and what belongs to one visitor."""

from __future__ import annotations

import asyncio
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import panel as pn
import panel_material_ui as pmu
import param

from app.address import Address, follow_in, place_of
from app.controller import Controller
from app.folders import SAMPLES, allowed
from app.keeper import Keeper
from app.marking import Marking
from app.posing import Posing
from app.preview import Previewer
from app.reruns import Reruns
from app.runner import Runner
from app.server import bundled, kernels, open_shared, renderer
from app.shelf import Shelf
from app.state import State
from app.uploads import Uploads
from app.views.again_card import AgainCard
from app.views.export_card import ExportCard
from app.views.fold import folded
from app.views.landscape import LandscapeCard
from app.views.lanes_card import LanesCard
from app.views.live_card import LiveCard
from app.views.mark_tab import MarkTab
from app.views.messages import Messages
from app.views.modes import Modes
from app.views.names import Names
from app.views.pose_tab import PoseTab
from app.views.runs_card import RunsCard
from app.views.session_card import SessionCard
from app.views.settings_card import SettingsCard
from app.views.start_card import StartCard
from app.views.status import Status
from app.views.tour import Tour
from app.views.transport import Transport
from spf.presets import Presets

__all__ = ["page"]

_TITLE = "Smart Particle Filter"
_BLUE, _LIGHT_BLUE = "#1f4e79", "#8ab8e0"  # links and sliders have to be seen on a light and on a dark page


def _theme(primary: str) -> dict[str, Any]:
    return {
        "palette": {"primary": {"main": primary}},
        "typography": {"fontSize": 13},
        "components": {
            "MuiToolbar": {"styleOverrides": {"root": {"minHeight": "48px !important"}}},
            # The buttons of numbers are as dark as in a light page otherwise.
            "MuiInputAdornment": {"styleOverrides": {"root": {"& .MuiIconButton-root": {"color": "inherit"}}}},
            "MuiAppBar": {
                "styleOverrides": {
                    "root": {
                        "backgroundColor": f"{_BLUE} !important",
                        "color": "white",
                        "& .MuiTypography-root": {"whiteSpace": "nowrap"},
                        "& .MuiToolbar-root > .MuiBox-root:last-of-type": {"minWidth": 0},
                        "@media (max-width: 899px)": {"& .title": {"display": "none"}},
                    }
                }
            },
        },
    }


_THEME = {"light": _theme(_BLUE), "dark": _theme(_LIGHT_BLUE)}
_LOOK = 0.5  # s between two looks at the server's kernels


def page() -> pmu.Page:
    """Build the page of one visitor."""
    pn.extension("tabulator")
    state, samples, uploads = State(), bundled(), Uploads()
    modes = Modes(state, renderer())
    shelf, presets = Shelf(), Presets()
    controller = Controller(state, Runner(), open_shared, modes.drawn, kernels().wait, Keeper(state, shelf), allowed)
    reruns, previewer = Reruns(controller, shelf), Previewer(state)
    posing = Posing(controller, shelf.folder)
    marking = Marking(controller)
    modes.detail.offer("pose", lambda: PoseTab(posing))
    modes.detail.offer("marks", lambda: MarkTab(marking))
    address = Address(state, controller, reruns, samples)
    session = SessionCard(state, controller.open, samples, uploads)
    lanes, settings = LanesCard(state, controller), SettingsCard(state, presets)
    again, landscape = AgainCard(state, reruns), LandscapeCard(state)
    runs = folded("Runs", lambda: [RunsCard(state, shelf, reruns).panel])
    export = folded("Export", lambda: [ExportCard(state, controller, renderer(), shelf.folder).panel])
    start = StartCard(state, controller.start)
    transport = Transport(state, controller)
    parts = {
        "session": session.panel, "start": start.panel, "transport": transport.panel, "settings": settings.panel,
        "export": export,
    }  # fmt: skip
    tour = Tour(parts, width=0, height=0, margin=0)
    again_tour = pmu.Button(
        label="Tour", icon="explore", size="small", variant="text", color="default", margin=(8, 4),
        sx={"color": "white", "@media (max-width: 639px)": {"display": "none"}},
        on_click=lambda _event: tour.begin(),
    )  # fmt: skip
    live = LiveCard(state, controller.open, SAMPLES, kernels().wait)
    live.replaces(transport.panel, modes.panel)
    main = [
        transport.panel, Messages(state).panel, live.view, modes.panel, tour, modes.scroll,
        Names(width=0, height=0, margin=0),
    ]  # fmt: skip
    line = {"margin": (2, 10)}
    sidebar = [
        session.panel, folded("Live sensor", lambda: [live.panel]), pmu.Divider(**line), start.panel,
        pmu.Divider(**line), lanes.panel, settings.panel,
        landscape.panel, again.panel, pmu.Divider(**line), runs, export,
    ]  # fmt: skip

    async def first() -> None:
        modes.pictures.request()
        location = pn.state.location
        await address.go(place_of({} if location is None else location.query_params))
        if location is not None:
            follow_in(location, state, address)
        while progress := kernels().progress:
            state.preparing = progress
            await asyncio.sleep(_LOOK)
        state.preparing = ""

    def gone(_context: Any) -> None:
        controller.close()
        previewer.close()
        live.close()
        uploads.close()

    pn.state.onload(first)
    pn.state.on_session_destroyed(gone)
    with _unfollowed("busy"):
        built = pmu.Page(
            title=_TITLE, header=[modes.switch(controller.show_mode), again_tour, Status(state, reruns.cancel).panel],
            main=main, sidebar=sidebar, sidebar_width=330, sidebar_resizable=False, theme_toggle=True,
            theme_config=_THEME, busy_indicator=None,
        )  # fmt: skip
    built.param.watch(lambda event: state.param.update(dark=event.new), "dark_theme")
    with param.edit_constant(built):
        built.busy = False
    return built


@contextmanager
def _unfollowed(name: str) -> Iterator[None]:
    """Let nothing that is made meanwhile follow a parameter of the server's.

    A page that follows whether the server is busy is laid out anew by the browser at every message; and the server, which is
    not told when the page is gone, holds it for ever.
    """

    def followers() -> list[Any]:
        return list(pn.state.param.watchers.get(name, {}).get("value", ()))

    before = {id(watcher) for watcher in followers()}
    yield
    for watcher in followers():
        if id(watcher) not in before:
            pn.state.param.unwatch(watcher)
