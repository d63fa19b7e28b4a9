"""Words beside and under pictures as HTML, to be read on a light page and on a dark one."""

from __future__ import annotations

__all__ = ["facts", "noted"]

_INK = "color:var(--panel-on-background-color,#2a3038)"


def facts(words: str, more: str = "", *, name: str = "") -> str:
    """Return what is known, and below it, fainter, what was done or is to be done; ``name`` is the class of the element."""
    added = f"<br><span style='opacity:0.8'>{more}</span>" if more else ""
    return f"<div class='{name}' style='font:12.5px/1.45 Roboto,sans-serif;{_INK}'>{words}{added}</div>"


def noted(words: str) -> str:
    """Return a line under a picture."""
    return f"<div style='font:12px/1.4 Roboto,sans-serif;{_INK};opacity:0.8'>{words}</div>"
