"""Parts of the page of which one is seen, each made when it is first asked for; a line says so while it is laid out."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, Generic, Protocol, TypeVar

import panel as pn

from app.views.laying_out import LayingOut

__all__ = ["Parts"]


class Part(Protocol):
    """Something with a panel."""

    panel: Any


P = TypeVar("P", bound=Part)


class Parts(Generic[P]):
    """The parts that were made, and the one that is seen.

    Args:
        first: name of the part that is there from the beginning.
        part: that part.
        called: name of each part → what it is called while it is laid out.
        arrived: called when another part is seen.
    """

    def __init__(self, first: str, part: P, called: Mapping[str, str], arrived: Callable[[], None]) -> None:
        self._called, self._arrived, self._wanted = called, arrived, first
        self._made: dict[str, P] = {first: part}
        self._makers: dict[str, Callable[[], P]] = {}
        self._line = LayingOut(self._arrive, width=0, height=0, margin=0)
        self.panel = pn.Column(self._line, part.panel, sizing_mode="stretch_width", margin=0)

    def offer(self, name: str, make: Callable[[], P]) -> None:
        """Say how a part is made when it is first asked for."""
        self._makers[name] = make

    def get(self, name: str) -> P | None:
        """Return a part, None while it is not made."""
        return self._made.get(name)

    def show(self, name: str) -> None:
        """Show a part: at once if it is made, else when the browser shows the line that says so."""
        self._wanted = name
        document = pn.state.curdoc
        if name not in self._made and document is not None and document.session_context is not None:
            self._see(None)
            self._line.words = f"Laying out {self._called[name]} …"
        else:
            self._arrive()

    def _arrive(self) -> None:
        """Show the part that is wanted."""
        name = self._wanted
        if name not in self._made:
            self._made[name] = self._makers[name]()
            self.panel.append(self._made[name].panel)
        self._see(name)
        self._line.words = ""
        self._arrived()

    def _see(self, name: str | None) -> None:
        for made, part in self._made.items():
            part.panel.visible = made == name
