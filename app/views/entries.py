"""The entries of a pose as a visitor reads them: names, millimetres and degrees."""

from __future__ import annotations

import math

from spf.hand.model import DOF_NAMES

__all__ = ["ENTRIES", "axis_label", "in_units", "short_name"]

_JOINTS = {"tm": "TM", "mp": "MP", "ip": "IP", "pip": "PIP", "dip": "DIP"}


def short_name(entry: str) -> str:
    """Return a name such as "Index MP flexion" of an entry such as "index_mp_flexion"."""
    first, *others = entry.split("_")
    words = [_JOINTS.get(word, word.upper() if len(word) == 1 else word) for word in others]
    return " ".join([first.capitalize(), *words])


def in_units(index: int) -> float:
    """Return the factor from metres to millimetres or from radians to degrees of an entry."""
    return 1000.0 if index < 3 else math.degrees(1.0)


def axis_label(index: int) -> str:
    """Return name and unit of an entry."""
    return f"{short_name(DOF_NAMES[index])}, {'mm' if index < 3 else '°'}"


#: Name and unit → index of every entry that all hands have.
ENTRIES = {axis_label(index): index for index in range(len(DOF_NAMES))}
