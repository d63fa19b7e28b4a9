"""Which files of the server a page may open: those in the folders that the server was started with, and no other."""

from __future__ import annotations

import atexit
import os
import shutil
import tempfile
from functools import lru_cache
from pathlib import Path

from spf.errors import SpfError
from spf.live.uri import parse_live_uri
from spf.sessions.choice import split_uri

__all__ = [
    "SAMPLES",
    "OutsideError",
    "allowed",
    "allowed_session",
    "allowed_source",
    "folders",
    "runs_folder",
    "uploads_folder",
]

#: Where the sample sessions are, and where new captures land.
SAMPLES = Path(__file__).resolve().parent.parent / "sessions"


class OutsideError(SpfError):
    """A path leads out of the folders that a page may open."""


def runs_folder() -> Path:
    """Return the folder of all runs: ``SPF_RUNS``, or ``runs`` in the working directory."""
    return Path(os.environ.get("SPF_RUNS", "runs"))


@lru_cache(maxsize=1)
def uploads_folder() -> Path:
    """Return the folder of all uploads, which nobody else may read; it goes with the server."""
    folder = Path(tempfile.mkdtemp(prefix="spf-uploads-"))
    atexit.register(shutil.rmtree, folder, ignore_errors=True)
    return folder


def folders() -> tuple[Path, ...]:
    """Return the folders that a page may open files of.

    They are those of ``SPF_SESSIONS`` (separated like those of ``PATH``; the working directory where it is not set), and
    always the project's own sessions, the runs and the uploads.
    """
    chosen = os.environ.get("SPF_SESSIONS")
    own = ["."] if chosen is None else [part for part in chosen.split(os.pathsep) if part]
    return (*(Path(part).expanduser() for part in own), SAMPLES, runs_folder(), uploads_folder())


def allowed(path: str | Path) -> Path:
    """Return the absolute path of a file or folder that a page may open, whether it exists or not.

    Raises:
        OutsideError: it leads out of :func:`folders`, itself or by ``..`` or a link.
    """
    try:
        absolute = Path(path).expanduser().absolute()
        real = absolute.resolve()
    except (OSError, RuntimeError, ValueError):  # links in a circle, a user who does not exist, a name that cannot be
        raise OutsideError(f"{str(path)!r} is no path that can be opened: check it.") from None
    if any(real.is_relative_to(folder.resolve()) for folder in folders()):
        return absolute
    raise OutsideError(
        f"{path} is in none of the folders that this page may open: move the file into one of them, upload it, or start the "
        f"server with SPF_SESSIONS={_folder_of(absolute)} (several are joined by {os.pathsep})."
    )


def _folder_of(path: Path) -> Path:
    return path if path.parent == path else path.parent


def allowed_session(uri: str, camera: str | None = None) -> tuple[str, str | None]:
    """Return the URI and camera file of a session that a page may open, with absolute paths.

    Raises:
        OutsideError: the session or a camera file, beside the URI or behind its ``?``, leads out of :func:`folders`.
        SessionError: what follows the ``?`` cannot be chosen.
    """
    try:
        path, options = split_uri(Path(uri).expanduser())
    except (OSError, RuntimeError):
        raise OutsideError(f"{uri!r} is no path that can be opened: check it.") from None
    absolute = allowed(path)
    if "camera" in options:
        allowed(options["camera"])
    query = f"?{uri.rpartition('?')[2]}" if options else ""
    return f"{absolute}{query}", None if camera is None else str(allowed(camera))


def allowed_source(text: str) -> str:
    """Return the URI of a live sensor that a page may connect to.

    Raises:
        OutsideError: it replays a recording, or takes a camera file, out of :func:`folders`.
        SensorError: its options cannot be read.
    """
    uri = parse_live_uri(text)
    if uri.scheme == "replay":
        allowed(uri.place)
    if "camera" in uri.options:
        allowed(uri.options["camera"])
    return text
