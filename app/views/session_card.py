"""Choose a session: a bundled one, a path on the server, an upload; and what is known of it."""

from __future__ import annotations

import asyncio
import html
from collections.abc import Awaitable, Callable
from typing import Any

import panel as pn
import panel_material_ui as pmu

from app.state import State
from app.uploads import Uploads
from app.views.fold import folded
from app.views.upload import Upload
from spf.errors import SessionError
from spf.sessions import Session

__all__ = ["SessionCard", "described"]

Open = Callable[[str, str], Awaitable[None]]
_NONE = {"Choose one": ""}  # until a session is open


class SessionCard:
    """The card."""

    def __init__(self, state: State, open_: Open, bundled: dict[str, str], uploads: Uploads) -> None:
        self._state, self._open, self._uploads = state, open_, uploads
        self._paths = dict(bundled)
        self._choice = pmu.Select(
            label="Session", options=_NONE | self._paths, value="", size="small", disabled=not self._paths,
            sizing_mode="stretch_width",
        )  # fmt: skip
        self._path = pmu.TextInput(
            label="Path of a file or folder", size="small", sizing_mode="stretch_width",
            description="On the machine that serves this page.",
        )  # fmt: skip
        self._camera = pmu.TextInput(
            label="Camera file (optional)", size="small", sizing_mode="stretch_width",
            description="For a folder of images that has no camera.json of its own.",
        )  # fmt: skip
        go = pmu.Button(label="Open", icon="folder_open", size="small", on_click=self._open_path)
        self._file = Upload()
        self._facts = pn.pane.HTML("", sizing_mode="stretch_width", margin=(0, 10))
        self._choice.param.watch(self._open_choice, "value")
        self._file.param.watch(self._open_upload, "value")
        state.param.watch(self._describe, "session")
        controls = [self._path, self._camera, pmu.Row(go, self._file)]
        other = folded("Open another session", lambda: controls)
        self.panel = pmu.Column(self._choice, self._facts, other, sizing_mode="stretch_width")

    async def _open_choice(self, event: Any) -> None:
        if event.new and event.new != self._shown():
            await self._open(event.new, "")
            self._choice.value = (
                self._shown()
            )  # another one when it could not be opened, and then it can be chosen again

    def _shown(self) -> str:
        session = self._state.session
        return "" if session is None else str(session.uri)

    async def _open_path(self, _event: Any) -> None:
        await self._open(self._path.value_input or self._path.value, self._camera.value_input or self._camera.value)

    async def _open_upload(self, event: Any) -> None:
        if not event.new:
            return
        name = str(self._file.filename)
        self._file.clear()  # the page need not keep it in memory
        try:
            path = await asyncio.to_thread(self._uploads.store, name, event.new)
        except SessionError as error:
            self._state.error = str(error)
            return
        await self._open(str(path), self._camera.value_input or self._camera.value)
        if self._state.session is None or not str(self._state.session.uri).startswith(str(path)):
            self._uploads.drop(path)

    def _describe(self, event: Any) -> None:
        session: Session = event.new
        uri = str(session.uri)
        if uri not in self._paths.values():
            self._paths[session.name] = uri
        self._choice.param.update(options=dict(self._paths), value=uri, disabled=False)
        self._facts.object = described(session)


def described(session: Session) -> str:
    """Return what is known of a session, as HTML."""
    camera = session.camera
    rate = (
        f" · {(len(session) - 1) / session.times[-1]:.0f} frames/s"
        if len(session) > 1 and session.times[-1] > 0
        else ""
    )
    optics = f"f {camera.fx:.0f} px" if camera.model == "pinhole" else "orthographic"
    side = f"{session.side} hand" if session.side else "side unknown"
    facts = [
        f"<b>{html.escape(session.name)}</b> · {len(session)} frames{rate}",
        f"{camera.width}×{camera.height} · {optics} · {html.escape(session.format)}",
        f"{side} · {'with' if session.has_truth else 'no'} truth",
    ]
    warnings = "".join(f"<div class='session-warning'>{html.escape(text)}</div>" for text in session.warnings)
    style = "<style>.session-warning{color:var(--warning-text-color,#8a4b00);margin-top:4px}</style>"
    words = f"{'<br>'.join(facts)}{warnings}"
    ink = "color:var(--panel-on-background-color,#44505c)"
    return f"{style}<div style='font:12.5px/1.5 Roboto,sans-serif;{ink}'>{words}</div>"
