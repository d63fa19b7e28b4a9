"""The time line in the browser: buttons, a chart of one quantity over all frames, what was tracked, and keys."""

from __future__ import annotations

from collections.abc import Awaitable, Callable
from functools import partial
from pathlib import Path
from typing import Any, ClassVar

import panel as pn
import param
from panel.custom import JSComponent

__all__ = ["TimeLine"]

_FILES = Path(__file__).parent / "js"


class TimeLine(JSComponent):
    """Draws its parameters, and reports what the visitor wants."""

    count: int = param.Integer(0, doc="frames of the session")
    frame: int = param.Integer(0, doc="that is shown")
    lanes: list[dict[str, Any]] = param.List(
        default=[],
        doc="of each lane shown: colour; first frame and values (None where there is none) of the chart; ranges "
        "[first, last] that are tracked, lost, found again",
    )
    top: float = param.Number(0.0, doc="upper end of the chart; 0 before anything is known")
    unit: str = param.String("", doc="of the chart")
    span: list[int] = param.List(default=[], doc="first and last frame that are played, or nothing")
    can: list[str] = param.List(default=[], doc="names of the buttons that do something now")
    playing: bool = param.Boolean(False)
    loop: bool = param.Boolean(False)
    speed: float = param.Number(0.0, doc="of play; 0 is every frame as fast as it is drawn")
    readout: str = param.String("", doc="HTML beside the buttons")
    dark: bool = param.Boolean(False, doc="changes when the page's colours do")

    _esm = _FILES / "time_line.js"

    _stylesheets: ClassVar[list[str]] = [(_FILES / "time_line.css").read_text(encoding="utf-8")]

    def __init__(self, wish: Callable[[dict[str, Any]], Awaitable[None]], **params: Any) -> None:
        super().__init__(**params)
        self._wish = wish

    def _handle_msg(self, msg: dict[str, Any]) -> None:
        pn.state.execute(partial(self._wish, msg), schedule=False)
