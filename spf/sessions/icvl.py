"""ICVL hand posture: 16-bit PNG in mm below ``Depth/`` and a label file of 16 joints beside it.

Tang, Chang, Tejani, Kim, *Latent regression forest*, CVPR 2014. Creative Interactive Gesture Camera; no times are
stored, 30 frames per second are assumed. The test part has ``Depth/test_seq_1/image_0000.png`` and ``test_seq_1.txt``,
the training part ``Depth/201403121135/image_0000.png`` and ``labels.txt``.
"""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

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
    natural_key,
    steady_times,
)
from spf.sessions.joint_order import arrange_joints
from spf.sessions.png import read_depth_png
from spf.sessions.session import Session

__all__ = ["CAMERA", "is_icvl", "open_icvl"]

CAMERA = Camera(width=320, height=240, fx=241.42, fy=241.42, cx=160.0, cy=120.0)

#: Three marks a finger: the base of its first phalanx, a middle joint, its tip; the palm's centre is no joint of ours.
_JOINTS: tuple[str | None, ...] = (
    None,
    *("thumb_mp", "thumb_ip", "thumb_tip"),
    *(f"{finger}_{joint}" for finger in ("index", "middle", "ring", "little") for joint in ("mcp", "pip", "tip")),
)
_VALUES = 3 * len(_JOINTS)
_NO_READING = 32000


class _Part(NamedTuple):
    """Label files, the folder that their names start from, and which of their names are meant."""

    labels: list[Path]
    images: Path
    prefix: str


def is_icvl(path: Path) -> bool:
    """Tell whether a path is of the ICVL set: a label file, the folder of one, or a sequence folder in ``Depth/``."""
    return _find_part(path) is not None


def open_icvl(path: Path) -> Session:
    """Open an ICVL sequence, or all the sequences of a part one after the other.

    Raises:
        SessionError: a label file or an image looked at is damaged, or no labelled image is there.
    """
    part = _find_part(path)
    if part is None:
        raise SessionError(f"{path} is no part of the ICVL set.")
    rows = _read_labels(part)
    present = [(name, values) for name, values in rows if (part.images / name).is_file()]
    if not present:
        raise SessionError(f"None of the {len(rows)} images labelled in {part.labels[0]} is in {part.images}.")
    paths = tuple(part.images / name for name, _ in present)
    check_png_sizes(paths)
    uvz = np.array([values for _, values in present]).reshape(-1, len(_JOINTS), 3)
    points = joints_from_image(uvz, (CAMERA.fx, CAMERA.fy), (CAMERA.cx, CAMERA.cy))
    session = FileSession(
        uri=str(path),
        name=path.stem,
        format="icvl",
        camera=CAMERA,
        times_ns=steady_times(range(len(paths))),
        joint_definition="icvl",
        has_truth=True,
        metadata={"dataset": "ICVL", "recording": path.stem, "sensor": "Creative Interactive Gesture Camera"},
        warnings=_warnings(len(rows) - len(present), sorted({str(Path(name).parent) for name, _ in present})),
        depth_paths=paths,
        decode=_read_depth,
        joints=arrange_joints(points, _JOINTS),
    )
    check_depth_unit(session)
    return session


def _find_part(path: Path) -> _Part | None:
    if path.is_file():
        return _Part([path], _image_root(path.parent), "") if _is_label_file(path) else None
    if not path.is_dir():
        return None
    labels = [file for file in list_files(path, r".+\.txt") if _is_label_file(file)]
    if labels:
        return _Part(labels, _image_root(path), "")
    full = path.resolve()
    for depth in full.parents[:2]:
        if depth.name.lower() == "depth":
            labels = [file for file in list_files(depth.parent, r".+\.txt") if _is_label_file(file)]
            return _Part(labels, depth, full.relative_to(depth).as_posix() + "/") if labels else None
    return None


def _image_root(folder: Path) -> Path:
    children = (child for child in sorted(folder.iterdir()) if child.is_dir())
    return next((child for child in children if child.name.lower() == "depth"), folder)


def _is_label_file(path: Path) -> bool:
    """Tell by its first line: an image name and 16 × 3 numbers."""
    with path.open("rb") as file:
        words = file.readline(4096).split()
    if len(words) != 1 + _VALUES or not words[0].lower().endswith(b".png"):
        return False
    try:
        return len([float(word) for word in words[1:]]) == _VALUES
    except ValueError:
        return False


def _read_labels(part: _Part) -> list[tuple[str, NDArray[np.float64]]]:
    rows = [row for path in part.labels for row in _read_label_file(path, part.prefix)]
    if not rows:
        raise SessionError(
            f"No line of {part.labels[0]} labels an image of {part.prefix.rstrip('/')}: open a sequence that it labels."
        )
    return sorted(rows, key=lambda row: natural_key(row[0]))


def _read_label_file(path: Path, prefix: str) -> list[tuple[str, NDArray[np.float64]]]:
    rows = []
    # The training file has 330 000 lines: only those asked for are taken apart.
    for number, line in enumerate(path.read_text(encoding="utf-8", errors="replace").splitlines(), 1):
        if not line.strip() or not line.startswith(prefix):
            continue
        name, *words = line.split()
        try:
            rows.append((name.replace("\\", "/"), np.array(words, dtype=np.float64).reshape(_VALUES)))
        except ValueError as error:
            raise SessionError(
                f"Line {number} of {path} is damaged: it should be an image name and {_VALUES} numbers; copy it again."
            ) from error
    return rows


def _read_depth(path: Path) -> NDArray[np.uint16]:
    raw = read_depth_png(path)
    raw[raw >= _NO_READING] = 0
    return raw


def _warnings(missing: int, sequences: list[str]) -> tuple[str, ...]:
    warnings = []
    if missing:
        warnings.append(f"{missing} labelled images are not in the folder and were left out.")
    if len(sequences) > 1:
        warnings.append(
            f"{len(sequences)} sequences follow one another and the hand jumps between them: to track one, open its "
            f"folder ({', '.join(sequences[:3])}{', …' if len(sequences) > 3 else ''})."
        )
    return tuple(warnings)
