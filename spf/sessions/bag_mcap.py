"""MCAP files of other programs: an index of all messages from one walk over the file, so that a torn one opens too.

The walk steps over the chunks and reads the message index behind each. Only a chunk without one is unpacked for it.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator
from io import BytesIO
from pathlib import Path
from typing import BinaryIO

import numpy as np
from mcap.data_stream import ReadDataStream
from mcap.opcode import Opcode
from mcap.records import Channel, Schema
from mcap.writer import MCAP0_MAGIC

from spf.errors import SessionError
from spf.progress import Report, silent
from spf.sessions.bag import DAMAGE, damaged, unpack_message
from spf.sessions.bag_chunks import OUTSIDE, ChunkedBag, Places
from spf.sessions.bag_packed import Packed

__all__ = ["McapBag"]

_RECORD = struct.Struct("<BQ")
_MESSAGE = struct.Struct("<HIQQ")
_INDEX = struct.Struct("<HI")
_ENTRY = np.dtype([("time", "<u8"), ("offset", "<u8")])
_CHUNK = struct.Struct("<QQQII")  # times of its first and last message, size, checksum, length of the compression
_LONGEST_NAME = 16  # of a compression


class McapBag(ChunkedBag):
    """An MCAP file with ROS messages; of a torn one, all messages in whole chunks.

    Args:
        path: the file.
        packed: each message is compressed by itself (``compression_mode: MESSAGE`` in ``metadata.yaml``).
        report: is told how far looking through the file is.

    Attributes:
        unknown: topic → encoding, of the topics with messages that are not of ROS.
    """

    kind = "MCAP file"
    cdr = True

    def __init__(self, path: Path, packed: bool = False, report: Report = silent) -> None:
        super().__init__(path)
        self._by_message = packed
        self._channels: dict[int, Channel] = {}
        self._schemas: dict[int, str] = {}
        self.unknown: dict[str, str] = {}
        found: dict[int, Places] = {}
        with path.open("rb") as file:
            whole = self._walk(file, found, report)
        topics: dict[str, tuple[str, Places]] = {}
        for number, places in found.items():
            channel = self._channels[number]
            if channel.message_encoding not in ("cdr", "ros1"):
                self.unknown[channel.topic] = channel.message_encoding
                continue
            self.cdr = channel.message_encoding == "cdr"
            kind = _ros2_name(self._schemas.get(channel.schema_id, ""))
            topics.setdefault(channel.topic, (kind, Places()))[1].add_all(places)
        self._finish(topics, whole=whole)

    def _walk(self, file: BinaryIO, found: dict[int, Places], report: Report) -> bool:
        """Fill in where the messages lie; tells whether the file was finished and is whole."""
        end = file.seek(0, 2)
        position, whole, chunk, known = len(MCAP0_MAGIC), False, OUTSIDE, True
        try:
            while position + _RECORD.size <= end:
                file.seek(position)
                opcode, size = _RECORD.unpack(file.read(_RECORD.size))
                if position + _RECORD.size + size > end:
                    break
                if opcode == Opcode.MESSAGE:
                    channel, _, time, _ = _MESSAGE.unpack(file.read(_MESSAGE.size))
                    found.setdefault(channel, Places()).add(time, OUTSIDE, position)
                elif opcode == Opcode.MESSAGE_INDEX:
                    known = True
                    _take_index(file.read(size), chunk, found)
                elif opcode in (Opcode.SCHEMA, Opcode.CHANNEL):
                    self._take(opcode, file.read(size))
                elif opcode == Opcode.FOOTER:
                    file.seek(position + _RECORD.size + size)
                    whole = file.read() == MCAP0_MAGIC
                    break
                if opcode in (Opcode.CHUNK, Opcode.DATA_END) and not known:
                    self._scan(file, chunk, found)
                    known = True
                if opcode == Opcode.CHUNK:
                    chunk, known = position, False
                    report("Looking through the recording", position / end)
                position += _RECORD.size + size
            if not known:
                self._scan(file, chunk, found)
            # What the end of the file does not tell of a channel is told in the chunk of its first message.
            for number in [number for number, places in found.items() if places and number not in self._channels]:
                self._names_in(self._packed(file, found[number].first_chunk).unpack(file))
        except DAMAGE:
            whole = False
        for number in [number for number, places in found.items() if number not in self._channels or not places]:
            del found[number]
        return whole

    def _scan(self, file: BinaryIO, chunk: int, found: dict[int, Places]) -> None:
        data = self._packed(file, chunk).unpack(file)
        self._names_in(data)
        for opcode, offset, content in _records_in(data):
            if opcode == Opcode.MESSAGE:
                channel, _, time, _ = _MESSAGE.unpack_from(content)
                found.setdefault(channel, Places()).add(time, chunk, offset)

    def _names_in(self, data: bytes) -> None:
        for opcode, _, content in _records_in(data):
            if opcode in (Opcode.SCHEMA, Opcode.CHANNEL):
                self._take(opcode, content)

    def _take(self, opcode: int, content: bytes) -> None:
        if opcode == Opcode.SCHEMA:
            schema = Schema.read(_stream(content))
            self._schemas[schema.id] = schema.name
        else:
            channel = Channel.read(_stream(content))
            self._channels[channel.id] = channel

    def _packed(self, file: BinaryIO, offset: int) -> Packed:
        end = file.seek(0, 2)
        file.seek(offset)
        data = file.read(_RECORD.size + _CHUNK.size + _LONGEST_NAME + 8)
        opcode, whole = _RECORD.unpack_from(data)
        _, _, size, crc, length = _CHUNK.unpack_from(data, _RECORD.size)
        if opcode != Opcode.CHUNK or length > _LONGEST_NAME:
            raise ValueError("no chunk")
        name = _RECORD.size + _CHUNK.size
        (stored,) = struct.unpack_from("<Q", data, name + length)
        start = offset + name + length + 8
        if start + stored > min(end, offset + _RECORD.size + whole):
            raise ValueError("a chunk longer than its record, or than the file")
        return Packed(data[name : name + length].decode(), start, stored, size, crc)

    def _outside(self, file: BinaryIO, offset: int) -> bytes:
        end = file.seek(0, 2)
        file.seek(offset)
        head = file.read(_RECORD.size)
        _, size = _RECORD.unpack(head)
        if offset + _RECORD.size + size > end:
            raise ValueError("a record longer than the file")
        return head + file.read(size)

    def _message(self, data: bytes | memoryview, offset: int, first: int | None = None) -> bytes:
        opcode, size = _RECORD.unpack_from(data, offset)
        if opcode != Opcode.MESSAGE or size < _MESSAGE.size:
            raise ValueError("no message")
        start, end = offset + _RECORD.size + _MESSAGE.size, offset + _RECORD.size + size
        end = end if first is None else min(start + first, end)
        if len(data) < end:
            raise ValueError("a message longer than its chunk")
        return bytes(data[start:end])

    def read(self, topic: str, position: int) -> bytes:
        """Return a message."""
        data = super().read(topic, position)
        if not self._by_message:
            return data
        try:
            return unpack_message(data)
        except DAMAGE as error:
            raise damaged(self.path, f"message {position} of {topic}") from error

    def heads(self, topic: str, size: int) -> Iterator[tuple[int, bytes]]:
        """Yield (position, first ``size`` bytes) of all messages of a topic, chunk by chunk; b"" where it is damaged."""
        if not self._by_message:
            yield from super().heads(topic, size)
            return
        for position in range(self.topics[topic].messages):
            try:
                yield position, unpack_message(super().read(topic, position), size)
            except (SessionError, *DAMAGE):
                yield position, b""


def _stream(content: bytes) -> ReadDataStream:
    return ReadDataStream(BytesIO(content))


def _take_index(content: bytes, chunk: int, found: dict[int, Places]) -> None:
    """Take in the record that follows a chunk: where in it the messages of a channel lie."""
    channel, size = _INDEX.unpack_from(content)
    if size > len(content) - _INDEX.size:
        raise ValueError("an index longer than its record")
    if chunk == OUTSIDE:
        raise ValueError("an index before the first chunk")
    entries = np.frombuffer(content, _ENTRY, size // _ENTRY.itemsize, _INDEX.size)
    found.setdefault(channel, Places()).add_chunk(entries["time"], chunk, entries["offset"])


def _records_in(data: bytes) -> Iterator[tuple[int, int, bytes]]:
    """Yield (opcode, offset, content) of the records of an unpacked chunk."""
    position = 0
    while position < len(data):
        opcode, size = _RECORD.unpack_from(data, position)
        start = position + _RECORD.size
        if start + size > len(data):
            raise ValueError("a record longer than its chunk")
        yield opcode, position, data[start : start + size]
        position = start + size


def _ros2_name(schema: str) -> str:
    package, _, name = schema.rpartition("/")
    return f"{package.split('/')[0]}/msg/{name}"
