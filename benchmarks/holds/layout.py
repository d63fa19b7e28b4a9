"""Tables in Markdown, and what a result is stamped with."""

from __future__ import annotations

import datetime
import subprocess
from collections.abc import Sequence

__all__ = ["markdown", "stamp"]


def markdown(cells: Sequence[Sequence[str]]) -> str:
    """Lay lines of cells out as a Markdown table, its columns aligned; the first line is the heading."""
    widths = [max(len(line[column]) for line in cells) for column in range(len(cells[0]))]
    lines = ["| " + " | ".join(f"{cell:<{w}}" for cell, w in zip(line, widths, strict=True)) + " |" for line in cells]
    rule = "|" + "|".join("-" * (width + 2) for width in widths) + "|"
    return "\n".join([lines[0], rule, *lines[1:]])


def stamp() -> dict[str, str]:
    """Return date and commit; the commit has a mark where files differ from it."""
    told = subprocess.run(["git", "describe", "--always", "--dirty"], capture_output=True, text=True, check=False)
    return {"date": datetime.date.today().isoformat(), "commit": told.stdout.strip() or "unknown"}
