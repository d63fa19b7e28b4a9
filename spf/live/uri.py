"""URIs of live sensors: ``scheme:place?name=value&…``, with the options that each sensor declares."""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import NamedTuple
from urllib.parse import parse_qsl

from spf.errors import SensorError

__all__ = ["LiveUri", "parse_live_uri"]


class LiveUri(NamedTuple):
    """A live URI, taken apart.

    Attributes:
        text: as it was given.
        scheme: which sensor.
        place: a path, a host or "".
        options: what follows the question mark.
    """

    text: str
    scheme: str
    place: str
    options: Mapping[str, str]

    def check_options(self, known: Mapping[str, str]) -> None:
        """Check that only known options are given.

        Args:
            known: name → an example value, for the message.

        Raises:
            SensorError: another one is given.
        """
        for name in self.options:
            if name not in known:
                text = "&".join(f"{key}={value}" for key, value in known.items())
                raise SensorError(f"{self.scheme}: has no option {name}; it takes {self.scheme}:?{text}.")

    def number(self, name: str, default: float, low: float, high: float) -> float:
        """Return a numeric option.

        Raises:
            SensorError: it is no number, or outside [low, high].
        """
        text = self.options.get(name)
        try:
            value = default if text is None else float(text)
            if not low <= value <= high:
                raise ValueError
        except ValueError:
            raise SensorError(
                f"The option {name}={text} of {self.text} must be a number from {low:g} to {high:g}."
            ) from None
        return value

    def size(self, default: tuple[int, int]) -> tuple[int, int]:
        """Return the image size that ``size=WIDTHxHEIGHT`` asks for.

        Raises:
            SensorError: it is no size.
        """
        text = self.options.get("size")
        if text is None:
            return default
        found = re.fullmatch(r"(\d{1,5})x(\d{1,5})", text)
        if found is None:
            raise SensorError(f"The option size={text} of {self.text} must be like size=640x480.")
        return int(found[1]), int(found[2])


def parse_live_uri(text: str) -> LiveUri:
    """Take a live URI apart.

    Raises:
        SensorError: an option has no value or comes twice.
    """
    scheme, _, rest = text.partition(":")
    place, _, query = rest.partition("?")
    try:
        pairs = parse_qsl(query, keep_blank_values=True, strict_parsing=bool(query))
    except ValueError:
        raise SensorError(
            f"{text} has options that cannot be read: write them as {scheme}:…?name=value&name=value."
        ) from None
    if len(dict(pairs)) < len(pairs):
        raise SensorError(f"{text} gives an option twice: decide on one value.")
    return LiveUri(text, scheme, place.removeprefix("//"), dict(pairs))
