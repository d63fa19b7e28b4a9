"""MCAP files of other programs: an index of all messages from one walk over the file, so that a torn one opens too."""

from __future__ import annotations

import struct
import zlib
from collections.abc import Iterator
from io import BytesIO
from pathlib import Path
from typing import BinaryIO

from mcap.data_stream import ReadDataStream
from mcap.opcode import Opcode
from mcap.records import Channel, Chunk, MessageIndex, Schema
from mcap.writer import MCAP0_MAGIC

from spf.sessions.bag import DAMAGE, ChunkedBag, Place, decompress, unpack_message

__all__ = ["McapBag"]

_RECORD = struct.Struct("<BQ")
_MESSAGE = struct.Struct("<HIQQ")


class McapBag(ChunkedBag):
    """An MCAP file with ROS messages; of a torn one, all messages in whole chunks.

    Args:
        path: the file.
        packed: each message is compressed by itself (``compression_mode: MESSAGE`` in ``metadata.yaml``).

    Attributes:
        unknown: topic → encoding, of the topics with messages that are not of ROS.
    """

    kind = "MCAP file"
    cdr = True

    def __init__(self, path: Path, packed: bool = False) -> None:
        super().__init__(path)
        self._packed = packed
        self._channels: dict[int, Channel] = {}
        self._schemas: dict[int, str] = {}
        self.unknown: dict[str, str] = {}
        found: dict[int, list[Place]] = {}
        with path.open("rb") as file:
            whole = self._walk(file, found)
        for number, places in found.items():
            channel = self._channels[number]
            if channel.message_encoding not in ("cdr", "ros1"):
                self.unknown[channel.topic] = channel.message_encoding
                continue
            self.cdr = channel.message_encoding == "cdr"
            kind = _ros2_name(self._schemas.get(channel.schema_id, ""))
            self._add(channel.topic, kind, places)
        self._finish(whole=whole)

    def _walk(self, file: BinaryIO, found: dict[int, list[Place]]) -> bool:
        """Fill in where the messages lie; tells whether the file was finished and is whole."""
        end = file.seek(0, 2)
        position, whole, chunk, known = len(MCAP0_MAGIC), False, -1, True
        try:
            while position + _RECORD.size <= end:
                file.seek(position)
                opcode, size = _RECORD.unpack(file.read(_RECORD.size))
                if position + _RECORD.size + size > end:
                    break
                if opcode == Opcode.MESSAGE:
                    channel, _, time, _ = _MESSAGE.unpack(file.read(_MESSAGE.size))
                    found.setdefault(channel, []).append(Place(time, -1, position))
                elif opcode == Opcode.MESSAGE_INDEX:
                    known = True
                    index = MessageIndex.read(_stream(file.read(size)))
                    places = [Place(time, chunk, offset) for time, offset in index.records]
                    found.setdefault(index.channel_id, []).extend(places)
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
                position += _RECORD.size + size
            if not known:
                self._scan(file, chunk, found)
            # What the end of the file does not tell of a channel is told in the chunk of its first message.
            for number in [number for number, places in found.items() if places and number not in self._channels]:
                self._names_in(self._unpack(file, found[number][0].chunk))
        except DAMAGE:
            whole = False
        for number in [number for number, places in found.items() if number not in self._channels or not places]:
            del found[number]
        return whole

    def _scan(self, file: BinaryIO, chunk: int, found: dict[int, list[Place]]) -> None:
        data = self._unpack(file, chunk)
        self._names_in(data)
        for opcode, offset, content in _records_in(data):
            if opcode == Opcode.MESSAGE:
                channel, _, time, _ = _MESSAGE.unpack_from(content)
                found.setdefault(channel, []).append(Place(time, chunk, offset))

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

    def _unpack(self, file: BinaryIO, offset: int) -> bytes:
        opcode, content = _record_at(file, offset)
        if opcode != Opcode.CHUNK:
            raise ValueError("no chunk")
        chunk = Chunk.read(_stream(content))
        data = decompress(chunk.data, chunk.compression, chunk.uncompressed_size)
        if chunk.uncompressed_crc and zlib.crc32(data) != chunk.uncompressed_crc:
            raise ValueError("a damaged chunk")
        return data

    def _message(self, file: BinaryIO, place: Place, chunk: bytes) -> bytes:
        if place.chunk < 0:
            opcode, content = _record_at(file, place.offset)
        else:
            opcode, size = _RECORD.unpack_from(chunk, place.offset)
            start = place.offset + _RECORD.size
            content = chunk[start : start + size]
            if len(content) < size:
                raise ValueError("a message longer than its chunk")
        if opcode != Opcode.MESSAGE:
            raise ValueError("no message")
        data = content[_MESSAGE.size :]
        return unpack_message(data) if self._packed else data


def _stream(content: bytes) -> ReadDataStream:
    return ReadDataStream(BytesIO(content))


def _record_at(file: BinaryIO, offset: int) -> tuple[int, bytes]:
    end = file.seek(0, 2)
    file.seek(offset)
    opcode, size = _RECORD.unpack(file.read(_RECORD.size))
    if offset + _RECORD.size + size > end:
        raise ValueError("a record longer than the file")
    return opcode, file.read(size)


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
