"""Joints that a person marked in frames of a session: kept beside it in a small JSON file, and read as its truth.

A mark is a joint's centre: what the depth image shows at a pixel is the skin, so that the centre lies some millimetres behind.
Both the point and that offset are kept. A joint may also be marked as hidden, which says that somebody looked.
"""

from __future__ import annotations

import csv
import io
import json
import math
import os
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from spf.errors import SessionError
from spf.frame import JOINT_NAMES

__all__ = [
    "Mark",
    "Marks",
    "count_marks",
    "joints_of_marks",
    "marks_file",
    "marks_from_csv",
    "marks_from_json",
    "marks_to_csv",
    "marks_to_json",
    "merged",
    "read_marks",
    "write_marks",
]

_FORMAT = "spf-marks"
_COLUMNS = ("frame", "joint", "x_m", "y_m", "z_m", "offset_m", "hidden")
_FARTHEST = 20.0  # m that a mark may be away


class Mark(NamedTuple):
    """One joint of one frame.

    Attributes:
        point: (x, y, z) m, camera frame, of the joint's centre; None where it is hidden.
        offset: m along the optical axis by which the centre was put behind the surface seen; NaN where that is not known.
    """

    point: tuple[float, float, float] | None
    offset: float = math.nan


#: Frame → joint → mark. Values are never changed in place.
Marks = Mapping[int, Mapping[str, Mark]]


def marks_file(session: Path) -> Path:
    """Return the file beside a session that holds its marks: ``take.mcap`` → ``take.mcap.marks.json``."""
    whole = session.resolve()
    return whole.with_name(f"{whole.name}.marks.json")


def joints_of_marks(marks: Mapping[str, Mark]) -> NDArray[np.float64]:
    """Return the joints (21, 3) m of a frame's marks; NaN where none is marked."""
    joints = np.full((len(JOINT_NAMES), 3), np.nan)
    for name, mark in marks.items():
        if mark.point is not None:
            joints[JOINT_NAMES.index(name)] = mark.point
    return joints


def merged(first: Marks, second: Marks) -> dict[int, dict[str, Mark]]:
    """Return marks of both, joint by joint those of the second where both have one."""
    return {frame: {**first.get(frame, {}), **second.get(frame, {})} for frame in sorted({*first, *second})}


def count_marks(marks: Marks) -> tuple[int, int]:
    """Return the number of frames with marked joints, and of joints marked in them; hidden ones do not count."""
    counts = [sum(mark.point is not None for mark in joints.values()) for joints in marks.values()]
    return sum(count > 0 for count in counts), sum(counts)


def _checked(frames: int, items: Iterator[tuple[Any, Any, Any, Any, bool]], source: str) -> dict[int, dict[str, Mark]]:
    """Build marks from (frame, joint, point, offset, hidden).

    Raises:
        SessionError: a frame, a joint or a number is none.
    """
    marks: dict[int, dict[str, Mark]] = {}
    for frame, joint, point, offset, hidden in items:
        try:
            index = int(frame)
            numbers = None if hidden else tuple(float(number) for number in point)
            behind = math.nan if offset in (None, "") else float(offset)
        except (TypeError, ValueError):
            raise SessionError(f"{source} holds a mark of frame {frame}, {joint}, that is not all numbers.") from None
        if not 0 <= index < frames:
            raise SessionError(f"{source} marks frame {index}, and the session has the frames 0 to {frames - 1}.")
        if joint not in JOINT_NAMES:
            raise SessionError(f"{source} marks a joint '{joint}': the joints are {', '.join(JOINT_NAMES)}.")
        if joint in marks.get(index, {}):
            raise SessionError(f"{source} marks {joint} of frame {index} twice: leave one out.")
        marks.setdefault(index, {})[joint] = Mark(_believable(numbers, index, joint, source), behind)
    return {index: marks[index] for index in sorted(marks)}


def _believable(
    numbers: tuple[float, ...] | None, frame: int, joint: str, source: str
) -> tuple[float, float, float] | None:
    if numbers is None:
        return None
    if len(numbers) != 3 or not all(abs(number) < _FARTHEST for number in numbers) or numbers[2] <= 0:
        raise SessionError(f"{source} puts {joint} of frame {frame} where no hand is: give metres in the camera frame.")
    return numbers[0], numbers[1], numbers[2]


# ---- JSON, beside the session or in its file


def marks_to_json(marks: Marks, frames: int, size: tuple[int, int]) -> str:
    """Return the content of a marks file.

    Args:
        marks: of a session.
        frames, size: number of its frames, and (width, height) of its images: another recording is told by them.
    """
    content = {
        "format": _FORMAT, "version": 1, "frames": frames, "size": list(size), "units": "metres, camera frame",
        "marks": {str(frame): {name: _to_dict(mark) for name, mark in joints.items()} for frame, joints in marks.items()},
    }  # fmt: skip
    return json.dumps(content, indent=1) + "\n"


def _to_dict(mark: Mark) -> dict[str, Any]:
    if mark.point is None:
        return {"hidden": True}
    return {"point": list(mark.point), **({} if math.isnan(mark.offset) else {"offset": mark.offset})}


def marks_from_json(text: str, frames: int, size: tuple[int, int], source: str) -> dict[int, dict[str, Mark]]:
    """Read the content of a marks file of a session with some frames of a size.

    Raises:
        SessionError: it is torn, none, or of another recording.
    """
    try:
        content = json.loads(text)
        if content["format"] != _FORMAT or content["version"] != 1:
            raise ValueError
        own, whole = (content["frames"], tuple(content["size"])), content["marks"]
        items = [
            (frame, joint, mark.get("point"), mark.get("offset"), bool(mark.get("hidden")))
            for frame, joints in whole.items()
            for joint, mark in joints.items()
        ]
    except (ValueError, KeyError, TypeError, AttributeError):
        raise SessionError(f"{source} is torn or no marks of joints: mend it, or move it away.") from None
    if own != (frames, size):
        raise SessionError(f"{source} marks another recording ({own[0]} frames of {own[1]}): move it away.")
    return _checked(frames, iter(items), source)


def read_marks(path: Path, frames: int, size: tuple[int, int]) -> dict[int, dict[str, Mark]]:
    """Read a marks file.

    Raises:
        SessionError: it cannot be read, is torn, or of another recording.
    """
    try:
        text = path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise SessionError(f"The marks {path} cannot be read ({error}): mend them, or move them away.") from None
    return marks_from_json(text, frames, size, str(path))


def write_marks(marks: Marks, path: Path, frames: int, size: tuple[int, int]) -> None:
    """Write a marks file; the one before is there until the new one is whole.

    Raises:
        SessionError: it cannot be written.
    """
    part = path.with_name(f".{path.name}.part")
    try:
        with part.open("w", encoding="utf-8") as file:
            file.write(marks_to_json(marks, frames, size))
            file.flush()
            os.fsync(file.fileno())
        os.replace(part, path)
    except OSError as error:
        raise SessionError(
            f"The marks {path} cannot be written: {error.strerror}. Copy the session to where you may write."
        ) from error


# ---- CSV, for other programs


def marks_to_csv(marks: Marks) -> str:
    """Return marks as CSV: a line a joint, metres in the camera frame."""
    out = io.StringIO()
    writer = csv.writer(out, lineterminator="\n")
    writer.writerow(_COLUMNS)
    for frame, joints in marks.items():
        for name, mark in joints.items():
            point = ("", "", "") if mark.point is None else tuple(f"{number:.6f}" for number in mark.point)
            offset = "" if math.isnan(mark.offset) else f"{mark.offset:.6f}"
            writer.writerow([frame, name, *point, offset, int(mark.point is None)])
    return out.getvalue()


def marks_from_csv(text: str, frames: int, source: str) -> dict[int, dict[str, Mark]]:
    """Read marks from CSV; ``offset_m`` and ``hidden`` may be missing.

    Raises:
        SessionError: a column is missing, or a frame, a joint or a number is none.
    """
    reader = csv.DictReader(io.StringIO(text))
    missing = [name for name in _COLUMNS[:5] if name not in (reader.fieldnames or ())]
    if missing:
        raise SessionError(f"{source} lacks the column {missing[0]}: the first line names {','.join(_COLUMNS)}.")
    rows = [
        (
            row["frame"], row["joint"], (row["x_m"], row["y_m"], row["z_m"]), row.get("offset_m"),
            (row.get("hidden") or "0").strip() not in ("0", "false", ""),
        )
        for row in reader
    ]  # fmt: skip
    return _checked(frames, iter(rows), source)
