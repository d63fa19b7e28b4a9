"""ROS 1 bags, version 2.0: an index of all messages from one walk over the file, so that a torn one opens too.

The walk reads headers and message indices, and steps over the chunks. Only a chunk without a whole index behind it, as
in a bag that was never closed, is unpacked for it.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator
from pathlib import Path
from typing import BinaryIO, NamedTuple

from spf.sessions.bag import DAMAGE, ChunkedBag, Place, decompress

__all__ = ["MAGIC", "Ros1Bag"]

MAGIC = b"#ROSBAG V2.0\n"

_MESSAGE, _BAG_HEADER, _INDEX, _CHUNK, _CONNECTION = 2, 3, 4, 5, 7
_U32 = struct.Struct("<I")
_ENTRY = struct.Struct("<III")
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


def _record_in(data: bytes, position: int) -> _Record:
    """Read the record at a position of an unpacked chunk."""
    (header_size,) = _U32.unpack_from(data, position)
    fields = _fields(data[position + 4 : position + 4 + header_size])
    (size,) = _U32.unpack_from(data, position + 4 + header_size)
    start = position + 8 + header_size
    if start + size > len(data):
        raise ValueError("a record longer than its chunk")
    return _Record(fields, start, size)


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

    Raises:
        SessionError: never: what cannot be read is said in ``warnings``.
    """

    kind = "ROS 1 bag"
    cdr = False

    def __init__(self, path: Path) -> None:
        super().__init__(path)
        self._names: dict[int, tuple[str, str]] = {}
        found: dict[int, list[Place]] = {}
        with path.open("rb") as file:
            whole = self._walk(file, found)
        for number, places in found.items():
            name, kind = self._names[number]
            self._add(name, kind, places)
        self._finish(whole=whole)

    def _walk(self, file: BinaryIO, found: dict[int, list[Place]]) -> bool:
        """Fill in where the messages lie; tells whether the bag was closed by its recorder and is whole."""
        end = file.seek(0, 2)
        position, closed, chunk, known = len(MAGIC), False, -1, True
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
                elif record.kind == _INDEX:
                    known = self._take_index(file, record, chunk, found)
                elif record.kind == _CONNECTION:
                    file.seek(record.start)
                    self._name(record, file.read(record.size))
                position = record.start + record.size
            if not known:
                self._scan(file, chunk, found)
            # A connection that the end of the file does not tell is told in the chunk of its first message.
            for number in [number for number in found if number not in self._names]:
                self._names_in(self._unpack(file, found[number][0].chunk))
        except DAMAGE:
            closed = False
        for number in [number for number in found if number not in self._names]:
            del found[number]
        return closed

    def _take_index(self, file: BinaryIO, record: _Record, chunk: int, found: dict[int, list[Place]]) -> bool:
        file.seek(record.start)
        entries = _ENTRY.iter_unpack(file.read(record.size))
        places = [Place(sec * 10**9 + nsec, chunk, offset) for sec, nsec, offset in entries]
        if chunk < 0:
            raise ValueError("an index before the first chunk")
        found.setdefault(record.number("conn"), []).extend(places)
        return True

    def _scan(self, file: BinaryIO, chunk: int, found: dict[int, list[Place]]) -> None:
        data = self._unpack(file, chunk)
        self._names_in(data)
        for offset, record in _records_in(data):
            if record.kind == _MESSAGE:
                sec, nsec = struct.unpack("<II", record.fields["time"])
                found.setdefault(record.number("conn"), []).append(Place(sec * 10**9 + nsec, chunk, offset))

    def _names_in(self, data: bytes) -> None:
        for _, record in _records_in(data):
            if record.kind == _CONNECTION:
                self._name(record, data[record.start : record.start + record.size])

    def _name(self, record: _Record, data: bytes) -> None:
        package, _, name = _fields(data)["type"].decode().rpartition("/")
        topic = record.fields["topic"].decode()
        self._names.setdefault(record.number("conn"), (topic, f"{package.split('/')[0]}/msg/{name}"))

    def _unpack(self, file: BinaryIO, offset: int) -> bytes:
        record = _record_at(file, offset, file.seek(0, 2))
        if record is None or record.kind != _CHUNK:
            raise ValueError("no chunk")
        file.seek(record.start)
        return decompress(file.read(record.size), record.fields["compression"].decode(), record.number("size"))

    def _message(self, file: BinaryIO, place: Place, chunk: bytes) -> bytes:
        record = _record_in(chunk, place.offset)
        while record.kind == _CONNECTION:  # some recorders let the index point at the connection before the message
            record = _record_in(chunk, record.start + record.size)
        if record.kind != _MESSAGE:
            raise ValueError("no message")
        return chunk[record.start : record.start + record.size]


def _records_in(data: bytes) -> Iterator[tuple[int, _Record]]:
    position = 0
    while position < len(data):
        record = _record_in(data, position)
        yield position, record
        position = record.start + record.size
