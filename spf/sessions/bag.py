"""A bag: recorded messages by topic, read one by one, whatever file holds them."""

from __future__ import annotations

import struct
from abc import ABC, abstractmethod
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import numpy as np
import zstandard
from mcap.exceptions import McapError
from numpy.typing import NDArray

from spf.errors import SessionError

__all__ = ["DAMAGE", "LARGEST", "Bag", "Topic", "damaged", "unpack_message"]

#: What damaged bytes make the libraries and our own parsers raise.
DAMAGE = (
    struct.error, ValueError, LookupError, EOFError, OverflowError, MemoryError, RuntimeError, OSError,
    zstandard.ZstdError, McapError,
)  # fmt: skip

#: Bytes of a chunk or message, unpacked, beyond which a header is damaged (recorders make chunks of a few MB).
LARGEST = 2**29


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
    def times(self, topic: str) -> NDArray[np.int64]:
        """Return when the messages of a topic were recorded, in ns."""

    @abstractmethod
    def read(self, topic: str, position: int) -> bytes:
        """Return a message.

        Raises:
            SessionError: the file is damaged there.
        """

    @abstractmethod
    def heads(self, topic: str, size: int) -> Iterator[tuple[int, bytes]]:
        """Yield (position, first ``size`` bytes) of all messages of a topic, in any order; b"" where it is damaged.

        It reads no more than it must, so that what lies behind those bytes is not checked.
        """


def damaged(path: Path, what: str) -> SessionError:
    """Return the error for a recording that cannot be read at some place."""
    return SessionError(f"{path} is damaged or was changed while it was open ({what}): copy it again.")


def unpack_message(data: bytes, first: int | None = None) -> bytes:
    """Unpack a message that was compressed by itself, with zstd, or only its first bytes.

    Raises:
        ValueError, ZstdError: it is damaged.
    """
    size = zstandard.frame_content_size(data)
    if size > LARGEST:
        raise ValueError(f"a message of {size} bytes")
    unpacker = zstandard.ZstdDecompressor()
    if first is not None:
        with unpacker.stream_reader(data) as reader:
            return reader.read(first)
    return unpacker.decompress(data, max_output_size=LARGEST if size < 0 else size)
