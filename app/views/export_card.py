"""The run shown as files: a report, its track, a picture of the frame and view shown, a film."""

from __future__ import annotations

from collections.abc import Awaitable, Callable
from pathlib import Path
from typing import Any

import panel_material_ui as pmu

from app.controller import Controller
from app.exports import EXPORTS, Export, exported, wanted_of
from app.state import State
from app.views.download import Download
from spf.render import Renderer

__all__ = ["ExportCard"]


class ExportCard:
    """The card: a button for each kind of file; the file comes as a download, with progress and Cancel in the head.

    Args:
        state: of the page.
        controller: does the work in the page's worker.
        renderer: of the server.
        folder: that the page keeps its runs in.
    """

    def __init__(self, state: State, controller: Controller, renderer: Renderer, folder: Path) -> None:
        self._state, self._controller, self._renderer, self._folder = state, controller, renderer, folder
        self.download = Download(width=0, height=0, margin=0)
        self._buttons = [
            pmu.Button(
                label=kind.label, icon=kind.icon, size="small", variant="outlined", margin=(3, 4),
                sizing_mode="stretch_width", on_click=self._pressed(kind),
            )
            for kind in EXPORTS
        ]  # fmt: skip
        self._hint = pmu.Typography("", variant="body2", margin=(2, 10))
        report, *others = self._buttons
        rows = [pmu.Row(*others[i : i + 2], sizing_mode="stretch_width", margin=(0, 6)) for i in (0, 2)]
        self.panel = pmu.Column(
            self._hint, pmu.Row(report, sizing_mode="stretch_width", margin=(0, 6)), *rows, self.download,
            sizing_mode="stretch_width", margin=0,
        )  # fmt: skip
        state.param.watch(self._follow, ["revision", "task", "playing", "lane", "session"])
        self._follow()

    def _pressed(self, kind: Export) -> Callable[[Any], Awaitable[None]]:
        async def pressed(_event: Any) -> None:
            await self.export(kind)

        return pressed

    async def export(self, kind: Export) -> None:
        """Make a file of what the page shows and hand it over."""
        if not self._controller.free():
            return
        async with self._controller.doing(kind.task) as wanted:
            asked = wanted_of(self._state, self._folder)
            name, content = await self._controller.run(exported(asked, kind.ending, self._renderer))
            if wanted():
                self.download.hand_over(name, content)

    def _follow(self, *_events: Any) -> None:
        state = self._state
        count = len(state.lane.results.summaries)
        for button in self._buttons:
            button.disabled = state.busy or not count
        told = (
            f"Of {state.lane.title}, frames tracked: {count}."
            if count
            else "Track some frames first: press Start, then Play."
        )
        self._hint.object = told
