"""ROS 2 bags in SQLite (``.db3``), with or without their ``metadata.yaml``; RealSense records such files too."""

from __future__ import annotations

import sqlite3
from collections.abc import Iterator
from contextlib import closing, contextmanager
from pathlib import Path
from urllib.parse import quote

import zstandard

from spf.errors import SessionError
from spf.sessions.bag import LARGEST_CHUNK, Bag, Topic, damaged, unpack_message

__all__ = ["MAGIC", "SqliteBag", "is_sqlite_bag"]

MAGIC = b"SQLite format 3\0"

#: Steps of SQLite's virtual machine that one query may take for each byte of the file: more is a damaged file.
_STEPS_PER_BYTE = 50


class SqliteBag(Bag):
    """A ROS 2 bag in one SQLite file.

    Args:
        path: the file.
        packed: each message is compressed (``compression_mode: MESSAGE`` in ``metadata.yaml``).

    Raises:
        SessionError: it is damaged.
    """

    kind = "ROS 2 bag (SQLite)"
    cdr = True

    def __init__(self, path: Path, packed: bool = False) -> None:
        self.path, self._packed = path, packed
        self._rows: dict[str, list[tuple[int, int]]] = {}
        try:
            with _connected(path) as connection:
                topics = connection.execute("SELECT id, name, type FROM topics").fetchall()
                names = {number: str(name) for number, name, _ in topics}
                self._rows = {name: [] for name in names.values()}
                query = "SELECT topic_id, timestamp, id FROM messages ORDER BY timestamp, id"
                for number, time, row in connection.execute(query):
                    if number in names:
                        self._rows[names[number]].append((int(time), int(row)))
            self.topics = {
                str(name): Topic(str(name), str(kind), len(self._rows[str(name)])) for _, name, kind in topics
            }
        except (sqlite3.Error, ValueError, TypeError, OverflowError) as error:
            raise damaged(path, str(error)) from error

    def times(self, topic: str) -> list[int]:
        """Return when the messages of a topic were recorded, in ns."""
        return [time for time, _ in self._rows[topic]]

    def read(self, topic: str, position: int) -> bytes:
        """Return a message."""
        data = self._fetch("SELECT data FROM messages WHERE id = ?", topic, position)
        if not self._packed:
            return data
        try:
            return unpack_message(data)
        except (zstandard.ZstdError, ValueError, MemoryError) as error:
            raise damaged(self.path, f"message {position} of {topic}") from error

    def heads(self, topic: str) -> Iterator[bytes]:
        """Yield the first bytes of all messages of a topic; none where it is damaged."""
        if self._packed:
            yield from super().heads(topic)
            return
        try:
            with _connected(self.path) as connection:
                for _, row in self._rows[topic]:
                    query = "SELECT substr(data, 1, 16) FROM messages WHERE id = ?"
                    found = connection.execute(query, (row,)).fetchone()
                    yield found[0] if found and isinstance(found[0], bytes) else b""
        except (sqlite3.Error, ValueError, OverflowError) as error:
            raise damaged(self.path, str(error)) from error

    def _fetch(self, query: str, topic: str, position: int) -> bytes:
        try:
            with _connected(self.path) as connection:
                row = connection.execute(query, (self._rows[topic][position][1],)).fetchone()
        except (sqlite3.Error, ValueError, OverflowError) as error:
            raise damaged(self.path, str(error)) from error
        if row is None or not isinstance(row[0], bytes):
            raise damaged(self.path, f"message {position} of {topic}")
        return row[0]


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
        connection.setlimit(sqlite3.SQLITE_LIMIT_LENGTH, min(max(size, 2**20), LARGEST_CHUNK))
        connection.execute("PRAGMA trusted_schema = OFF")
        connection.execute("PRAGMA cell_size_check = ON")
        connection.set_progress_handler(lambda: 1, max(size * _STEPS_PER_BYTE, 10**6))
        yield connection
