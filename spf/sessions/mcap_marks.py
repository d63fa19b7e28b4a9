"""Put marks into a native session file: what was recorded stays byte for byte, and only the end of the file is new."""

from __future__ import annotations

import os
import shutil
from io import BytesIO
from pathlib import Path
from typing import BinaryIO

from mcap.data_stream import ReadDataStream, RecordBuilder
from mcap.opcode import Opcode
from mcap.records import DataEnd, Footer, Metadata, MetadataIndex, Statistics
from mcap.writer import MCAP0_MAGIC

from spf.errors import SessionError
from spf.sessions.mcap_index import DAMAGE, index_file, records_in
from spf.sessions.mcap_messages import MARKS_RECORD, SESSION_RECORD

__all__ = ["embed_marks"]

_LENGTH = 8  # bytes that say how long a record is
_BLOCK = 1 << 20  # bytes copied at once


def embed_marks(path: Path, content: str) -> None:
    """Put marks into a session file, in place of those that it held; the file before is there until the new one is whole.

    Args:
        path: of the file.
        content: from :func:`spf.sessions.marks.marks_to_json`.

    Raises:
        SessionError: it is no native session, was torn, or cannot be written.
    """
    if SESSION_RECORD not in index_file(path).metadata:
        raise SessionError(
            f"{path} is not in the project's own format: 'spf convert {path} OUT.mcap' makes one that is."
        )
    part = path.with_name(f".{path.name}.part")
    try:
        with path.open("rb") as old, part.open("wb") as new:
            end, records = _tail(old, path)
            _copy(old, new, end)
            new.write(_new_tail(end, records, content))
            new.flush()
            os.fsync(new.fileno())
        shutil.copymode(path, part)
        os.replace(part, path)
    except OSError as error:
        raise SessionError(f"{path} cannot be written: {error.strerror}. It is as it was before.") from error
    finally:
        part.unlink(missing_ok=True)


def _copy(old: BinaryIO, new: BinaryIO, size: int) -> None:
    """Copy the first bytes of a file."""
    old.seek(0)
    while size > 0:
        block = old.read(min(size, _BLOCK))
        new.write(block)
        size -= len(block) or size


def _tail(file: BinaryIO, path: Path) -> tuple[int, list[tuple[int, bytes]]]:
    """Return where the data ends, and the records (opcode, content) of the summary behind it."""
    footer, ending = RecordBuilder(), RecordBuilder()
    Footer(0, 0, 0).write(footer)
    DataEnd(0).write(ending)
    try:
        _, _, content = next(records_in(file, file.seek(0, 2) - len(MCAP0_MAGIC) - footer.count))
        begin = Footer.read(ReadDataStream(BytesIO(content))).summary_start - ending.count
        found = list(records_in(file, begin))
        if found[0][0] != Opcode.DATA_END or found[-1][0] != Opcode.FOOTER:
            raise ValueError(begin)
    except (*DAMAGE, StopIteration, OSError) as error:
        raise SessionError(
            f"{path} was torn: 'spf convert {path} OUT.mcap' writes a whole file, which can hold marks."
        ) from error
    return begin, [(opcode, content) for opcode, _, content in found[1:]]


def _new_tail(end: int, records: list[tuple[int, bytes]], marks: str) -> bytes:
    """Return what stands behind the data: the marks, the end of the data, the summary with the marks in it, the footer."""
    tail = RecordBuilder()
    Metadata(MARKS_RECORD, {"marks": marks}).write(tail)
    index = MetadataIndex(end, tail.count, MARKS_RECORD)
    DataEnd(0).write(tail)
    summary = end + tail.count
    is_written = False
    for opcode, content in [item for item in records if item[0] not in (Opcode.SUMMARY_OFFSET, Opcode.FOOTER)]:
        if opcode == Opcode.METADATA_INDEX:
            if MetadataIndex.read(ReadDataStream(BytesIO(content))).name == MARKS_RECORD:
                continue
            if not is_written:  # all of a kind stand together
                index.write(tail)
                is_written = True
        if opcode == Opcode.STATISTICS:
            counted = Statistics.read(ReadDataStream(BytesIO(content)))
            counted.metadata_count += 1
            counted.write(tail)
            continue
        tail.write(bytes([opcode]) + len(content).to_bytes(_LENGTH, "little") + content)
    assert is_written, "a native session has metadata records"
    Footer(summary, 0, 0).write(tail)
    tail.write(MCAP0_MAGIC)
    return bytes(tail.end())
