"""ROS 1 bags, version 2.0: an index of all messages from one walk over the file, so that a torn one opens too.

The walk reads headers and message indices, and steps over the chunks. Only a chunk without a whole index behind it, as
in a bag that was never closed, is unpacked for it.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator
from pathlib import Path
from typing import BinaryIO, NamedTuple

import numpy as np

from spf.progress import Report, silent
from spf.sessions.bag import DAMAGE
from spf.sessions.bag_chunks import OUTSIDE, ChunkedBag, Places
from spf.sessions.bag_packed import Packed

__all__ = ["MAGIC", "Ros1Bag"]

MAGIC = b"#ROSBAG V2.0\n"

_MESSAGE, _BAG_HEADER, _INDEX, _CHUNK, _CONNECTION = 2, 3, 4, 5, 7
_U32 = struct.Struct("<I")
_ENTRY = np.dtype([("sec", "<u4"), ("nsec", "<u4"), ("offset", "<u4")])
_LARGEST_HEADER = 2**20


class _Record(NamedTuple):
    """A record: its header fields, and where its data begins and how long it is."""

    fields: dict[str, bytes]
    start: int
    size: int

    @property
    def kind(self) -> int:
        return self.fields["op"][0]

    def number(self, name: str) -> int:
        return int(_U32.unpack(self.fields[name])[0])


def _fields(header: bytes) -> dict[str, bytes]:
    found, position = {}, 0
    while position < len(header):
        (size,) = _U32.unpack_from(header, position)
        name, equals, value = header[position + 4 : position + 4 + size].partition(b"=")
        if not equals or position + 4 + size > len(header):
            raise ValueError("a damaged header")
        found[name.decode()] = value
        position += 4 + size
    return found


def _record_in(data: bytes | memoryview, position: int) -> _Record:
    """Read the header of the record at a position of an unpacked chunk; its data may go on behind the chunk's end."""
    (header_size,) = _U32.unpack_from(data, position)
    fields = _fields(bytes(data[position + 4 : position + 4 + header_size]))
    (size,) = _U32.unpack_from(data, position + 4 + header_size)
    return _Record(fields, position + 8 + header_size, size)


def _record_at(file: BinaryIO, position: int, end: int) -> _Record | None:
    """Read the header of the record at a position of the file; None when it is not whole."""
    file.seek(position)
    first = file.read(4)
    if len(first) < 4 or not 0 < _U32.unpack(first)[0] <= _LARGEST_HEADER:
        return None
    rest = file.read(_U32.unpack(first)[0] + 4)
    if len(rest) < _U32.unpack(first)[0] + 4:
        return None
    size, start = _U32.unpack(rest[-4:])[0], position + 4 + len(rest)
    return None if start + size > end else _Record(_fields(rest[:-4]), start, size)


class Ros1Bag(ChunkedBag):
    """A ROS 1 bag; of a torn one, all messages in whole chunks.

    Args:
        path: the file.
        report: is told how far looking through the file is.

    Raises:
        SessionError: never: what cannot be read is said in ``warnings``.
    """

    kind = "ROS 1 bag"
    cdr = False

    def __init__(self, path: Path, report: Report = silent) -> None:
        super().__init__(path)
        self._names: dict[int, tuple[str, str]] = {}
        found: dict[int, Places] = {}
        with path.open("rb") as file:
            whole = self._walk(file, found, report)
        topics: dict[str, tuple[str, Places]] = {}
        for number, places in found.items():
            name, kind = self._names[number]
            topics.setdefault(name, (kind, Places()))[1].add_all(places)
        self._finish(topics, whole=whole)

    def _walk(self, file: BinaryIO, found: dict[int, Places], report: Report) -> bool:
        """Fill in where the messages lie; tells whether the bag was closed by its recorder and is whole."""
        end = file.seek(0, 2)
        position, closed, chunk, known = len(MAGIC), False, OUTSIDE, True
        try:
            while position < end:
                record = _record_at(file, position, end)
                if record is None:
                    closed = False
                    break
                if record.kind == _BAG_HEADER:
                    closed = struct.unpack("<Q", record.fields["index_pos"])[0] > 0
                elif record.kind == _CHUNK:
                    if not known:
                        self._scan(file, chunk, found)
                    chunk, known = position, False
                    report("Looking through the recording", position / end)
                elif record.kind == _INDEX:
                    _take_index(file, record, chunk, found)
                    known = True
                elif record.kind == _CONNECTION:
                    file.seek(record.start)
                    self._name(record, file.read(record.size))
                position = record.start + record.size
            if not known:
                self._scan(file, chunk, found)
            # A connection that the end of the file does not tell is told in the chunk of its first message.
            for number in [number for number in found if number not in self._names]:
                self._names_in(self._packed(file, found[number].first_chunk).unpack(file))
        except DAMAGE:
            closed = False
        for number in [number for number in found if number not in self._names]:
            del found[number]
        return closed

    def _scan(self, file: BinaryIO, chunk: int, found: dict[int, Places]) -> None:
        data = self._packed(file, chunk).unpack(file)
        self._names_in(data)
        for offset, record in _records_in(data):
            if record.kind == _MESSAGE:
                sec, nsec = struct.unpack("<II", record.fields["time"])
                found.setdefault(record.number("conn"), Places()).add(sec * 10**9 + nsec, chunk, offset)

    def _names_in(self, data: bytes) -> None:
        for _, record in _records_in(data):
            if record.kind == _CONNECTION:
                self._name(record, data[record.start : record.start + record.size])

    def _name(self, record: _Record, data: bytes) -> None:
        package, _, name = _fields(data)["type"].decode().rpartition("/")
        topic = record.fields["topic"].decode()
        self._names.setdefault(record.number("conn"), (topic, f"{package.split('/')[0]}/msg/{name}"))

    def _packed(self, file: BinaryIO, offset: int) -> Packed:
        record = _record_at(file, offset, file.seek(0, 2))
        if record is None or record.kind != _CHUNK:
            raise ValueError("no chunk")
        return Packed(record.fields["compression"].decode(), record.start, record.size, record.number("size"))

    def _outside(self, file: BinaryIO, offset: int) -> bytes:
        raise ValueError("ROS 1 bags have no messages outside chunks")

    def _message(self, data: bytes | memoryview, offset: int, first: int | None = None) -> bytes:
        record = _record_in(data, offset)
        while record.kind == _CONNECTION:  # some recorders let the index point at the connection before the message
            record = _record_in(data, record.start + record.size)
        if record.kind != _MESSAGE:
            raise ValueError("no message")
        end = record.start + (record.size if first is None else min(first, record.size))
        if end > len(data):
            raise ValueError("a message longer than its chunk")
        return bytes(data[record.start : end])


def _take_index(file: BinaryIO, record: _Record, chunk: int, found: dict[int, Places]) -> None:
    """Take in the record that follows a chunk: where in it the messages of a connection lie."""
    if chunk == OUTSIDE:
        raise ValueError("an index before the first chunk")
    file.seek(record.start)
    data = file.read(record.size)
    entries = np.frombuffer(data, _ENTRY, len(data) // _ENTRY.itemsize)
    times = entries["sec"].astype(np.uint64) * np.uint64(10**9) + entries["nsec"]
    found.setdefault(record.number("conn"), Places()).add_chunk(times, chunk, entries["offset"])


def _records_in(data: bytes) -> Iterator[tuple[int, _Record]]:
    position = 0
    while position < len(data):
        record = _record_in(data, position)
        if record.start + record.size > len(data):
            raise ValueError("a record longer than its chunk")
        yield position, record
        position = record.start + record.size
