"""Something that is folded away until it is asked for: a line to click, and what comes out under it."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import panel_material_ui as pmu

__all__ = ["folded"]


def folded(title: str, make: Callable[[], list[Any]]) -> Any:
    """Return a line that opens and closes a column.

    Args:
        title: of the line.
        make: returns the content when it is asked for the first time: a page without it is there sooner.
    """
    content = pmu.Column(visible=False, sizing_mode="stretch_width", margin=0)
    line = pmu.Button(
        label=title, icon="expand_more", variant="text", size="small", margin=(2, 6),
        sx={"justifyContent": "flex-start"},
    )  # fmt: skip

    def toggle(_event: Any) -> None:
        if not content.objects:
            content.objects = make()
        content.visible = not content.visible
        line.icon = "expand_less" if content.visible else "expand_more"

    line.on_click(toggle)
    return pmu.Column(line, content, sizing_mode="stretch_width", margin=0)
