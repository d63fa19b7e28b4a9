"""Matroska files: where the frames of each track lie, and the attachments; whatever is whole of a torn file.

Only the structure is read: frames are read one by one when they are asked for. Element numbers are those of RFC 9559.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import BinaryIO, NamedTuple

__all__ = ["MAGIC", "Block", "Matroska", "Track", "read_matroska"]

MAGIC = b"\x1a\x45\xdf\xa3"

_EBML, _SEGMENT, _CLUSTER, _GROUP = 0x1A45DFA3, 0x18538067, 0x1F43B675, 0xA0
_INFO, _TRACKS, _TAGS, _ATTACHMENTS = 0x1549A966, 0x1654AE6B, 0x1254C367, 0x1941A469
_TRACK, _VIDEO, _TAG, _SIMPLE_TAG, _FILE = 0xAE, 0xE0, 0x7373, 0x67C8, 0x61A7
_SCALE, _TIME, _SIMPLE_BLOCK, _BLOCK = 0x2AD7B1, 0xE7, 0xA3, 0xA1
_NUMBER, _NAME, _CODEC, _PRIVATE, _WIDTH, _HEIGHT, _FOURCC = 0xD7, 0x536E, 0x86, 0x63A2, 0xB0, 0xBA, 0x2EB524
_TAG_NAME, _TAG_TEXT, _FILE_NAME, _FILE_DATA = 0x45A3, 0x4487, 0x466E, 0x465C

#: Elements that are walked into; all others are stepped over or read whole.
_MASTERS = {_SEGMENT, _CLUSTER, _GROUP, _INFO, _TRACKS, _TAGS, _ATTACHMENTS, _TRACK, _VIDEO, _TAG, _SIMPLE_TAG, _FILE}
#: What ends a cluster or a segment whose size was not known when it was begun.
_TOP = {_SEGMENT, _CLUSTER, _INFO, _TRACKS, _TAGS, _ATTACHMENTS, 0x1C53BB6B, 0x114D9B74, 0x1043A770}
_LARGEST_VALUE = 2**26  # bytes of a text, a number or an attachment
_DEEPEST = 12


class Block(NamedTuple):
    """A frame: its time in units of the file's time scale, and where its bytes lie."""

    time: int
    start: int
    size: int


@dataclass
class Track:
    """A track.

    Attributes:
        number: its number in the file.
        name: its name, "" if it has none.
        codec: Matroska's name of what its frames are.
        fourcc: four characters that tell the layout of raw pixels, b"" if there are none.
        width, height: of its images, 0 if it has none.
        blocks: its frames.
    """

    number: int = 0
    name: str = ""
    codec: str = ""
    fourcc: bytes = b""
    width: int = 0
    height: int = 0
    blocks: list[Block] = field(default_factory=list)


@dataclass
class Matroska:
    """A file's structure.

    Attributes:
        scale: nanoseconds of a unit of time.
        tracks: in the order of the file.
        tags: name → text.
        attachments: name → content.
        whole: whether nothing is missing at its end.
    """

    scale: int = 1_000_000
    tracks: list[Track] = field(default_factory=list)
    tags: dict[str, str] = field(default_factory=dict)
    attachments: dict[str, bytes] = field(default_factory=dict)
    whole: bool = True


class _Element(NamedTuple):
    kind: int
    start: int
    end: int


def read_matroska(path: Path) -> Matroska:
    """Read the structure of a file, up to where it is torn.

    Raises:
        ValueError, struct.error: it is damaged at a place that cannot be stepped over.
    """
    found = Matroska()
    with path.open("rb") as file:
        size = file.seek(0, 2)
        walk = _Walk(file, found)
        try:
            walk.into(0, size, 0)
        except (EOFError, ValueError, struct.error):
            found.whole = False
    by_number = {track.number: track for track in found.tracks}
    for number, block in walk.blocks:
        if number in by_number:
            by_number[number].blocks.append(block)
    return found


class _Walk:
    """A walk over the elements of a file that notes what is met."""

    def __init__(self, file: BinaryIO, found: Matroska) -> None:
        self._file, self._found = file, found
        self._cluster_time = 0
        self._tag = self._attachment = ""
        self.blocks: list[tuple[int, Block]] = []

    def into(self, position: int, end: int, depth: int) -> None:
        if depth > _DEEPEST:
            raise ValueError("elements nested too deep")
        for element in self._elements(position, end):
            if element.kind == _TRACK:
                self._found.tracks.append(Track())
            if element.kind in _MASTERS:
                self.into(element.start, element.end, depth + 1)
            elif element.kind in (_SIMPLE_BLOCK, _BLOCK):
                self._take_block(element)
            elif element.kind in _TAKEN:
                self._take(element.kind, self._value(element))

    def _elements(self, position: int, end: int) -> Iterator[_Element]:
        while position < end:
            kind, start = self._number(position, keep_marker=True)
            size, start = self._number(start, keep_marker=False)
            unknown = size < 0
            if unknown and kind not in (_SEGMENT, _CLUSTER):
                raise ValueError("an element of unknown size")
            stop = self._end_of_unknown(kind, start, end) if unknown else start + size
            if stop > end:
                self._found.whole = False
                if kind not in _MASTERS:
                    raise EOFError
                stop = end
            yield _Element(kind, start, stop)
            position = stop

    def _end_of_unknown(self, kind: int, position: int, end: int) -> int:
        """Find where an element ends that does not say it: where the first begins that cannot be inside."""
        if kind == _SEGMENT:
            return end
        while position < end:
            try:
                child, start = self._number(position, keep_marker=True)
                size, start = self._number(start, keep_marker=False)
            except EOFError:
                return end
            if child in _TOP:
                return position
            if size < 0:
                raise ValueError("an element of unknown size")
            position = start + size
        return end

    def _number(self, position: int, keep_marker: bool) -> tuple[int, int]:
        """Read a number of variable length, and where it ends; -1 for one whose bits are all ones: unknown."""
        self._file.seek(position)
        data = self._file.read(8)
        if not data or data[0] == 0:
            raise EOFError if not data else ValueError("no element")
        length = 9 - data[0].bit_length()
        if len(data) < length:
            raise EOFError
        value = int.from_bytes(data[:length], "big")
        if not keep_marker:
            value -= 1 << (7 * length)
            if value == (1 << (7 * length)) - 1:
                value = -1
        return value, position + length

    def _value(self, element: _Element) -> bytes:
        size = element.end - element.start
        if size > _LARGEST_VALUE:
            raise ValueError(f"a value of {size} bytes")
        self._file.seek(element.start)
        data = self._file.read(size)
        if len(data) < size:
            raise EOFError
        return data

    def _take_block(self, element: _Element) -> None:
        track, start = self._number(element.start, keep_marker=False)
        self._file.seek(start)
        offset, flags = struct.unpack(">hB", self._file.read(3))
        if flags & 0x06:
            raise ValueError("several frames in one block")
        self.blocks.append((track, Block(self._cluster_time + offset, start + 3, element.end - start - 3)))

    def _take(self, kind: int, data: bytes) -> None:
        found = self._found
        if kind == _SCALE:
            found.scale = int.from_bytes(data, "big")
        elif kind == _TIME:
            self._cluster_time = int.from_bytes(data[:8], "big")
        elif kind == _TAG_NAME:
            self._tag = _text(data)
        elif kind == _TAG_TEXT:
            found.tags[self._tag] = _text(data)
        elif kind == _FILE_NAME:
            self._attachment = _text(data)
        elif kind == _FILE_DATA:
            found.attachments[self._attachment] = data
        elif found.tracks:
            _describe(found.tracks[-1], kind, data)


_TAKEN = {
    _SCALE, _TIME, _TAG_NAME, _TAG_TEXT, _FILE_NAME, _FILE_DATA,
    _NUMBER, _NAME, _CODEC, _PRIVATE, _WIDTH, _HEIGHT, _FOURCC,
}  # fmt: skip


def _describe(track: Track, kind: int, data: bytes) -> None:
    if kind == _NUMBER:
        track.number = int.from_bytes(data, "big")
    elif kind == _NAME:
        track.name = _text(data)
    elif kind == _CODEC:
        track.codec = _text(data)
    elif kind == _PRIVATE and track.codec in ("V_MS/VFW/FOURCC", "") and len(data) >= 20:
        track.fourcc = data[16:20]  # biCompression of a BITMAPINFOHEADER
    elif kind == _FOURCC:
        track.fourcc = data[:4]
    elif kind == _WIDTH:
        track.width = int.from_bytes(data, "big")
    elif kind == _HEIGHT:
        track.height = int.from_bytes(data, "big")


def _text(data: bytes) -> str:
    return data.rstrip(b"\0").decode("utf-8", "replace")
