"""The page's address holds what it shows: session, runs, frame, view and look; opened elsewhere, it shows the same."""

from __future__ import annotations

import asyncio
import contextlib
from collections.abc import Mapping
from types import MappingProxyType
from typing import Any, NamedTuple
from urllib.parse import urlencode

from app.controller import Controller
from app.look_address import LOOK, look_of, said_of
from app.reruns import Reruns
from app.state import MODES, State

__all__ = ["Address", "Place", "follow_in", "place_of"]

_A_MOMENT = 0.4  # s


class Place(NamedTuple):
    """What an address says; "" and None where it says nothing.

    Attributes:
        session: name of a bundled session, or a path.
        camera: camera file of the session.
        runs: names on the shelf, one for each lane.
        frame: that is shown.
        mode: one tracker, or several.
        view: azimuth and elevation in radians, zoom.
        look: value of parameters of :class:`app.look.Look`.
    """

    session: str = ""
    camera: str = ""
    runs: tuple[str, ...] = ()
    frame: int | None = None
    mode: str = ""
    view: tuple[float, float, float] | None = None
    look: Mapping[str, Any] = MappingProxyType({})


def place_of(query: Mapping[str, Any]) -> Place:
    """Read an address's parameters; what cannot be read is left out."""
    frame = str(query.get("frame", ""))
    mode = str(query.get("view", ""))
    view = None
    with contextlib.suppress(ValueError):  # an address that somebody has mistyped shows the sensor's view
        azimuth, elevation, zoom = (float(number) for number in str(query.get("eye", "")).split(","))
        view = azimuth, elevation, zoom
    return Place(
        str(query.get("session", "")), str(query.get("camera", "")),
        tuple(run for run in str(query.get("run", "")).split(",") if run),
        int(frame) if frame.isdecimal() else None, mode if mode in MODES.values() else "", view, look_of(query),
    )  # fmt: skip


class Address:
    """Follows the state into the address, and the address into the state when the page opens.

    Args:
        state, controller, reruns: of the page.
        samples: name → path of the bundled sessions.
    """

    def __init__(self, state: State, controller: Controller, reruns: Reruns, samples: dict[str, str]) -> None:
        self._state, self._controller, self._reruns, self._samples = state, controller, reruns, samples

    async def go(self, place: Place) -> None:
        """Show what an address says; a session if it says nothing."""
        state, samples = self._state, self._samples
        state.look.param.update(**place.look)
        uri = samples.get(place.session, place.session) or next(iter(samples.values()), "")
        if uri and not place.runs:
            await self._controller.open(uri, place.camera)
        for number, run in enumerate(place.runs):
            await self._reruns.open(run, place.frame, beside=number > 0)
            if state.error:
                break
        if state.session is None and uri and place.runs:  # the run is gone: its session may still be there
            error = state.error
            await self._controller.open(uri, place.camera)
            state.error = error or state.error
        if place.view is not None:
            state.azimuth, state.elevation, state.zoom = place.view
        if place.mode and place.mode != state.mode and (place.mode == "help" or state.last is not None):
            await self._controller.show_mode(place.mode)
        if place.frame is not None and state.session is not None:
            self._controller.look(place.frame)

    def query(self) -> dict[str, Any]:
        """Return the parameters that say what is shown."""
        state = self._state
        if state.session is None:
            return {}
        uri = str(state.session.uri)
        name = next((name for name, path in self._samples.items() if path == uri), uri)
        runs = ",".join(lane.folder.run for lane in state.active if lane.folder.run)
        eye = state.azimuth, state.elevation, state.zoom
        turned = ",".join(f"{number:.3g}" for number in eye) if eye != (0.0, 0.0, 1.0) else None
        said = {
            "session": name, "camera": state.camera or None, "run": runs or None, "frame": state.frame,
            "view": state.mode, "eye": turned,
        }  # fmt: skip
        return {name: value for name, value in said.items() if value is not None} | said_of(state.look)


def follow_in(location: Any, state: State, address: Address) -> None:
    """Write what is shown into the browser's address, a moment after it has changed and never while playing."""
    writing: list[asyncio.Task[None]] = []

    async def write() -> None:
        await asyncio.sleep(_A_MOMENT)
        location.search = "?" + urlencode(address.query(), safe=",/")

    def changed(*_events: Any) -> None:
        if state.playing or (writing and not writing[-1].done()):
            return
        writing[:] = [asyncio.get_running_loop().create_task(write())]

    state.param.watch(
        changed, ["session", "frame", "mode", "lane", "lanes", "shelf", "azimuth", "elevation", "zoom", "playing"]
    )
    state.look.param.watch(changed, list(LOOK))
    changed()
