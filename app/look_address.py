"""How a visitor looks, as parameters of the page's address, and back: tab, picked particles, layers, where the eye is."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

from app.look import Look
from spf.hand.model import DOF_NAMES
from spf.render import ViewCamera

__all__ = ["LOOK", "look_of", "said_of"]


class _Word(NamedTuple):
    """One parameter of the look in the address.

    Attributes:
        name: in the address.
        write: its value as text.
        read: the value of a text; raises a ValueError or LookupError where it is none.
    """

    name: str
    write: Callable[[Any], str]
    read: Callable[[str], Any]


def _numbers(values: tuple[float, ...]) -> str:
    return ",".join(f"{value:.4g}" for value in values)


def _floats(text: str) -> tuple[float, ...]:
    return tuple(float(part) for part in text.split(","))


def _listed(values: list[str]) -> str:
    return ",".join(values) or "none"


def _list(text: str) -> list[str]:
    return [] if text == "none" else text.split(",")


def _stays(anchor: ViewCamera | None) -> str:
    return "" if anchor is None else _numbers((*anchor.focal_point, anchor.distance, anchor.extent))


def _anchor(text: str) -> ViewCamera:
    x, y, z, distance, extent = _floats(text)
    anchor = ViewCamera((x, y, z), distance, extent)
    anchor.placement()  # a view that cannot be is a ValueError
    return anchor


#: Parameter of :class:`Look` → how the address says it.
LOOK: dict[str, _Word] = {
    "tab": _Word("tab", str, str),
    "selected": _Word(
        "picked",
        lambda picked: ",".join(map(str, picked)),
        lambda text: tuple(sorted({int(part) for part in text.split(",") if part.isdecimal()})),
    ),
    "across": _Word("across", lambda index: DOF_NAMES[index], DOF_NAMES.index),
    "upwards": _Word("upwards", lambda index: DOF_NAMES[index], DOF_NAMES.index),
    "densities": _Word("densities", _listed, _list),
    "layers": _Word("layers", _listed, _list),
    "colouring": _Word("colour", str, str),
    "pan": _Word("pan", _numbers, _floats),
    "anchor": _Word("stay", _stays, _anchor),
}


def said_of(look: Look) -> dict[str, str]:
    """Return what an address says of a look: what differs from the one that every page begins with."""
    plain = Look()
    return {
        word.name: word.write(getattr(look, name))
        for name, word in LOOK.items()
        if getattr(look, name) != getattr(plain, name)
    }


def look_of(query: Mapping[str, Any]) -> dict[str, Any]:
    """Return the parameters of :class:`Look` that an address says; what is mistyped is left out."""
    found = Look()
    for name, word in LOOK.items():
        if word.name in query:
            with contextlib.suppress(ValueError, LookupError):  # who has mistyped it sees the page as it begins
                setattr(found, name, word.read(str(query[word.name])))
    return {name: getattr(found, name) for name in LOOK}
