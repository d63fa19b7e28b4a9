"""What all pages of a server share: compiled kernels, one renderer, and the sessions that someone has opened."""

from __future__ import annotations

import atexit
from functools import lru_cache

import panel as pn

from app.folders import SAMPLES, allowed, allowed_session
from app.kernels import Kernels
from spf.progress import Report, silent
from spf.render import Renderer
from spf.sessions import Session, open_session
from spf.sessions.choice import split_uri
from spf.sessions.marks import marks_file

__all__ = ["SAMPLES", "bundled", "kernels", "open_shared", "renderer"]

_KEPT = 3600  # s that an opened session is kept for the next who asks


@lru_cache(maxsize=1)
def renderer() -> Renderer:
    """Return the server's renderer, started at the first call."""
    shared = Renderer()
    atexit.register(shared.close)
    return shared


@lru_cache(maxsize=1)
def kernels() -> Kernels:
    """Return the server's kernels, being compiled since the first call."""
    shared = Kernels()
    atexit.register(shared.close)
    return shared


def bundled() -> dict[str, str]:
    """Return name → path of the sessions in the project's own folder."""
    return {path.stem: str(path) for path in sorted(SAMPLES.glob("*.mcap"))}


def open_shared(uri: str, camera: str | None, report: Report = silent) -> Session:
    """Open a session once for all pages; a file that changed, or whose marks did, is opened again.

    Raises:
        OutsideError: it, or the marks beside it, are in none of the folders that a page may open.
        SessionError: see :func:`spf.sessions.open_session`.
    """
    uri, camera = allowed_session(uri, camera)
    path, _ = split_uri(uri)
    files = [file for file in (path, marks_file(path)) if file.exists()]
    stamp = [allowed(file).stat().st_mtime_ns for file in files]
    session: Session = pn.state.as_cached(
        f"session {uri} {camera} {stamp}", lambda: open_session(uri, camera, report), ttl=_KEPT
    )
    return session
