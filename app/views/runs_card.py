"""The shelf of runs: open one, compare it with what is shown, name it, export it, delete it."""

from __future__ import annotations

import html
from typing import Any

import panel as pn
import panel_material_ui as pmu

from app.reruns import Reruns
from app.shelf import Kept, Shelf
from app.state import State
from spf.errors import SpfError

__all__ = ["RunsCard"]


class RunsCard:
    """The card."""

    def __init__(self, state: State, shelf: Shelf, reruns: Reruns) -> None:
        self._state, self._shelf, self._reruns = state, shelf, reruns
        self._asked = ""  # run that was asked to be deleted once
        self._choice = pmu.Select(label="Run", options={}, size="small", sizing_mode="stretch_width")
        self._facts = pn.pane.HTML("", sizing_mode="stretch_width", margin=(0, 10))
        small: dict[str, Any] = {
            "size": "small",
            "variant": "outlined",
            "margin": (3, 4),
            "sizing_mode": "stretch_width",
        }
        self._open = pmu.Button(label="Open run", icon="folder_open", on_click=self._on_open, **small)
        self._beside = pmu.Button(
            label="Compare run", icon="compare_arrows", on_click=self._on_beside,
            **small,
        )  # fmt: skip
        self._delete = pmu.Button(label="Delete run", icon="delete", on_click=self._on_delete, **small)
        self._export = pmu.FileDownload(
            callback=self._packed, filename="run.zip", label="Export run", auto=True,
            size="small", margin=(3, 4), sizing_mode="stretch_width",
        )  # fmt: skip
        self._name = pmu.TextInput(label="Name of the run", size="small", sizing_mode="stretch_width")
        rename = pmu.Button(label="Rename", size="small", on_click=self._on_rename, margin=(10, 10))
        self._choice.param.watch(self._describe, "value")
        state.param.watch(self._follow, ["shelf", "session"])
        self._buttons = [self._open, self._beside, self._export, self._delete]
        self._runs: dict[str, Kept] = {}
        self._follow()
        self.panel = pmu.Column(
            self._choice, self._facts,
            pmu.Row(self._open, self._beside, sizing_mode="stretch_width", margin=(0, 6)),
            pmu.Row(self._export, self._delete, sizing_mode="stretch_width", margin=(0, 6)),
            pmu.Row(self._name, rename, sizing_mode="stretch_width", margin=0),
            sizing_mode="stretch_width", margin=0,
        )  # fmt: skip

    @property
    def _chosen(self) -> str:
        return str(self._choice.value or "")

    async def _on_open(self, _event: Any) -> None:
        await self._reruns.open(self._chosen)

    async def _on_beside(self, _event: Any) -> None:
        await self._reruns.open(self._chosen, self._state.frame, beside=True)

    def _on_rename(self, _event: Any) -> None:
        name = (self._name.value_input or self._name.value).strip()
        if not name:
            self._state.error = "Type a name for the run first."
            return
        if self._act(lambda: self._shelf.rename(self._chosen, name)):
            for lane in self._state.lanes:
                if lane.folder.run == self._chosen:
                    lane.label = name
            self._state.shelf += 1

    def _on_delete(self, _event: Any) -> None:
        if self._asked != self._chosen:
            self._asked = self._chosen
            self._delete.param.update(label="Really delete?", color="error")
            return
        run = self._chosen
        if self._act(lambda: self._shelf.delete(run)):
            for lane in self._state.lanes:
                if lane.folder.run == run:
                    lane.fork()
                    lane.folder.kept = (
                        lane.results.last or 0
                    ) + 1  # it was deleted on purpose: kept again with the next frame
            self._state.shelf += 1

    def _packed(self) -> Any:
        self._export.filename = f"{self._chosen}.zip"
        return self._shelf.archive(self._chosen)

    def _act(self, act: Any) -> bool:
        try:
            act()
        except SpfError as error:
            self._state.error = str(error)
            return False
        return True

    def _follow(self, *_events: Any) -> None:
        """Show what is on the shelf: runs of the session shown first."""
        session = self._state.session
        uri = "" if session is None else str(session.uri)

        def is_other(kept: Kept) -> bool:
            return not uri.endswith(str(kept.manifest.get("session", {}).get("uri", "?")))

        runs = sorted(self._shelf.runs(), key=is_other)
        self._runs = {kept.run: kept for kept in runs}
        options: dict[str, str] = {}
        for kept in runs:
            label = f"{kept.label} · {_about(kept)}"
            options[label if label not in options else f"{label} ({kept.run})"] = kept.run
        value = self._chosen if self._chosen in self._runs else next(iter(self._runs), None)
        self._choice.param.update(options=options, value=value, disabled=not options)
        self._choice.param.trigger("value")  # the browser knows it by its label, which may be another one now
        self._describe()

    def _describe(self, *_events: Any) -> None:
        self._asked = ""
        self._delete.param.update(label="Delete run", color="default")
        kept = self._runs.get(self._chosen)
        for button in self._buttons:
            button.disabled = kept is None
        if kept is None:
            self._facts.object = _small("No run is kept yet: what is tracked is kept by itself, in " +
                                        html.escape(str(self._shelf.folder)) + ".")  # fmt: skip
            return
        self._name.value = kept.label
        self._export.filename = f"{kept.run}.zip"
        self._facts.object = _small(html.escape(f"{self._shelf.folder / kept.run}"))


def _about(kept: Kept) -> str:
    manifest = kept.manifest
    if not manifest:
        return kept.run
    when = str(manifest.get("created", ""))[:16].replace("T", " ")
    return f"{manifest['session']['name']} · {manifest['frames_tracked']} frames · seed {manifest['seed']} · {when}"


def _small(words: str) -> str:
    style = "font:12px/1.4 Roboto,sans-serif;color:var(--panel-on-background-color,#44505c);opacity:0.85;overflow-wrap:anywhere"
    return f"<div style='{style}'>{words}</div>"
