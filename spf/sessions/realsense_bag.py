"""What RealSense's own recordings say beside their depth images: depth unit, times and sensor, each in a topic of its own.

librealsense wrote ROS 1 bags until version 2.56 and writes ROS 2 bags (``.db3``) since; topics are alike, types differ.
"""

from __future__ import annotations

import math
import re
import struct
from typing import NamedTuple

from spf.sessions.bag import Bag, damaged
from spf.sessions.ros_wire import Wire

__all__ = ["RealSenseStream", "realsense_stream"]

_DEPTH = re.compile(
    r"(?P<device>/device_\d+)(?P<sensor>/sensor_\d+)(?P<stream>/Depth_\d+)/image/data(/compressedDepth)?"
)
_LONGEST_TEXT = 2**14  # bytes of what is said of one image
_STRING, _FLOAT, _PAIR = "std_msgs/msg/String", "std_msgs/msg/Float32", "diagnostic_msgs/msg/KeyValue"


class RealSenseStream(NamedTuple):
    """The depth stream of a RealSense recording.

    Attributes:
        camera_info: topic that tells its camera.
        unit: metres per count, None if it is not said.
        stamps_ns: times of the frames, None where they are those of the images' headers.
        sensor: name of the device, "" if it is not said.
    """

    camera_info: str
    unit: float | None
    stamps_ns: list[int] | None
    sensor: str


def realsense_stream(bag: Bag, topic: str) -> RealSenseStream | None:
    """Return what a bag says of a depth stream of librealsense, None for a topic of another origin.

    Raises:
        SessionError: it is damaged.
    """
    found = _DEPTH.fullmatch(topic)
    if found is None:
        return None
    device, sensor, stream = found["device"], found["device"] + found["sensor"], found["stream"]
    camera_infos = (f"{sensor}{stream}/image/camera_info", f"{sensor}{stream}/info/camera_info")
    try:
        unit = _unit(bag, f"{sensor}/option/Depth_Units/value")
        stamps = _stamps(bag, topic, f"{sensor}{stream}/image/metadata")
        info = _pairs(bag, f"{device}/info")
    except (ValueError, struct.error) as error:
        raise damaged(bag.path, f"what {device} says of itself") from error
    name, serial = info.get("Name", ""), info.get("Serial Number", "")
    return RealSenseStream(
        camera_info=next((name for name in camera_infos if name in bag.topics), ""),
        unit=unit,
        stamps_ns=stamps,
        sensor=f"{name or 'Intel RealSense'} {serial}".strip(),
    )


def _unit(bag: Bag, topic: str) -> float | None:
    if topic not in bag.topics or not bag.topics[topic].messages:
        return None
    wire = Wire(bag.read(topic, 0), bag.cdr)
    unit = float(wire.number("f") if bag.topics[topic].kind == _FLOAT else wire.text())
    if not (math.isfinite(unit) and unit > 0):
        raise ValueError(f"depth units of {unit} m")
    return round(unit, 9)  # 0.001 was stored as a 32-bit number


def _stamps(bag: Bag, topic: str, metadata: str) -> list[int] | None:
    """Read the times that the .db3 keeps in texts beside the images; a ROS 1 bag has them in the images' headers."""
    found = bag.topics.get(metadata)
    if found is None or found.kind != _STRING or found.messages != bag.topics[topic].messages:
        return None
    stamps = [0] * found.messages
    for position, head in bag.heads(metadata, _LONGEST_TEXT):
        try:
            values = _split(Wire(head, bag.cdr).text())
            stamps[position] = round(float(values["timestamp"]) * 1e6)
        except (KeyError, ValueError, OverflowError):
            return None  # then the images' own headers, which are of the time of recording, must do for all
    return stamps


def _pairs(bag: Bag, topic: str) -> dict[str, str]:
    found = bag.topics.get(topic)
    pairs: dict[str, str] = {}
    for position in range(min(found.messages, 100) if found else 0):
        wire = Wire(bag.read(topic, position), bag.cdr)
        if found and found.kind == _PAIR:
            name = wire.text()
            pairs[name] = wire.text()
        else:
            pairs.update(_split(wire.text()))
    return pairs


def _split(text: str) -> dict[str, str]:
    return dict(part.split("=", 1) for part in text.split(";") if "=" in part)
