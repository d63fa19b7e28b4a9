"""ROS 2 bags in SQLite (``.db3``), with or without their ``metadata.yaml``; RealSense records such files too."""

from __future__ import annotations

import sqlite3
from array import array
from collections.abc import Iterator
from contextlib import closing, contextmanager
from itertools import count
from pathlib import Path
from urllib.parse import quote

import numpy as np
import zstandard
from numpy.typing import NDArray

from spf.errors import SessionError
from spf.progress import Report, silent
from spf.sessions.bag import LARGEST, Bag, Topic, damaged, unpack_message

__all__ = ["MAGIC", "SqliteBag", "is_sqlite_bag", "topic_names"]

MAGIC = b"SQLite format 3\0"

#: Steps of SQLite's virtual machine that one query may take for each byte of the file: more is a damaged file.
_STEPS_PER_BYTE = 50
_STEPS = 10**6  # between two looks at that

_TOPICS = "SELECT id, name, type FROM topics"
_OFTEN = 1000  # messages between two reports
_BLOCK = 2**18  # bytes of a packed message that hold its first block, which is at most half of that


class SqliteBag(Bag):
    """A ROS 2 bag in one SQLite file.

    Args:
        path: the file.
        packed: each message is compressed (``compression_mode: MESSAGE`` in ``metadata.yaml``).
        report: is told how far reading the list of messages is.

    Raises:
        SessionError: it is damaged.
    """

    kind = "ROS 2 bag (SQLite)"
    cdr = True

    def __init__(self, path: Path, packed: bool = False, report: Report = silent) -> None:
        self.path, self._packed = path, packed
        self._rows: dict[str, NDArray[np.int64]] = {}
        try:
            with _connected(path) as connection:
                topics = [(number, str(name), str(kind)) for number, name, kind in connection.execute(_TOPICS)]
                found = {name: array("q") for _, name, _ in topics}
                by_number = {number: found[name] for number, name, _ in topics}
                total = connection.execute("SELECT max(id) FROM messages").fetchone()[0]
                query = "SELECT topic_id, timestamp, id FROM messages ORDER BY timestamp, id"
                for done, (number, time, row) in enumerate(connection.execute(query)):
                    if number in by_number:
                        by_number[number].extend((int(time), int(row)))
                    if done % _OFTEN == 0:
                        report("Looking through the recording", min(done / max(int(total), 1), 1.0))
        except (sqlite3.Error, ValueError, TypeError, OverflowError) as error:
            raise damaged(path, str(error)) from error
        self._rows = {name: np.array(rows, dtype=np.int64).reshape(-1, 2) for name, rows in found.items()}
        self.topics = {name: Topic(name, kind, len(self._rows[name])) for _, name, kind in topics}

    def times(self, topic: str) -> NDArray[np.int64]:
        """Return when the messages of a topic were recorded, in ns."""
        return self._rows[topic][:, 0]

    def read(self, topic: str, position: int) -> bytes:
        """Return a message."""
        data = self._fetch(topic, position)
        if not self._packed:
            return data
        try:
            return unpack_message(data)
        except (zstandard.ZstdError, ValueError, MemoryError) as error:
            raise damaged(self.path, f"message {position} of {topic}") from error

    def heads(self, topic: str, size: int) -> Iterator[tuple[int, bytes]]:
        """Yield (position, first ``size`` bytes) of all messages of a topic; b"" where it is damaged."""
        try:
            with _connected(self.path) as connection:
                for position, row in enumerate(self._rows[topic][:, 1].tolist()):
                    yield position, self._head(connection, row, size)
        except sqlite3.Error as error:
            raise damaged(self.path, str(error)) from error

    def _head(self, connection: sqlite3.Connection, row: int, size: int) -> bytes:
        # Read as a blob: a query, even one for its first bytes, would read all of a message.
        try:
            with connection.blobopen("messages", "data", row, readonly=True) as blob:
                if not self._packed:
                    return blob.read(size)
                return unpack_message(blob.read(size + _BLOCK), size)
        except (sqlite3.Error, ValueError, OverflowError, zstandard.ZstdError):
            return b""

    def _fetch(self, topic: str, position: int) -> bytes:
        try:
            with _connected(self.path) as connection:
                number = int(self._rows[topic][position, 1])
                row = connection.execute("SELECT data FROM messages WHERE id = ?", (number,)).fetchone()
        except (sqlite3.Error, ValueError, OverflowError) as error:
            raise damaged(self.path, str(error)) from error
        if row is None or not isinstance(row[0], bytes):
            raise damaged(self.path, f"message {position} of {topic}")
        return row[0]


def topic_names(path: Path) -> list[str]:
    """Return the names of the topics of a file.

    Raises:
        SessionError: it is damaged.
    """
    try:
        with _connected(path) as connection:
            return [str(name) for _, name, _ in connection.execute(_TOPICS)]
    except (sqlite3.Error, ValueError, TypeError, OverflowError) as error:
        raise damaged(path, str(error)) from error


def is_sqlite_bag(path: Path) -> bool:
    """Tell whether a path is an SQLite file with the tables of a bag; one too damaged to tell counts as one."""
    with path.open("rb") as file:
        if file.read(len(MAGIC)) != MAGIC:
            return False
    try:
        with _connected(path) as connection:
            query = "SELECT count(*) FROM sqlite_master WHERE type = 'table' AND name IN ('messages', 'topics')"
            return bool(connection.execute(query).fetchone()[0] == 2)
    except (sqlite3.Error, ValueError):  # ValueError: what SQLite says of it is no text
        return True


@contextmanager
def _connected(path: Path) -> Iterator[sqlite3.Connection]:
    """Open the file for reading only; a query that goes on for ever, as damaged files can cause, is ended."""
    size = path.stat().st_size
    log = path.with_name(path.name + "-wal")
    # Without a write-ahead log nobody is writing: then no lock is needed, and the file may be on a read-only disk.
    mode = "mode=ro" if log.exists() and log.stat().st_size else "mode=ro&immutable=1"
    try:
        connection = sqlite3.connect(f"file:{quote(str(path.absolute()))}?{mode}", uri=True)
    except sqlite3.Error as error:
        raise SessionError(f"{path} cannot be opened: {error}.") from error
    with closing(connection):
        connection.setlimit(sqlite3.SQLITE_LIMIT_LENGTH, min(max(size, 2**20), LARGEST))
        connection.execute("PRAGMA trusted_schema = OFF")
        connection.execute("PRAGMA cell_size_check = ON")
        looks, allowed = count(1), 1 + size * _STEPS_PER_BYTE // _STEPS
        connection.set_progress_handler(lambda: next(looks) >= allowed, _STEPS)
        yield connection
