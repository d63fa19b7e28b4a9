"""CVAR hand recordings: 16-bit PNG in mm and ``joint.txt``.

Oberweger, Riegler, Wohlhart, Lepetit, *Efficiently creating 3D training data for fine hand pose estimation*, CVPR 2016.
Creative Senz3D; no times are stored, 30 frames per second are assumed.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from spf.errors import SessionError
from spf.frame import Camera
from spf.sessions.files import (
    FileSession,
    check_depth_unit,
    check_png_sizes,
    joints_from_image,
    list_files,
    read_lines,
    steady_times,
)
from spf.sessions.joint_order import WRIST_THEN_INDEX_TO_THUMB, arrange_joints
from spf.sessions.png import read_depth_png
from spf.sessions.session import Session

__all__ = ["CAMERA", "is_cvar", "open_cvar"]

CAMERA = Camera(width=320, height=240, fx=224.5, fy=230.5, cx=160.0, cy=120.0)

#: Counts from here on are the sensor's mark for "no reading" (32001) or far behind the hand, in mm.
_NO_READING_MM = 2000


def is_cvar(path: Path) -> bool:
    """Tell whether a path is a CVAR recording: a folder with ``joint.txt`` and PNG images."""
    return (path / "joint.txt").is_file() and bool(list_files(path, r".+\.png"))


def open_cvar(path: Path) -> Session:
    """Open a CVAR recording: the images that ``joint.txt`` lists, in its order.

    Raises:
        SessionError: ``joint.txt`` or an image looked at is damaged, or no listed image is in the folder.
    """
    names, uvz = _read_joints(path / "joint.txt")
    present = [position for position, name in enumerate(names) if (path / name).is_file()]
    if not present:
        raise SessionError(f"None of the {len(names)} images listed in {path / 'joint.txt'} is in the folder.")
    paths = tuple(path / names[position] for position in present)
    check_png_sizes(paths)
    session = FileSession(
        uri=str(path),
        name=path.name,
        format="cvar",
        camera=CAMERA,
        times_ns=steady_times(present),
        joint_definition="cvar",
        has_truth=True,
        metadata={"dataset": "CVAR", "recording": path.name, "sensor": "Creative Senz3D"},
        warnings=_warnings(path, names, present),
        depth_paths=paths,
        decode=_read_depth,
        joints=_to_camera_frame(uvz[present]),
    )
    check_depth_unit(session)
    return session


def _read_depth(path: Path) -> NDArray[np.uint16]:
    raw = read_depth_png(path)
    if raw.shape[1] == CAMERA.width + 1:  # some recordings (P1) were stored one column wider than the sensor
        raw = np.ascontiguousarray(raw[:, :-1])
    raw[raw >= _NO_READING_MM] = 0
    return raw


def _read_joints(path: Path) -> tuple[list[str], NDArray[np.float64]]:
    lines = read_lines(path)
    if lines and len(lines[0][1]) == 1 and lines[0][1][0].isdecimal():
        lines = lines[1:]  # the number of frames; the lines themselves count
    if not lines:
        raise SessionError(f"The file {path} lists no frame: copy it again.")
    values = np.empty((len(lines), 21, 3))
    for row, (number, words) in enumerate(lines):
        try:
            values[row] = np.array(words[1:], dtype=np.float64).reshape(21, 3)
        except ValueError as error:
            raise SessionError(
                f"Line {number} of {path} is damaged: it should be an image name and 63 numbers; copy the file again."
            ) from error
    # The names tell where the images lay when they were annotated: only the last part holds here.
    return [words[0].replace("\\", "/").rsplit("/", 1)[-1] for _, words in lines], values


def _to_camera_frame(uvz: NDArray[np.float64]) -> NDArray[np.float64]:
    points = joints_from_image(uvz, (CAMERA.fx, CAMERA.fy), (CAMERA.cx, CAMERA.cy))
    return arrange_joints(points, WRIST_THEN_INDEX_TO_THUMB)


def _warnings(path: Path, names: list[str], present: list[int]) -> tuple[str, ...]:
    found = {names[position] for position in present}
    missing = [name for name in names if name not in found]
    unlisted = [image.name for image in list_files(path, r".+\.png") if image.name not in found]
    warnings = []
    if missing:
        warnings.append(
            f"{len(missing)} images listed in joint.txt are not in the folder and were left out, first {missing[0]}."
        )
    if unlisted:
        warnings.append(f"{len(unlisted)} images are not listed in joint.txt and were left out, first {unlisted[0]}.")
    return tuple(warnings)
