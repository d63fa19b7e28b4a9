"""Bags whose messages lie in compressed chunks of one file: where they lie, and how they are read."""

from __future__ import annotations

import threading
from abc import abstractmethod
from array import array
from collections import OrderedDict
from collections.abc import Iterator
from functools import partial
from pathlib import Path
from typing import BinaryIO

import numpy as np
from numpy.typing import NDArray

from spf.parallel import map_threads, threads
from spf.sessions.bag import DAMAGE, Bag, Topic, damaged
from spf.sessions.bag_packed import Packed

__all__ = ["OUTSIDE", "ChunkedBag", "Places"]

OUTSIDE = -1  # instead of the offset of a chunk: the message lies outside chunks

_CHUNKS_KEPT = 3
_AROUND = 1024  # bytes that the record of a message may need before the message
_BATCH = 8  # chunks for each thread between two looks at who waits


class Places:
    """Where the messages of a topic lie, in 24 bytes each: a long recording has millions."""

    def __init__(self) -> None:
        self._numbers = array("q")

    def add(self, time: int, chunk: int, offset: int) -> None:
        """Add a message.

        Args:
            time: it was recorded at, in ns.
            chunk: offset of its chunk in the file, or ``OUTSIDE``.
            offset: in the unpacked chunk, or in the file.

        Raises:
            OverflowError: a number is absurd.
        """
        self._numbers.extend((time, chunk, offset))

    def add_chunk(self, times: NDArray[np.uint64], chunk: int, offsets: NDArray[np.uint64]) -> None:
        """Add the messages of a chunk.

        Raises:
            ValueError: a number is absurd.
        """
        rows = np.empty((len(times), 3), np.uint64)
        rows[:, 0], rows[:, 1], rows[:, 2] = times, chunk, offsets
        if (rows >> np.uint64(63)).any():
            raise ValueError("an impossible time or place of a message")
        self._numbers.frombytes(rows.tobytes())

    def add_all(self, others: Places) -> None:
        """Add the messages of another topic, or of another part of this one."""
        self._numbers.extend(others._numbers)

    @property
    def first_chunk(self) -> int:
        """The chunk of the message that was added first."""
        return self._numbers[1]

    def __len__(self) -> int:
        return len(self._numbers) // 3

    def table(self) -> NDArray[np.int64]:
        """Return (N, 3) time, chunk, offset, in order of recording."""
        rows = np.array(self._numbers, dtype=np.int64).reshape(-1, 3)
        return rows[np.lexsort((rows[:, 2], rows[:, 1], rows[:, 0]))]


class ChunkedBag(Bag):
    """A bag in one file; the last few chunks are kept unpacked.

    Attributes:
        places: topic → (N, 3) time, chunk, offset of its messages, see :class:`Places`.
    """

    places: dict[str, NDArray[np.int64]]

    def __init__(self, path: Path) -> None:
        self.path = path
        self.places = {}
        self.topics = {}
        self._kept: OrderedDict[int, bytes] = OrderedDict()
        self._lock = threading.Lock()

    def _finish(self, found: dict[str, tuple[str, Places]], *, whole: bool) -> None:
        """Take in where the messages of the topics lie (name → kind, places), and warn of a file that is not whole."""
        self.places = {name: places.table() for name, (_, places) in found.items()}
        self.topics = {name: Topic(name, kind, len(places)) for name, (kind, places) in found.items()}
        if not whole:
            count = sum(map(len, self.places.values()))
            self.warnings = (f"{self.path.name} was torn or is damaged: {count} messages were recovered.",)

    @abstractmethod
    def _packed(self, file: BinaryIO, offset: int) -> Packed:
        """Read the header of the chunk at an offset of the file."""

    @abstractmethod
    def _outside(self, file: BinaryIO, offset: int) -> bytes:
        """Read the record at an offset of the file, of a message outside chunks."""

    @abstractmethod
    def _message(self, data: bytes | memoryview, offset: int, first: int | None = None) -> bytes:
        """Return the message whose record begins at an offset of some bytes, or its first bytes.

        Raises:
            ValueError: there is none, or it goes on behind the bytes.
        """

    def times(self, topic: str) -> NDArray[np.int64]:
        """Return when the messages of a topic were recorded, in ns."""
        return self.places[topic][:, 0]

    def read(self, topic: str, position: int) -> bytes:
        """Return a message."""
        _, chunk, offset = self.places[topic][position].tolist()
        try:
            with self.path.open("rb") as file:
                if chunk == OUTSIDE:
                    return self._message(self._outside(file, offset), 0)
                return self._message(self._chunk(file, chunk), offset)
        except DAMAGE as error:
            raise damaged(self.path, f"message {position} of {topic}") from error

    def _chunk(self, file: BinaryIO, offset: int) -> bytes:
        with self._lock:
            if offset in self._kept:
                self._kept.move_to_end(offset)
                return self._kept[offset]
        chunk = self._packed(file, offset).unpack(file)
        with self._lock:
            self._kept[offset] = chunk
            while len(self._kept) > _CHUNKS_KEPT:
                self._kept.popitem(last=False)
        return chunk

    def heads(self, topic: str, size: int) -> Iterator[tuple[int, bytes]]:
        """Yield (position, first ``size`` bytes) of all messages of a topic, chunk by chunk; b"" where it is damaged."""
        places = self.places[topic]
        by_chunk = np.argsort(places[:, 1], kind="stable")
        bounds = np.flatnonzero(np.diff(places[by_chunk, 1])) + 1
        groups = np.split(by_chunk, bounds)
        batch = _BATCH * threads()
        for begin in range(0, len(groups), batch):
            some = groups[begin : begin + batch]
            heads = map_threads(partial(self._heads_in, size=size), [places[group] for group in some])
            for group, found in zip(some, heads, strict=True):
                yield from zip(group.tolist(), found, strict=True)

    def _heads_in(self, places: NDArray[np.int64], size: int) -> list[bytes]:
        """Return the first bytes of messages of one chunk."""
        chunk, offsets = int(places[0, 1]), places[:, 2].tolist()
        try:
            with self.path.open("rb") as file:
                if chunk == OUTSIDE:
                    return [self._head_at(file, offset, size) for offset in offsets]
                packed = self._packed(file, chunk)
                if packed.is_plain:
                    heads = [self._head_at(file, packed.start + offset, size) for offset in offsets]
                else:
                    first = packed.unpack_first(file, max(offsets) + _AROUND + size)
                    heads = [self._head_in(first, offset, size) for offset in offsets]
                if all(heads):
                    return heads
                data = packed.unpack(file)  # a record that begins more than _AROUND before its message, or damage
        except DAMAGE:
            return [b""] * len(offsets)
        return [self._head_in(data, offset, size) for offset in offsets]

    def _head_at(self, file: BinaryIO, position: int, size: int) -> bytes:
        file.seek(position)
        return self._head_in(file.read(_AROUND + size), 0, size)

    def _head_in(self, data: bytes | memoryview, offset: int, size: int) -> bytes:
        try:
            return self._message(data, offset, size)
        except DAMAGE:
            return b""
