"""A bag: recorded messages by topic, read one by one, whatever file holds them."""

from __future__ import annotations

import bz2
import struct
import threading
from abc import ABC, abstractmethod
from collections import OrderedDict
from collections.abc import Iterator
from pathlib import Path
from typing import BinaryIO, NamedTuple

import lz4.frame
import zstandard
from mcap.exceptions import McapError

from spf.errors import SessionError

__all__ = ["DAMAGE", "LARGEST_CHUNK", "Bag", "ChunkedBag", "Place", "Topic", "damaged", "decompress", "unpack_message"]

#: What damaged bytes make the libraries and our own parsers raise.
DAMAGE = (
    struct.error, ValueError, LookupError, EOFError, OverflowError, MemoryError, RuntimeError, OSError,
    zstandard.ZstdError, McapError,
)  # fmt: skip

#: Bytes of a chunk, unpacked, beyond which a header is damaged (recorders make chunks of a few MB).
LARGEST_CHUNK = 2**29

_CHUNKS_KEPT = 3


class Topic(NamedTuple):
    """A topic of a bag.

    Attributes:
        name: of the topic.
        kind: message type as ROS 2 writes it, ``sensor_msgs/msg/Image``.
        messages: how many it has.
    """

    name: str
    kind: str
    messages: int


class Place(NamedTuple):
    """Where a message lies.

    Attributes:
        time: it was recorded at, in ns.
        chunk: offset of its chunk in the file, or -1 for a message outside chunks.
        offset: in the unpacked chunk, or in the file.
    """

    time: int
    chunk: int
    offset: int


class Bag(ABC):
    """Messages by topic and position, in the order they were recorded; may be read from several threads.

    Attributes:
        path: the file or folder.
        kind: what it is, for people.
        cdr: messages are encoded as in ROS 2, else as in ROS 1.
        topics: name → topic.
        warnings: a sentence for everything that is missing.
    """

    path: Path
    kind: str
    cdr: bool
    topics: dict[str, Topic]
    warnings: tuple[str, ...] = ()

    @abstractmethod
    def times(self, topic: str) -> list[int]:
        """Return when the messages of a topic were recorded, in ns."""

    @abstractmethod
    def read(self, topic: str, position: int) -> bytes:
        """Return a message.

        Raises:
            SessionError: the file is damaged there.
        """

    def heads(self, topic: str) -> Iterator[bytes]:
        """Yield the first bytes of all messages of a topic, at least 16 if it has them; none where it is damaged."""
        for position in range(self.topics[topic].messages):
            try:
                yield self.read(topic, position)[:16]
            except SessionError:
                yield b""


class ChunkedBag(Bag):
    """A bag whose messages lie in compressed chunks of one file; the last few chunks are kept unpacked.

    Attributes:
        places: topic → where its messages lie.
    """

    places: dict[str, list[Place]]

    def __init__(self, path: Path) -> None:
        self.path = path
        self.places = {}
        self.topics = {}
        self._kept: OrderedDict[int, bytes] = OrderedDict()
        self._lock = threading.Lock()

    def _add(self, topic: str, kind: str, places: list[Place]) -> None:
        """Take in where messages of a topic lie; a topic may come in several parts."""
        self.places.setdefault(topic, []).extend(places)
        self.topics[topic] = Topic(topic, kind, 0)

    def _finish(self, *, whole: bool) -> None:
        """Order and count what was taken in, and warn of a file that is not whole."""
        for topic, places in self.places.items():
            places.sort()
            self.topics[topic] = self.topics[topic]._replace(messages=len(places))
        if not whole:
            count = sum(map(len, self.places.values()))
            self.warnings = (f"{self.path.name} was torn or is damaged: {count} messages were recovered.",)

    @abstractmethod
    def _unpack(self, file: BinaryIO, offset: int) -> bytes:
        """Read and unpack the chunk at an offset of the file."""

    @abstractmethod
    def _message(self, file: BinaryIO, place: Place, chunk: bytes) -> bytes:
        """Return the message at a place; ``chunk`` is its unpacked chunk."""

    def times(self, topic: str) -> list[int]:
        """Return when the messages of a topic were recorded, in ns."""
        return [place.time for place in self.places[topic]]

    def read(self, topic: str, position: int) -> bytes:
        """Return a message."""
        place = self.places[topic][position]
        try:
            with self.path.open("rb") as file:
                return self._message(file, place, self._chunk(file, place.chunk))
        except DAMAGE as error:
            raise damaged(self.path, f"message {position} of {topic}") from error

    def _chunk(self, file: BinaryIO, offset: int) -> bytes:
        if offset < 0:
            return b""
        with self._lock:
            if offset in self._kept:
                self._kept.move_to_end(offset)
                return self._kept[offset]
        chunk = self._unpack(file, offset)
        with self._lock:
            self._kept[offset] = chunk
            while len(self._kept) > _CHUNKS_KEPT:
                self._kept.popitem(last=False)
        return chunk


def damaged(path: Path, what: str) -> SessionError:
    """Return the error for a recording that cannot be read at some place."""
    return SessionError(f"{path} is damaged or was changed while it was open ({what}): copy it again.")


def decompress(data: bytes, compression: str, size: int) -> bytes:
    """Unpack a chunk, never into more than its header says.

    Args:
        data: packed bytes.
        compression: ``""``, ``none``, ``zstd``, ``lz4`` or ``bz2``.
        size: bytes that it unpacks to.

    Raises:
        ValueError: it is not what the header says, or the header is absurd.
    """
    if size > LARGEST_CHUNK:
        raise ValueError(f"a chunk of {size} bytes")
    if compression in ("", "none"):
        unpacked = data
    elif compression == "zstd":
        if zstandard.frame_content_size(data) > size:
            raise ValueError("a chunk larger than its header says")
        unpacked = zstandard.ZstdDecompressor().decompress(data, max_output_size=size)
    elif compression == "lz4":
        unpacked = lz4.frame.LZ4FrameDecompressor().decompress(data, max_length=size)
    elif compression == "bz2":
        unpacked = bz2.BZ2Decompressor().decompress(data, max_length=size)
    else:
        raise ValueError(f"compression {compression}")
    if len(unpacked) != size:
        raise ValueError("a chunk smaller than its header says")
    return unpacked


def unpack_message(data: bytes) -> bytes:
    """Unpack a message that was compressed by itself, with zstd.

    Raises:
        ValueError, ZstdError: it is damaged.
    """
    size = zstandard.frame_content_size(data)
    if size > LARGEST_CHUNK:
        raise ValueError(f"a message of {size} bytes")
    return zstandard.ZstdDecompressor().decompress(data, max_output_size=LARGEST_CHUNK if size < 0 else size)
