"""Depth sessions: ``open_session`` reads all formats, ``MCAPWriter`` and ``write_session`` write the native one."""

from spf.sessions.copying import copy_frames, copying, write_session
from spf.sessions.marked import keep_marks, marks_in, with_marks
from spf.sessions.marks import Mark, Marks
from spf.sessions.mcap_writer import MCAPWriter
from spf.sessions.opening import FORMATS, Format, open_session
from spf.sessions.session import Note, Session, Side

__all__ = [
    "FORMATS",
    "Format",
    "MCAPWriter",
    "Mark",
    "Marks",
    "Note",
    "Session",
    "Side",
    "copy_frames",
    "copying",
    "keep_marks",
    "marks_in",
    "open_session",
    "with_marks",
    "write_session",
]
