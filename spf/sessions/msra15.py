"""MSRA15 hand gestures: one ``NNNNNN_depth.bin`` a frame and ``joint.txt``.

Sun, Wei, Liang, Tang, Sun, *Cascaded hand pose regression*, CVPR 2015. Creative Interactive Gesture Camera;
no times are stored, 30 frames per second are assumed.

The files hold float32 millimetres. Raw counts here are tenths of a millimetre: exact for whole (and tenths of)
millimetres, within 0.05 mm for anything else, up to 6.55 m.
"""

from __future__ import annotations

import struct
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from spf.errors import SessionError
from spf.frame import Camera
from spf.sessions.files import FileSession, check_depth_unit, list_files, read_lines, steady_times
from spf.sessions.joint_order import WRIST_THEN_INDEX_TO_THUMB, arrange_joints
from spf.sessions.session import Session

__all__ = ["CAMERA", "is_msra15", "open_msra15"]

CAMERA = Camera(width=320, height=240, fx=241.42, fy=241.42, cx=160.0, cy=120.0)

_BIN = r"\d+_depth\.bin"
_COUNTS_PER_MM = 10
_MOST = 65535


def is_msra15(path: Path) -> bool:
    """Tell whether a path is an MSRA15 gesture: a folder with ``joint.txt`` and ``NNNNNN_depth.bin`` files."""
    return (path / "joint.txt").is_file() and bool(list_files(path, _BIN))


def open_msra15(path: Path) -> Session:
    """Open an MSRA15 gesture; line ``n + 2`` of ``joint.txt`` holds the joints of ``n_depth.bin``.

    Raises:
        SessionError: ``joint.txt`` or a depth file looked at is damaged.
    """
    paths = list_files(path, _BIN)
    numbers = [int(file.name.split("_")[0]) for file in paths]
    listed = _read_joints(path / "joint.txt")
    joints = np.full((len(paths), 21, 3), np.nan)
    with_truth = [row for row, number in enumerate(numbers) if number < len(listed)]
    joints[with_truth] = listed[[numbers[row] for row in with_truth]]
    session = FileSession(
        uri=str(path),
        name=f"{path.resolve().parent.name}-{path.resolve().name}",
        format="msra15",
        camera=CAMERA,
        times_ns=steady_times(numbers),
        depth_unit=1e-3 / _COUNTS_PER_MM,
        joint_definition="msra15",
        has_truth=bool(with_truth),
        metadata={"dataset": "MSRA15", "recording": path.name, "sensor": "Creative Interactive Gesture Camera"},
        warnings=_warnings(len(paths) - len(with_truth), len(listed) - len(with_truth)),
        depth_paths=tuple(paths),
        decode=_read_depth,
        joints=joints,
    )
    check_depth_unit(session)
    return session


def _read_depth(path: Path) -> NDArray[np.uint16]:
    try:
        data = path.read_bytes()
    except OSError as error:
        raise SessionError(f"The depth file {path} cannot be read: {error.strerror}.") from error
    torn = SessionError(f"The depth file {path} is torn: copy it again, or take it out of the folder.")
    if len(data) < 24:
        raise torn
    width, height, left, top, right, bottom = struct.unpack_from("<6i", data)
    box = (bottom - top, right - left)
    inside = 0 <= left <= right <= width <= 4096 and 0 <= top <= bottom <= height <= 4096
    if not inside or len(data) != 24 + 4 * box[0] * box[1]:
        raise torn
    depth_mm = np.frombuffer(data, "<f4", offset=24).reshape(box)
    with np.errstate(over="ignore"):  # a damaged number: infinite is no reading either
        counts = np.rint(np.nan_to_num(depth_mm, nan=0.0) * _COUNTS_PER_MM)
    raw = np.zeros((height, width), np.uint16)
    raw[top:bottom, left:right] = np.where((counts > 0) & (counts <= _MOST), counts, 0).astype(np.uint16)
    return raw


def _read_joints(path: Path) -> NDArray[np.float64]:
    lines = read_lines(path)
    if lines and len(lines[0][1]) == 1:
        lines = lines[1:]  # the number of frames; the lines themselves count
    xyz_mm = np.empty((len(lines), 21, 3))
    for row, (number, words) in enumerate(lines):
        try:
            xyz_mm[row] = np.array(words, dtype=np.float64).reshape(21, 3)
        except ValueError as error:
            raise SessionError(
                f"Line {number} of {path} is damaged: it should be 63 numbers; copy the file again."
            ) from error
    # y points up and z towards the camera there.
    return arrange_joints(xyz_mm * np.array([1e-3, -1e-3, -1e-3]), WRIST_THEN_INDEX_TO_THUMB)


def _warnings(without_truth: int, without_image: int) -> tuple[str, ...]:
    warnings = []
    if without_truth:
        warnings.append(f"{without_truth} frames have no line in joint.txt and so no truth.")
    if without_image:
        warnings.append(f"{without_image} lines of joint.txt have no depth file and were left out.")
    return tuple(warnings)
