"""Copy sessions into the native format, whole or in part; a copy has its name only when it is complete."""

from __future__ import annotations

import math
import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

from spf.sessions.mcap_writer import MCAPWriter, UnwritableError, already_there
from spf.sessions.session import Session

__all__ = ["copy_frames", "copying", "write_session"]


@contextmanager
def copying(session: Session, path: str | Path, *, overwrite: bool = False) -> Iterator[MCAPWriter]:
    """Give a writer for frames of a session; what was written gets its name at the end, and is gone after an error.

    Args:
        session: any session, whose camera, unit, side, … are taken over.
        path: the file to write.
        overwrite: replace a file that is there.

    Raises:
        SessionError: the file exists or cannot be written.
    """
    target = Path(path)
    part = target.with_name(f".{target.name}.part")
    if target.exists() and not overwrite:
        raise already_there(target)
    try:
        with MCAPWriter(
            part,
            camera=session.camera,
            depth_unit=session.depth_unit,
            side=session.side,
            joint_definition=session.joint_definition,
            hand_shape=session.hand_shape,
            start_time_ns=session.start_time_ns,
            metadata=session.metadata,
            overwrite=True,
        ) as writer:
            yield writer
        os.replace(part, target)
    except UnwritableError as error:
        raise UnwritableError(target, error.cause, "Nothing of it was kept.") from error
    finally:
        if part.is_file():
            part.unlink()


def copy_frames(
    session: Session,
    writer: MCAPWriter,
    first: int,
    last: int,
    progress: Callable[[int, int], None] | None = None,
) -> None:
    """Write the frames [first, last) of a session, and the notes of their time.

    A note belongs to the frame before it, those before the first frame to the first: of the parts that a session is split
    into, exactly one has it.

    Args:
        session: to copy from.
        writer: to copy to.
        first: of the frames.
        last: the first frame after them.
        progress: called with (frames done, frames in all) after each frame.

    Raises:
        SessionError: a frame cannot be read or written.
    """
    begin = session.times[first] if first else -math.inf
    end = session.times[last] if last < len(session) else math.inf
    for note in session.notes:
        if begin <= note.time < end:
            writer.add_note(note)
    for done, index in enumerate(range(first, last), 1):
        writer.write(session[index])
        if progress is not None:
            progress(done, last - first)


def write_session(
    session: Session,
    path: str | Path,
    *,
    overwrite: bool = False,
    progress: Callable[[int, int], None] | None = None,
) -> None:
    """Write a whole session into the native format; the file has its name only when it is complete.

    Args:
        session: any session.
        path: the file to write.
        overwrite: replace a file that is there.
        progress: called with (frames done, frames in all) after each frame.

    Raises:
        SessionError: the file exists or cannot be written, or a frame cannot be read.
    """
    with copying(session, path, overwrite=overwrite) as writer:
        copy_frames(session, writer, 0, len(session), progress)
