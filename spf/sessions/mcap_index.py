"""Where the messages of an MCAP file lie: from its summary, or from a walk over what is left of a torn file.

The file is opened for each read: nothing to close, and threads do not share a position.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator
from io import BytesIO
from pathlib import Path
from typing import BinaryIO, NamedTuple

from mcap.data_stream import ReadDataStream
from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.records import Channel, Chunk, ChunkIndex, Message, MessageIndex, Metadata, MetadataIndex
from mcap.stream_reader import breakup_chunk
from mcap.writer import MCAP0_MAGIC
from zstandard import ZstdError

from spf.errors import SessionError
from spf.progress import Report, silent

__all__ = ["DAMAGE", "McapIndex", "Place", "has_magic", "index_file", "read_message", "records_in"]

#: What the MCAP library and the decompressor raise on damaged bytes.
DAMAGE = (McapError, ZstdError, struct.error, ValueError, KeyError, OverflowError)

_RECORD = struct.Struct("<BQ")
_FOOTER = struct.Struct("<BQQQI")
_CHUNK_SIGN = b"\x04\0\0\0zstd"  # in the header of a chunk, behind its opcode, length, times, size and checksum
_SIGN_OFFSET = _RECORD.size + 3 * 8 + 4
_BLOCK = 1 << 16  # bytes read at once while the next chunk is looked for


class Place(NamedTuple):
    """Where a message lies: the offset of its chunk, and its channel in there."""

    offset: int
    channel: int


class McapIndex(NamedTuple):
    """Where the messages of a file lie.

    Attributes:
        places: topic → log time in ns → place.
        metadata: name → metadata record.
        whole: whether the file was finished by its writer.
        damaged: stretches of a torn file that could not be read and were left out, the end not counted.
        lost_bytes: bytes at the end of a torn file that are no complete record.
    """

    places: dict[str, dict[int, Place]]
    metadata: dict[str, dict[str, str]]
    whole: bool
    damaged: int = 0
    lost_bytes: int = 0


def has_magic(path: Path) -> bool:
    """Tell whether a path is a file that starts as MCAP files do."""
    if not path.is_file():
        return False
    with path.open("rb") as file:
        return file.read(len(MCAP0_MAGIC)) == MCAP0_MAGIC


def index_file(path: Path, report: Report = silent) -> McapIndex:
    """Find the messages of an MCAP file: quickly from its summary, else from all complete records.

    Args:
        path: of the file.
        report: is told how far that is.
    """
    with path.open("rb") as file:
        try:
            return _from_summary(file) or _from_walk(file, report)
        except DAMAGE:
            return _from_walk(file, report)


def read_message(path: Path, index: McapIndex, topic: str, time: int) -> bytes:
    """Read the data of one message.

    Raises:
        SessionError: the file changed or is damaged there.
    """
    offset, channel = index.places[topic][time]
    try:
        with path.open("rb") as file:
            opcode, _, content = next(records_in(file, offset))
        if opcode != Opcode.CHUNK:
            raise ValueError(opcode)
        _, messages = _open_chunk(content)
        return next(message.data for message in messages if (message.log_time, message.channel_id) == (time, channel))
    except (*DAMAGE, StopIteration, OSError) as error:
        raise SessionError(
            f"{path} is damaged or was changed while it was open (at byte {offset}): open it again, or record it again."
        ) from error


def records_in(file: BinaryIO, offset: int) -> Iterator[tuple[int, int, bytes]]:
    """Yield (opcode, offset, content) of all complete records from an offset on."""
    size = file.seek(0, 2)
    while offset + _RECORD.size <= size:
        file.seek(offset)
        opcode, length = _RECORD.unpack(file.read(_RECORD.size))
        if offset + _RECORD.size + length > size:
            return
        yield opcode, offset, file.read(length)
        if opcode == Opcode.FOOTER:
            return
        offset += _RECORD.size + length


def _record_at(file: BinaryIO, offset: int) -> bytes:
    """Return the content of the record at an offset; an index may name one behind the end."""
    record = next(records_in(file, offset), None)
    if record is None:
        raise ValueError(offset)
    return record[2]


def _stream(content: bytes) -> ReadDataStream:
    return ReadDataStream(BytesIO(content))


def _open_chunk(content: bytes) -> tuple[dict[int, str], list[Message]]:
    records = breakup_chunk(Chunk.read(_stream(content)), validate_crc=True)
    channels = {record.id: record.topic for record in records if isinstance(record, Channel)}
    return channels, [record for record in records if isinstance(record, Message)]


def _from_summary(file: BinaryIO) -> McapIndex | None:
    end = file.seek(0, 2) - len(MCAP0_MAGIC) - _FOOTER.size
    if end < len(MCAP0_MAGIC):
        return None
    file.seek(end)
    opcode, _, summary_start, _, _ = _FOOTER.unpack(file.read(_FOOTER.size))
    if file.read() != MCAP0_MAGIC or opcode != Opcode.FOOTER or summary_start == 0:
        return None
    records = [(opcode, content) for opcode, _, content in records_in(file, summary_start)]
    channels = [Channel.read(_stream(content)) for opcode, content in records if opcode == Opcode.CHANNEL]
    places: dict[str, dict[int, Place]] = {channel.topic: {} for channel in channels}
    topics = {channel.id: channel.topic for channel in channels}
    for opcode, content in records:
        if opcode == Opcode.CHUNK_INDEX:
            chunk = ChunkIndex.read(_stream(content))
            for channel, time in _messages_of(file, chunk):
                places[topics[channel]][time] = Place(chunk.chunk_start_offset, channel)
    entries = [MetadataIndex.read(_stream(content)) for opcode, content in records if opcode == Opcode.METADATA_INDEX]
    found = [Metadata.read(_stream(_record_at(file, entry.offset))) for entry in entries]
    return McapIndex(places, {record.name: record.metadata for record in found}, whole=True)


def _messages_of(file: BinaryIO, chunk: ChunkIndex) -> Iterator[tuple[int, int]]:
    """Yield (channel id, log time) of the messages of a chunk."""
    if len(chunk.message_index_offsets) == 1 and chunk.message_start_time == chunk.message_end_time:
        yield next(iter(chunk.message_index_offsets)), chunk.message_start_time
        return
    for offset in chunk.message_index_offsets.values():
        index = MessageIndex.read(_stream(_record_at(file, offset)))
        yield from ((index.channel_id, time) for time, _ in index.records)


def _from_walk(file: BinaryIO, report: Report) -> McapIndex:
    """Find all messages that are whole, over damaged stretches: what stands behind one is checked on its own."""
    size = file.seek(0, 2)
    index, topics = McapIndex({}, {}, whole=False), dict[int, str]()
    begin: int | None = len(MCAP0_MAGIC)
    while begin is not None:
        offset = begin
        for opcode, start, content in records_in(file, begin):
            offset = start
            if opcode == Opcode.FOOTER:
                return index._replace(whole=file.read() == MCAP0_MAGIC and not index.damaged)
            try:
                _take(index, topics, opcode, start, content)
            except DAMAGE:
                break
            offset = start + _RECORD.size + len(content)
            report("Looking through the torn recording", offset / size)
        begin = _next_chunk(file, offset + 1)
        if begin is not None:
            index = index._replace(damaged=index.damaged + 1)
    return index._replace(lost_bytes=size - offset)


def _take(index: McapIndex, topics: dict[int, str], opcode: int, offset: int, content: bytes) -> None:
    """Add what a record holds."""
    if opcode == Opcode.METADATA:
        record = Metadata.read(_stream(content))
        index.metadata[record.name] = record.metadata
    elif opcode == Opcode.CHUNK:
        channels, messages = _open_chunk(content)
        topics.update(channels)
        for message in messages:
            places = index.places.setdefault(topics[message.channel_id], {})
            places[message.log_time] = Place(offset, message.channel_id)
    elif not Opcode.HEADER <= opcode <= Opcode.DATA_END:
        raise ValueError(opcode)


def _next_chunk(file: BinaryIO, offset: int) -> int | None:
    """Return where the next chunk after a damaged stretch begins: they all name their compression at the same place."""
    position, kept = offset, b""
    file.seek(position)
    while block := file.read(_BLOCK):
        data = kept + block
        found = data.find(_CHUNK_SIGN, _SIGN_OFFSET)
        while found >= 0:
            if data[found - _SIGN_OFFSET] == Opcode.CHUNK:
                return position - len(kept) + found - _SIGN_OFFSET
            found = data.find(_CHUNK_SIGN, found + 1)
        position += len(block)
        kept = data[-(_SIGN_OFFSET + len(_CHUNK_SIGN)) :]
    return None
