"""A compressed chunk of a bag: unpacked as a whole and checked, or only its first bytes."""

from __future__ import annotations

import bz2
import zlib
from collections.abc import Callable, Iterator
from typing import BinaryIO, NamedTuple

import lz4.frame
import zstandard

from spf.parallel import per_thread
from spf.sessions.bag import LARGEST

__all__ = ["Packed"]

_PIECE = 2**16  # bytes unpacked at a time
_MOST_KEPT = 2**25  # bytes that a thread keeps to work in

_packed_room, _unpacked_room = per_thread(bytearray), per_thread(bytearray)


class Packed(NamedTuple):
    """The header of a chunk.

    Attributes:
        compression: ``""``, ``none``, ``zstd``, ``lz4`` or ``bz2``.
        start: where its packed bytes begin in the file.
        stored: how many they are.
        size: bytes that they unpack to.
        crc: of the unpacked bytes, 0 if it is not told.
    """

    compression: str
    start: int
    stored: int
    size: int
    crc: int = 0

    @property
    def is_plain(self) -> bool:
        """Whether it is not compressed."""
        return self.compression in ("", "none")

    def unpack(self, file: BinaryIO) -> bytes:
        """Unpack it, never into more than its header says.

        Raises:
            ValueError: it is not what the header says, or the header is absurd.
        """
        self._check()
        file.seek(self.start)
        unpacked = data = file.read(self.stored)
        if self.compression == "zstd":
            if zstandard.frame_content_size(data) > self.size:
                raise ValueError("a chunk larger than its header says")
            unpacked = zstandard.ZstdDecompressor().decompress(data, max_output_size=self.size)
        elif not self.is_plain:
            unpacked = b"".join(_pieces_within(_PIECES[self.compression](memoryview(data)), self.size))
        if len(unpacked) != self.size:
            raise ValueError("a chunk smaller than its header says")
        if self.crc and zlib.crc32(unpacked) != self.crc:
            raise ValueError("a damaged chunk")
        return unpacked

    def unpack_first(self, file: BinaryIO, count: int) -> memoryview:
        """Unpack its first ``count`` bytes, or those that there are; they hold until this thread does so again.

        Nothing is checked but that the header is not absurd.

        Raises:
            ValueError: the header is absurd.
        """
        self._check()
        packed, target = _room(_packed_room, self.stored), _room(_unpacked_room, min(count, self.size))
        file.seek(self.start)
        packed = packed[: file.readinto(packed)]  # type: ignore[attr-defined]  # a BinaryIO has it
        if self.compression == "zstd":
            with zstandard.ZstdDecompressor().stream_reader(packed) as reader:
                return target[: reader.readinto(target)]
        filled = 0
        for piece in _PIECES[self.compression](packed):
            room = min(len(target) - filled, len(piece))
            target[filled : filled + room] = piece[:room]
            filled += room
            if filled == len(target):
                break
        return target[:filled]

    def _check(self) -> None:
        if self.size > LARGEST:
            raise ValueError(f"a chunk of {self.size} bytes")
        if not self.is_plain and self.compression != "zstd" and self.compression not in _PIECES:
            raise ValueError(f"compression {self.compression}")


def _lz4_pieces(packed: memoryview) -> Iterator[bytes]:
    context, done = lz4.frame.create_decompression_context(), False
    while packed and not done:
        piece, used, done = lz4.frame.decompress_chunk(context, packed, max_length=_PIECE)
        if not piece and not used:
            return
        packed = packed[used:]
        yield piece


def _bz2_pieces(packed: memoryview) -> Iterator[bytes]:
    unpacker = bz2.BZ2Decompressor()
    while not unpacker.eof:
        piece = unpacker.decompress(packed, max_length=_PIECE)
        if not piece and unpacker.needs_input:
            return
        packed = packed[:0]
        yield piece


#: Compression → function that unpacks some bytes piece by piece, and ends where they are torn.
_PIECES: dict[str, Callable[[memoryview], Iterator[bytes]]] = {"lz4": _lz4_pieces, "bz2": _bz2_pieces}


def _pieces_within(pieces: Iterator[bytes], size: int) -> Iterator[bytes]:
    """Yield pieces until they are more than they may be."""
    for piece in pieces:
        yield piece
        size -= len(piece)
        if size < 0:
            return


def _room(kept: Callable[..., bytearray], size: int) -> memoryview:
    """Return memory to work in, kept by the thread: to ask the system for it again and again costs more than unpacking."""
    return memoryview(kept(1 << size.bit_length()) if size <= _MOST_KEPT else bytearray(size))[:size]
