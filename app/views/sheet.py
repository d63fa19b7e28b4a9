"""A depth picture to work on in the browser: handles to drag, places to click, zoom; everything in the image's pixels."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any, ClassVar

import param
from panel.custom import JSComponent

__all__ = ["Sheet"]

_FILES = Path(__file__).parent / "js"


class Sheet(JSComponent):
    """Draws its parameters, and reports what the visitor does.

    Args:
        wish: called with ``kind``: ``begin``, ``move`` and ``end`` of a drag (``handle``, ``start``, ``at``), ``place``
            (``at``), ``push`` (``steps``), ``undo``, ``key`` (``key``, ``shift``).
    """

    image: bytes = param.Bytes(b"", doc="a JPEG or PNG file of the whole depth image, or nothing")
    size: list[int] = param.List(default=[0, 0], doc="width and height of the depth image, pixels")
    focus: list[float] = param.List(default=[], doc="left, top, width and height that are seen at first; [] for all")
    tint: bytes = param.Bytes(b"", doc="a PNG file that is laid over a part of it, or nothing")
    tint_box: list[float] = param.List(default=[], doc="left, top, width and height of that part")
    lines: list[dict[str, Any]] = param.List(default=[], doc="points [[u, v], …] and kind of each")
    handles: list[dict[str, Any]] = param.List(
        default=[], doc="name, label, u, v, kind; quiet ones are named only under the mouse"
    )
    chosen: str = param.String("", doc="name of the handle that keys act on")
    echo: int = param.Integer(0, doc="counts up when a movement is answered: the next one is sent then")
    keys: list[str] = param.List(default=[], doc="that are reported, and withheld from the rest of the page")
    places: bool = param.Boolean(False, doc="whether a click on an empty place is reported")
    hint: str = param.String("", doc="what is said over the picture")
    alt: str = param.String("", doc="what the picture shows, for who cannot see it")

    _esm = _FILES / "sheet.js"

    _stylesheets: ClassVar[list[str]] = [(_FILES / "sheet.css").read_text(encoding="utf-8")]

    def __init__(self, wish: Callable[[dict[str, Any]], None], **params: Any) -> None:
        super().__init__(**params)
        self._wish = wish

    def _handle_msg(self, msg: dict[str, Any]) -> None:
        self._wish(msg)
