"""A plain folder of 16-bit depth PNGs with a camera file."""

from __future__ import annotations

from functools import partial
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from spf.errors import SessionError
from spf.frame import Camera
from spf.sessions.camera_file import EXAMPLE, FolderCamera, read_camera_file
from spf.sessions.files import FileSession, check_depth_unit, check_png_sizes, list_files, steady_times
from spf.sessions.png import png_header, read_depth_png
from spf.sessions.session import Session

__all__ = ["is_png_folder", "open_png_folder"]

_IMAGES = r".+\.png"


def is_png_folder(path: Path) -> bool:
    """Tell whether a path is a folder with PNG images."""
    return path.is_dir() and bool(list_files(path, _IMAGES))


def open_png_folder(path: Path, camera: Camera | Path | None = None) -> Session:
    """Open a folder of 16-bit depth PNGs, in the natural order of their names.

    Args:
        path: the folder.
        camera: the camera or a camera file outside the folder; None: ``camera.json`` in the folder.

    Raises:
        SessionError: there is no camera file, it or an image is damaged, images differ in size, or the depth is in
            another unit.
    """
    paths = tuple(list_files(path, _IMAGES))
    check_png_sizes(paths)
    header = png_header(paths[0])
    given = _camera(path, camera)
    width, height = given.width or header.width, given.height or header.height
    if (width, height) != (header.width, header.height):
        raise SessionError(
            f"The images in {path} are {header.width}×{header.height}, but the camera given is {width}×{height}: "
            "give the width, height and focal lengths of the images."
        )
    session = FileSession(
        uri=str(path),
        name=path.resolve().name,
        format="png-folder",
        camera=given.camera(width, height),
        times_ns=steady_times(range(len(paths)), given.fps),
        depth_unit=given.depth_unit,
        side=given.side,
        metadata={"sensor": given.sensor} if given.sensor else {},
        depth_paths=paths,
        decode=partial(_read_depth, no_reading=given.no_reading, max_valid=given.max_valid),
    )
    check_depth_unit(session)
    return session


def _camera(folder: Path, camera: Camera | Path | None) -> FolderCamera:
    if isinstance(camera, Camera):
        return FolderCamera.of(camera)
    file = camera or folder / "camera.json"
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
