"""How far long work is: a function is told, and may end the work by raising."""

from __future__ import annotations

from collections.abc import Callable

__all__ = ["Report", "part_of", "silent"]

#: Called with what is being done and the share done, 0 to 1.
Report = Callable[[str, float], None]


def silent(_text: str, _share: float) -> None:
    """Tell nobody."""


def part_of(report: Report, first: float, last: float) -> Report:
    """Return whom to tell of a part of some work, which is the shares from ``first`` to ``last`` of the whole."""
    return lambda text, share: report(text, first + (last - first) * share)
