"""The cards of the page beside each other: as many in a row as there is room for."""

from __future__ import annotations

from typing import Any

import panel as pn
import panel_material_ui as pmu

__all__ = ["card", "cards"]


def card(pane: Any, head: Any, height: int, *tools: Any, least_width: int = 300) -> pmu.Paper:
    """Return a pane in a card under a heading.

    Args:
        pane: what is shown.
        head: HTML, or a pane of it.
        height: of the card, pixels.
        tools: what stands beside the heading.
        least_width: pixels under which fewer cards stand in a row.
    """
    words = pn.pane.HTML(head, margin=(2, 4), sizing_mode="stretch_width") if isinstance(head, str) else head
    return pmu.Paper(
        pmu.Row(words, *tools, sizing_mode="stretch_width", margin=0, height=28), pane,
        height=height, margin=0, elevation=0, variant="outlined", sizing_mode="stretch_width",
        sx={"p": "4px", "overflow": "hidden"}, styles={"flex": f"1 1 {least_width}px", "min-width": "0", "width": "auto"},
    )  # fmt: skip


def cards(*items: pmu.Paper) -> pn.FlexBox:
    """Return cards in rows that break where the page is narrow."""
    return pn.FlexBox(*items, gap="8px", sizing_mode="stretch_width", margin=(0, 8, 8, 8))
