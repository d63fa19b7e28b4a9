"""Depth sessions: ``open_session`` reads all formats, ``MCAPWriter`` and ``write_session`` write the native one."""

from spf.sessions.mcap_writer import MCAPWriter, write_session
from spf.sessions.opening import FORMATS, Format, open_session
from spf.sessions.session import Note, Session, Side

__all__ = ["FORMATS", "Format", "MCAPWriter", "Note", "Session", "Side", "open_session", "write_session"]
