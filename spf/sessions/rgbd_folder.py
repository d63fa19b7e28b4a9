"""What folders with depth and colour beside each other share (TUM RGB-D, Open3D, BOP)."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from spf.errors import SessionError
from spf.frame import Camera
from spf.sessions.camera_file import EXAMPLE, FolderCamera, read_camera_file
from spf.sessions.choice import Choice
from spf.sessions.files import FileSession, check_depth_unit, check_png_sizes
from spf.sessions.png import png_header
from spf.sessions.session import Session

__all__ = ["check_opened", "find_colour", "folder_camera_of", "read_json", "size_of"]

_LARGEST_JSON = 2**27


def read_json(path: Path) -> Any:
    """Read a JSON file that belongs to a recording.

    Raises:
        SessionError: it cannot be read, or is no JSON.
    """
    try:
        if path.stat().st_size > _LARGEST_JSON:
            raise SessionError(f"The file {path} is too large to describe a recording: copy it again.")
        return json.loads(path.read_text(encoding="utf-8-sig"))
    except OSError as error:
        raise SessionError(f"The file {path} cannot be read: {error.strerror}.") from error
    except (ValueError, RecursionError) as error:
        raise SessionError(f"The file {path} is no JSON, it may be torn: copy it again.") from error


def size_of(paths: Sequence[Path]) -> tuple[int, int]:
    """Return the (width, height) that all these PNG images have.

    Raises:
        SessionError: one is damaged or of another size.
    """
    check_png_sizes(paths)
    header = png_header(paths[0])
    return header.width, header.height


def folder_camera_of(path: Path, choice: Choice, size: tuple[int, int], uri: str) -> tuple[Camera, FolderCamera]:
    """Return the camera that was given, or that a ``camera.json`` in the folder tells.

    Raises:
        SessionError: there is none, or it is for images of another size.
    """
    file = path / "camera.json"
    if choice.camera is None and not file.is_file():
        raise SessionError(
            f"{uri} does not say which camera took it: write {file}, like {EXAMPLE}, or give such a file with --camera."
        )
    given = choice.camera or read_camera_file(file)
    return choice._replace(camera=given).fitting(size, uri), given


def find_colour(folder: Path, names: Sequence[str]) -> tuple[Path | None, ...]:
    """Return the colour images in a folder that are called like the depth images, None for each that is not there."""
    if not folder.is_dir():
        return ()
    found = {path.stem: path for path in folder.iterdir() if path.suffix.lower() in (".png", ".jpg", ".jpeg")}
    paths = tuple(found.get(Path(name).stem) for name in names)
    return paths if any(paths) else ()


def check_opened(session: FileSession) -> Session:
    """Check that depth is believable, and leave colour out that is not registered to it.

    Raises:
        SessionError: an image looked at is damaged, or the depth is in another unit.
    """
    check_depth_unit(session)
    first = next((index for index, path in enumerate(session.colour_paths) if path is not None), None)
    if first is None:
        return session
    colour = session.colour(first)
    if colour is not None and colour.shape[:2] == (session.camera.height, session.camera.width):
        return session
    left_out = "The colour images are of another size than the depth, so they are not registered to it: left out."
    return replace(session, colour_paths=(), warnings=(*session.warnings, left_out))
