"""The table of live sensors by the scheme of their URIs."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

from spf.errors import SensorError
from spf.live.network import NetworkSource
from spf.live.oak import Oak
from spf.live.realsense import RealSense
from spf.live.replay import Replay
from spf.live.source import LiveSource
from spf.live.uri import LiveUri, parse_live_uri

__all__ = ["SENSORS", "Sensor", "is_live", "is_meant_live", "open_live"]


class Sensor(NamedTuple):
    """One kind of live source.

    Attributes:
        example: URIs of it, for people.
        make: a source, not yet open.
    """

    example: str
    make: Callable[[LiveUri], LiveSource]


#: A new sensor is one file and one row.
SENSORS: dict[str, Sensor] = {
    "realsense": Sensor("realsense:[?serial=…&size=640x480&rate=30]", RealSense),
    "oak": Sensor("oak:[?serial=…&size=640x400&rate=30]", Oak),
    "zmq": Sensor("zmq://HOST:PORT", NetworkSource),
    "replay": Sensor("replay:SESSION[?speed=1&loop=0]", Replay),
}


def is_live(text: str | Path) -> bool:
    """Tell whether a text is the URI of a live source and not the path of a session."""
    scheme, colon, _ = str(text).partition(":")
    return bool(colon) and scheme in SENSORS and not Path(text).exists()


def is_meant_live(text: str) -> bool:
    """Tell whether a text is written like the URI of a live source, known or not, and is no path that is there."""
    return re.match(r"[A-Za-z]{2,}:", text) is not None and not Path(text).exists()  # one letter: a drive


def open_live(text: str) -> LiveSource:
    """Return the source that a URI names, not yet open.

    Raises:
        SensorError: there is no such kind of sensor, an option is wrong, or what it needs is not installed.
    """
    uri = parse_live_uri(text)
    if uri.scheme not in SENSORS:
        if ":" not in text or Path(text).exists():
            raise SensorError(f"{text} is no live sensor: a recording is played as if it were one with replay:{text}.")
        *others, last = (sensor.example.partition("[")[0] for sensor in SENSORS.values())
        raise SensorError(f"{text} is no live sensor; there are {', '.join(others)} and {last}.")
    return SENSORS[uri.scheme].make(uri)
