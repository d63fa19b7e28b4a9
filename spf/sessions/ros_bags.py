"""Which recordings are ROS bags, and of which kind: told by their first bytes, or by the ``metadata.yaml`` of a folder."""

from __future__ import annotations

import re
import struct
from collections.abc import Iterator, Sequence
from itertools import chain
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from spf.errors import SessionError
from spf.progress import Report, part_of
from spf.sessions import bag_ros1, bag_sqlite
from spf.sessions.bag import Bag, Topic
from spf.sessions.bag_mcap import McapBag
from spf.sessions.bag_ros1 import Ros1Bag
from spf.sessions.bag_sqlite import SqliteBag, is_sqlite_bag, topic_names
from spf.sessions.choice import Choice
from spf.sessions.files import list_files
from spf.sessions.mcap_index import has_magic
from spf.sessions.ros_session import open_ros
from spf.sessions.session import Session

__all__ = [
    "is_realsense",
    "is_ros1",
    "is_ros2",
    "is_ros_mcap",
    "open_realsense",
    "open_ros1",
    "open_ros2",
    "open_ros_mcap",
]

_YAML = "metadata.yaml"
_HEAD = 2**20


class ChainedBag(Bag):
    """A ROS 2 bag that was split into several files while it was recorded.

    Args:
        path: the folder.
        parts: its files, in order.
    """

    def __init__(self, path: Path, parts: Sequence[Bag]) -> None:
        self.path, self._parts = path, parts
        self.kind, self.cdr = f"{parts[0].kind} in {len(parts)} files", parts[0].cdr
        self.warnings = tuple(chain.from_iterable(part.warnings for part in parts))
        self.topics = {}
        for topic in chain.from_iterable(part.topics.values() for part in parts):
            before = self.topics.get(topic.name, Topic(topic.name, topic.kind, 0))
            self.topics[topic.name] = before._replace(messages=before.messages + topic.messages)

    def _having(self, topic: str) -> Iterator[Bag]:
        return (part for part in self._parts if topic in part.topics)

    def times(self, topic: str) -> NDArray[np.int64]:
        """Return when the messages of a topic were recorded, in ns."""
        return np.concatenate([part.times(topic) for part in self._having(topic)])

    def heads(self, topic: str, size: int) -> Iterator[tuple[int, bytes]]:
        """Yield (position, first ``size`` bytes) of all messages of a topic, file by file."""
        before = 0
        for part in self._having(topic):
            yield from ((before + position, head) for position, head in part.heads(topic, size))
            before += part.topics[topic].messages

    def read(self, topic: str, position: int) -> bytes:
        """Return a message."""
        for part in self._having(topic):
            count = part.topics[topic].messages
            if position < count:
                return part.read(topic, position)
            position -= count
        raise IndexError(position)


def is_ros1(path: Path) -> bool:
    """Tell whether a path is a ROS 1 bag."""
    return path.is_file() and _starts(path, bag_ros1.MAGIC)


def is_ros_mcap(path: Path) -> bool:
    """Tell whether a path is an MCAP file that another program wrote."""
    # The project's own files have their metadata records, whose names begin so, before everything else.
    return path.is_file() and has_magic(path) and b"spf." not in _head(path, 4096)


def is_ros2(path: Path) -> bool:
    """Tell whether a path is a ROS 2 bag: its folder, or one of its SQLite files."""
    if path.is_dir():
        return (path / _YAML).is_file() and b"rosbag2_bagfile_information" in _head(path / _YAML)
    return path.is_file() and is_sqlite_bag(path)


def is_realsense(path: Path) -> bool:
    """Tell whether a path is a recording of librealsense: a bag whose topics are those of a device."""
    if not path.is_file():
        return False
    if _starts(path, bag_sqlite.MAGIC):
        try:
            return is_sqlite_bag(path) and any(name.startswith("/device_") for name in topic_names(path))
        except SessionError:
            return False
    if not _starts(path, bag_ros1.MAGIC):
        return False
    found = re.search(rb"index_pos=(.{8})", _head(path, 8192), re.DOTALL)
    if found is None:
        return False
    with path.open("rb") as file:
        end = file.seek(0, 2)
        file.seek(min(struct.unpack("<Q", found[1])[0], end))
        return b"topic=/device_" in file.read(_HEAD)


def open_ros1(path: Path, choice: Choice, uri: str, report: Report) -> Session:
    """Open a ROS 1 bag.

    Raises:
        SessionError: see :func:`spf.sessions.ros_session.open_ros`.
    """
    return open_ros(Ros1Bag(path, report), path.stem, "ros1-bag", uri, choice, report)


def open_ros2(path: Path, choice: Choice, uri: str, report: Report) -> Session:
    """Open a ROS 2 bag.

    Raises:
        SessionError: its files are missing or packed, or see :func:`spf.sessions.ros_session.open_ros`.
    """
    bag = _open_folder(path, report) if path.is_dir() else SqliteBag(path, report=report)
    return open_ros(bag, path.stem, "ros2-bag", uri, choice, report)


def open_ros_mcap(path: Path, choice: Choice, uri: str, report: Report) -> Session:
    """Open an MCAP file of another program.

    Raises:
        SessionError: see :func:`spf.sessions.ros_session.open_ros`.
    """
    bag = McapBag(path, report=report)
    if not bag.topics:
        others = ", ".join(f"{topic} ({encoding})" for topic, encoding in sorted(bag.unknown.items())) or "none"
        why = f"holds no ROS messages (its topics: {others})"
        if bag.warnings and not bag.unknown:
            why = "is torn or damaged from its start on"
        raise SessionError(f"{path} {why}, and no frame can be read.")
    return open_ros(bag, path.stem, "ros-mcap", uri, choice, report)


def open_realsense(path: Path, choice: Choice, uri: str, report: Report) -> Session:
    """Open a recording of librealsense.

    Raises:
        SessionError: see :func:`spf.sessions.ros_session.open_ros`.
    """
    bag = SqliteBag(path, report=report) if _starts(path, bag_sqlite.MAGIC) else Ros1Bag(path, report)
    return open_ros(bag, path.stem, "realsense", uri, choice, report)


def _open_folder(path: Path, report: Report) -> Bag:
    yaml = _head(path / _YAML).decode("utf-8", "replace")
    mode = re.search(r"^\s*compression_mode:\s*[\"']?(\w*)", yaml, re.MULTILINE)
    packed = mode is not None and mode[1].lower() == "message"
    if mode is not None and mode[1].lower() == "file":
        raise SessionError(f"The files in {path} are packed one by one: unpack them first, with zstd -d.")
    files = list_files(path, r".+\.(db3|mcap)")
    if not files:
        raise SessionError(f"There is no .db3 and no .mcap file beside {path / _YAML}: copy the whole folder.")
    parts: list[Bag] = []
    for number, file in enumerate(files):
        within = part_of(report, number / len(files), (number + 1) / len(files))
        if has_magic(file):
            parts.append(McapBag(file, packed, within))
        elif is_sqlite_bag(file):
            parts.append(SqliteBag(file, packed, within))
        else:
            raise SessionError(f"{file} is no part of a ROS 2 bag: take it out of the folder.")
    return parts[0] if len(parts) == 1 else ChainedBag(path, parts)


def _head(path: Path, size: int = _HEAD) -> bytes:
    with path.open("rb") as file:
        return file.read(size)


def _starts(path: Path, magic: bytes) -> bool:
    return _head(path, len(magic)) == magic
