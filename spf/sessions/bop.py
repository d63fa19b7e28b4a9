"""Scenes of the BOP benchmark: ``scene_camera.json`` with camera and unit of each image, ``depth/`` and ``rgb/``.

Hodaň et al., *BOP: Benchmark for 6D Object Pose Estimation*, ECCV 2018. No times are stored: 30 frames per second are
assumed.
"""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

from spf.errors import SessionError
from spf.frame import Camera
from spf.sessions.choice import Choice
from spf.sessions.files import FileSession, steady_times
from spf.sessions.png import read_depth_png
from spf.sessions.rgbd_folder import check_opened, find_colour, read_json, size_of
from spf.sessions.session import Session

__all__ = ["is_bop", "open_bop"]

_FILE = "scene_camera.json"


def is_bop(path: Path) -> bool:
    """Tell whether a path is a scene of the BOP benchmark."""
    return (path / _FILE).is_file() and (path / "depth").is_dir()


def open_bop(path: Path, choice: Choice, uri: str) -> Session:
    """Open a scene: the images that ``scene_camera.json`` lists, in the order of their numbers.

    Raises:
        SessionError: the list or an image looked at is damaged, no image is there, or its images differ in camera or
            unit.
    """
    entries = _read_entries(path / _FILE)
    present = {number: path / "depth" / f"{number:06d}.png" for number in sorted(entries)}
    present = {number: image for number, image in present.items() if image.is_file()}
    if not present:
        raise SessionError(f"None of the {len(entries)} images listed in {path / _FILE} is in {path / 'depth'}.")
    first = next(iter(present))
    differing = [number for number in present if entries[number] != entries[first]]
    if differing and choice.camera is None:
        raise SessionError(
            f"In {path / _FILE} the images {first} and {differing[0]} have different cameras or units: this is no "
            "recording of one camera."
        )
    paths = tuple(present.values())
    width, height = size_of(paths)
    fx, fy, cx, cy, scale = entries[first]
    camera = Camera(width, height, fx, fy, cx, cy) if choice.camera is None else choice.fitting((width, height), uri)
    names = [image.name for image in paths]
    missing = len(entries) - len(present)
    return check_opened(
        FileSession(
            uri=uri,
            name=f"{path.resolve().parent.name}/{path.resolve().name}",
            format="bop",
            camera=camera,
            times_ns=steady_times(present),
            depth_unit=choice.depth_unit or round(scale * 0.001, 12),
            metadata={"dataset": "BOP"},
            warnings=(f"{missing} images listed in {_FILE} are not in the folder and were left out.",)
            if missing
            else (),
            depth_paths=paths,
            decode=read_depth_png,
            colour_paths=find_colour(path / "rgb", names),
        )
    )


def _read_entries(path: Path) -> dict[int, tuple[float, float, float, float, float]]:
    """Return number → (fx, fy, cx, cy, mm per count)."""
    said: Any = read_json(path)
    try:
        return {int(number): _entry(entry) for number, entry in said.items()}
    except (AttributeError, KeyError, TypeError, ValueError, OverflowError) as error:
        raise SessionError(
            f"The file {path} is damaged: it should give cam_K and depth_scale of each image."
        ) from error


def _entry(entry: dict[str, Any]) -> tuple[float, float, float, float, float]:
    fx, _, cx, _, fy, cy, *_ = map(float, entry["cam_K"])
    scale = float(entry["depth_scale"])
    if not all(map(math.isfinite, (fx, fy, cx, cy, scale))) or min(fx, fy, scale) <= 0:
        raise ValueError("impossible numbers")
    return fx, fy, cx, cy, scale
