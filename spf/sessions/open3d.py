"""Recordings in Open3D's layout: ``depth/``, ``color/`` and the camera in a JSON file, as its recorders write them."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

from spf.errors import SessionError
from spf.frame import Camera
from spf.sessions.choice import Choice
from spf.sessions.files import FileSession, list_files, steady_times
from spf.sessions.png import read_depth_png
from spf.sessions.rgbd_folder import check_opened, find_colour, folder_camera_of, read_json, size_of
from spf.sessions.session import Session

__all__ = ["is_open3d", "open_open3d"]

_CAMERA_FILES = ("intrinsic.json", "camera_intrinsic.json", "intrinsics.json", "camera.json")
_COLOUR_FOLDERS = ("color", "image", "rgb")
_IMAGES = r".+\.png"
_COUNTS_PER_METRE = 1000.0  # Open3D's own default
_RATE = 30.0


def is_open3d(path: Path) -> bool:
    """Tell whether a path is a folder with depth images in ``depth/``."""
    return (path / "depth").is_dir() and bool(list_files(path / "depth", _IMAGES))


def open_open3d(path: Path, choice: Choice, uri: str) -> Session:
    """Open a recording in Open3D's layout.

    Raises:
        SessionError: an image looked at or the camera file is damaged, the camera is not told, or the unit is not
            believable.
    """
    paths = tuple(list_files(path / "depth", _IMAGES))
    size = size_of(paths)
    file = next((path / name for name in _CAMERA_FILES if (path / name).is_file()), None)
    said = read_json(file) if file is not None else {}
    if choice.camera is None and file is not None and isinstance(said, dict) and "intrinsic_matrix" in said:
        camera, unit, rate = _read_camera(file, said, size)
    else:
        camera, given = folder_camera_of(path, choice, size, uri)
        unit, rate = given.depth_unit or 1 / _COUNTS_PER_METRE, given.fps
    names = [each.name for each in paths]
    colours = (find_colour(path / folder, names) for folder in _COLOUR_FOLDERS)
    device = said.get("device_name", "") if isinstance(said, dict) else ""
    return check_opened(
        FileSession(
            uri=uri,
            name=path.resolve().name,
            format="open3d",
            camera=camera,
            times_ns=steady_times(range(len(paths)), rate),
            depth_unit=choice.unit or unit,
            metadata={"sensor": str(device)} if device else {},
            depth_paths=paths,
            decode=read_depth_png,
            colour_paths=next(filter(None, colours), ()),
        )
    )


def _read_camera(path: Path, said: dict[str, Any], size: tuple[int, int]) -> tuple[Camera, float, float]:
    """Return the camera, metres per count and frames per second that Open3D's camera file says."""
    try:
        # Column by column, as Open3D writes matrices.
        fx, a, b, skew, fy, c, cx, cy, one = map(float, said["intrinsic_matrix"])
        width, height = int(said.get("width", size[0])), int(said.get("height", size[1]))
        per_metre, rate = float(said.get("depth_scale", _COUNTS_PER_METRE)), float(said.get("fps", _RATE))
    except (TypeError, ValueError, OverflowError) as error:
        raise SessionError(f"The camera in {path} is damaged: give one with --camera.") from error
    numbers = (fx, fy, cx, cy, per_metre, rate)
    if (
        not all(map(math.isfinite, numbers))
        or min(fx, fy, per_metre, rate) <= 0
        or (a, b, skew, c, one) != (0, 0, 0, 0, 1)
    ):
        raise SessionError(f"The camera in {path} has impossible numbers: give one with --camera.")
    if (width, height) != size:
        raise SessionError(
            f"The depth images beside {path} are {size[0]}×{size[1]}, but its camera is for {width}×{height}: "
            "give the camera of the depth with --camera."
        )
    return Camera(width, height, fx, fy, cx, cy), 1 / per_metre, rate
