"""NYU hand pose: ``depth_1_NNNNNNN.png`` and ``joint_data.mat``, of the first of its three Kinects.

Tompson, Stein, LeCun, Perlin, *Real-time continuous pose recovery of human hands using convolutional networks*,
TOG 2014. No times are stored, 30 frames per second are assumed.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from spf.errors import SessionError
from spf.frame import JOINT_NAMES, Camera
from spf.sessions.files import FileSession, check_depth_unit, check_png_sizes, list_files, steady_times
from spf.sessions.joint_order import arrange_joints
from spf.sessions.mat_file import read_mat_array
from spf.sessions.png import read_packed_depth_png
from spf.sessions.session import Session

__all__ = ["CAMERA", "is_nyu", "open_nyu"]

CAMERA = Camera(width=640, height=480, fx=588.03, fy=587.07, cx=320.0, cy=240.0)

_DEPTH = r"depth_1_\d+\.png"

#: The set marks each bone at its neck (A) and at its base (B); a joint of ours is the base of the bone that it moves.
_FINGERS = {"F1": "little", "F2": "ring", "F3": "middle", "F4": "index", "TH": "thumb"}
_MARKS = ("KNU3_A", "KNU3_B", "KNU2_A", "KNU2_B", "KNU1_A", "KNU1_B")
_FINGER_JOINTS = {"KNU3_A": "tip", "KNU3_B": "dip", "KNU2_B": "pip", "KNU1_B": "mcp"}
_THUMB_JOINTS = {"KNU3_A": "tip", "KNU3_B": "ip", "KNU2_B": "mp", "KNU1_B": "tm"}
_PALM_1, _PALM_2 = 30, 31  # the two sides of the wrist
_MARK_COUNT = 36


def is_nyu(path: Path) -> bool:
    """Tell whether a path is a part of the NYU set: a folder with ``depth_1_NNNNNNN.png`` images."""
    return path.is_dir() and bool(list_files(path, _DEPTH))


def open_nyu(path: Path) -> Session:
    """Open a part of the NYU set; row ``n - 1`` of ``joint_data.mat``, if there is one, belongs to ``depth_1_n.png``.

    Raises:
        SessionError: ``joint_data.mat`` or an image looked at is damaged, or images differ in size.
    """
    paths = list_files(path, _DEPTH)
    check_png_sizes(paths)
    numbers = [int(file.stem.split("_")[2]) for file in paths]
    joints, warnings = _read_joints(path / "joint_data.mat", numbers)
    colour = [path / file.name.replace("depth", "rgb", 1) for file in paths]
    session = FileSession(
        uri=str(path),
        name=f"nyu-{path.resolve().name}",
        format="nyu",
        camera=CAMERA,
        times_ns=steady_times(numbers),
        joint_definition="nyu",
        has_truth=joints is not None,
        metadata={"dataset": "NYU", "recording": path.name, "sensor": "Kinect"},
        warnings=warnings,
        depth_paths=tuple(paths),
        decode=read_packed_depth_png,
        joints=joints,
        colour_paths=tuple(file if file.is_file() else None for file in colour),
    )
    check_depth_unit(session)
    return session


def _names() -> list[str | None]:
    names: list[str | None] = []
    for finger in _FINGERS.values():
        joints = _THUMB_JOINTS if finger == "thumb" else _FINGER_JOINTS
        names += [f"{finger}_{joints[mark]}" if mark in joints else None for mark in _MARKS]
    return names + [None] * (_MARK_COUNT - len(names))


def _read_joints(path: Path, numbers: list[int]) -> tuple[NDArray[np.float64] | None, tuple[str, ...]]:
    if not path.is_file():
        return None, ("There is no joint_data.mat in the folder, so there is no truth.",)
    xyz_mm = read_mat_array(path, "joint_xyz")
    xyz_mm = xyz_mm[0] if len(xyz_mm) else xyz_mm
    if xyz_mm.ndim != 3 or xyz_mm.shape[1:] != (_MARK_COUNT, 3):
        raise SessionError(f"The file {path} holds no joint_xyz of 36 joints a frame: copy it again.")
    with np.errstate(invalid="ignore"):  # a damaged number stays none
        xyz = xyz_mm * np.array([1e-3, -1e-3, 1e-3])  # y points up there
    listed = arrange_joints(xyz, _names())
    listed[:, JOINT_NAMES.index("wrist")] = (xyz[:, _PALM_1] + xyz[:, _PALM_2]) / 2
    joints = np.full((len(numbers), len(JOINT_NAMES), 3), np.nan)
    with_truth = [row for row, number in enumerate(numbers) if 1 <= number <= len(listed)]
    joints[with_truth] = listed[[numbers[row] - 1 for row in with_truth]]
    without = len(numbers) - len(with_truth)
    return joints, (f"{without} frames have no row in joint_data.mat and so no truth.",) if without else ()
