"""A plain folder of 16-bit depth PNGs with a camera file."""

from __future__ import annotations

from functools import partial
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from spf.errors import SessionError
from spf.sessions.camera_file import EXAMPLE, FolderCamera, read_camera_file
from spf.sessions.choice import Choice
from spf.sessions.files import FileSession, check_depth_unit, check_png_sizes, list_files, steady_times
from spf.sessions.png import png_header, read_depth_png
from spf.sessions.session import Session

__all__ = ["folder_camera", "is_png_folder", "open_png_folder"]

_IMAGES = r".+\.png"
_UNIT = 0.001  # metres per count where the camera file does not say it


def is_png_folder(path: Path) -> bool:
    """Tell whether a path is a folder with PNG images."""
    return path.is_dir() and bool(list_files(path, _IMAGES))


def open_png_folder(path: Path, choice: Choice, uri: str) -> Session:
    """Open a folder of 16-bit depth PNGs, in the natural order of their names.

    Args:
        path: the folder.
        choice: a camera, else ``camera.json`` in the folder tells it; a depth unit.
        uri: of the session.

    Raises:
        SessionError: there is no camera file, it or an image is damaged, images differ in size, or the depth is in
            another unit.
    """
    paths = tuple(list_files(path, _IMAGES))
    check_png_sizes(paths)
    header = png_header(paths[0])
    given = choice.camera or folder_camera(path)
    camera = choice._replace(camera=given).fitting((header.width, header.height), uri)
    session = FileSession(
        uri=uri,
        name=path.resolve().name,
        format="png-folder",
        camera=camera,
        times_ns=steady_times(range(len(paths)), given.fps),
        depth_unit=choice.unit or given.depth_unit or _UNIT,
        side=given.side,
        metadata={"sensor": given.sensor} if given.sensor else {},
        depth_paths=paths,
        decode=partial(_read_depth, no_reading=given.no_reading, max_valid=given.max_valid),
    )
    check_depth_unit(session)
    return session


def folder_camera(folder: Path) -> FolderCamera:
    """Read the camera file in a folder.

    Raises:
        SessionError: there is none, or it is damaged.
    """
    file = folder / "camera.json"
    if not file.is_file():
        raise SessionError(
            f"There is no camera file {file}: write one like {EXAMPLE} (pixels, and metres per count), or give one."
        )
    return read_camera_file(file)


def _read_depth(path: Path, no_reading: tuple[int, ...], max_valid: int | None) -> NDArray[np.uint16]:
    raw = read_depth_png(path)
    if no_reading:
        raw[np.isin(raw, no_reading)] = 0
    if max_valid is not None:
        raw[raw > max_valid] = 0
    return raw
