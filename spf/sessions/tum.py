"""TUM RGB-D recordings: ``depth.txt`` with time stamps, 16-bit PNG of 5000 counts a metre, colour registered to it.

Sturm, Engelhard, Endres, Burgard, Cremers, *A Benchmark for the Evaluation of RGB-D SLAM Systems*, IROS 2012. The folder
does not tell its camera (docs/formats.md lists what was published).
"""

from __future__ import annotations

from decimal import Decimal, InvalidOperation
from itertools import pairwise
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from spf.errors import SessionError
from spf.sessions.choice import Choice
from spf.sessions.files import FileSession, read_lines
from spf.sessions.png import read_depth_png
from spf.sessions.rgbd_folder import check_opened, folder_camera_of, size_of
from spf.sessions.session import Session

__all__ = ["is_tum", "open_tum"]

_UNIT = 0.0002
_SAME_TIME_NS = 20_000_000  # colour and depth that are no further apart belong together, as in the benchmark's tool


def is_tum(path: Path) -> bool:
    """Tell whether a path is a TUM RGB-D recording: a folder with ``depth.txt``."""
    return (path / "depth.txt").is_file()


def open_tum(path: Path, choice: Choice, uri: str) -> Session:
    """Open a TUM RGB-D recording.

    Raises:
        SessionError: a list or an image looked at is damaged, no image is there, the camera is not told, or the unit is
            not believable.
    """
    times, names = _read_list(path, "depth.txt")
    order = [int(index) for index in np.argsort(times, kind="stable") if (path / names[index]).is_file()]
    if not order:
        raise SessionError(f"None of the {len(names)} images listed in {path / 'depth.txt'} is in the folder.")
    kept = [order[0], *(b for a, b in pairwise(order) if times[b] > times[a])]
    paths = tuple(path / names[index] for index in kept)
    stamps = times[kept]
    camera, given = folder_camera_of(path, choice, size_of(paths), uri)
    missing = len(names) - len(kept)
    warnings = (f"{missing} lines of depth.txt have no image, or the time of another, and were left out.",)
    return check_opened(
        FileSession(
            uri=uri,
            name=path.resolve().name,
            format="tum",
            camera=camera,
            times_ns=stamps - stamps[0],
            start_time_ns=int(stamps[0]),
            depth_unit=choice.unit or given.depth_unit or _UNIT,
            side=given.side,
            metadata={"sensor": given.sensor} if given.sensor else {},
            warnings=warnings if missing else (),
            depth_paths=paths,
            decode=read_depth_png,
            colour_paths=_colour(path, stamps),
        )
    )


def _read_list(path: Path, name: str) -> tuple[NDArray[np.int64], list[str]]:
    times, names = [], []
    for number, words in read_lines(path / name):
        if words[0].startswith("#"):
            continue
        try:
            stamp = int(Decimal(words[0]).scaleb(9))
            inside = (path / words[1]).resolve().is_relative_to(path.resolve())
        except (InvalidOperation, ArithmeticError, IndexError, ValueError, OSError):
            inside, stamp = False, 0
        if not inside or not 0 <= stamp < 2**63:
            raise SessionError(f"Line {number} of {path / name} is damaged: it should be a time and an image below it.")
        times.append(stamp)
        names.append(words[1])
    if not names:
        raise SessionError(f"The file {path / name} lists no image: copy it again.")
    return np.array(times, dtype=np.int64), names


def _colour(path: Path, stamps: NDArray[np.int64]) -> tuple[Path | None, ...]:
    if not (path / "rgb.txt").is_file():
        return ()
    times, names = _read_list(path, "rgb.txt")
    nearest = [int(np.abs(times - stamp).argmin()) for stamp in stamps]
    paths = [path / names[index] for index in nearest]
    return tuple(
        each if abs(times[index] - stamp) <= _SAME_TIME_NS and each.is_file() else None
        for each, index, stamp in zip(paths, nearest, stamps, strict=True)
    )
