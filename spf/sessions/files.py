"""Sessions that are a folder with one depth image a file: what the readers of all such folders share."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from spf.errors import SessionError
from spf.frame import Truth
from spf.sessions.jpeg import read_jpeg
from spf.sessions.png import png_header, read_colour_png
from spf.sessions.session import Session

__all__ = [
    "FileSession",
    "check_depth_unit",
    "check_png_sizes",
    "joints_from_image",
    "list_files",
    "natural_key",
    "read_lines",
    "steady_times",
]

#: Median depth, in metres, that a sensor looking at a hand can have: outside it, the unit is wrong.
_BELIEVABLE_DEPTH = (0.07, 10.0)


@dataclass(frozen=True, kw_only=True, eq=False)
class FileSession(Session):
    """A session of one depth file a frame.

    Attributes:
        depth_paths: the N depth files, in order.
        decode: reads the (H, W) raw counts of one of them.
        joints: (N, 21, 3) true joints in metres, camera frame, or None.
        colour_paths: the N colour images, None where there is none; empty where no frame has one.
    """

    depth_paths: tuple[Path, ...]
    decode: Callable[[Path], NDArray[np.uint16]]
    joints: NDArray[np.float64] | None = None
    colour_paths: tuple[Path | None, ...] = ()

    def raw_depth(self, index: int) -> NDArray[np.uint16]:
        """Return the (H, W) raw counts of a frame."""
        path = self.depth_paths[index]
        raw = self.decode(path)
        height, width = raw.shape
        if (width, height) != (self.camera.width, self.camera.height):
            raise SessionError(
                f"The image {path} is {width}×{height}, but the camera of its session is "
                f"{self.camera.width}×{self.camera.height}: put images of one size in a folder."
            )
        return raw

    def colour(self, index: int) -> NDArray[np.uint8] | None:
        """Return the (H, W, 3) RGB image of a frame, or None."""
        path = self.colour_paths[index] if self.colour_paths else None
        if path is None:
            return None
        return read_jpeg(path) if path.suffix.lower() in (".jpg", ".jpeg") else read_colour_png(path)

    def truth(self, index: int) -> Truth | None:
        """Return the true joints of a frame, or None."""
        if self.joints is None or np.isnan(self.joints[index]).all():
            return None
        return Truth(self.joints[index].copy())


def natural_key(name: str) -> tuple[tuple[int, int, str], ...]:
    """Return a sort key that puts ``depth_9`` before ``depth_10``."""
    return tuple((0, int(part), "") if part.isdecimal() else (1, 0, part) for part in re.split(r"(\d+)", name) if part)


def list_files(folder: Path, pattern: str) -> list[Path]:
    """Return the files of a folder whose whole name fits a regular expression, ignoring case, in natural order."""
    fits = re.compile(pattern, re.IGNORECASE)
    found = (path for path in folder.iterdir() if fits.fullmatch(path.name) and path.is_file())
    return sorted(found, key=lambda path: natural_key(path.name))


def read_lines(path: Path) -> list[tuple[int, list[str]]]:
    """Read a text file of one frame a line.

    Returns:
        for every line that is not blank, its number from 1 and its words.

    Raises:
        SessionError: it cannot be read, or is no text.
    """
    try:
        lines = path.read_text(encoding="utf-8-sig").splitlines()
    except OSError as error:
        raise SessionError(f"The file {path} cannot be read: {error.strerror}.") from error
    except UnicodeDecodeError as error:
        raise SessionError(f"The file {path} is damaged, it is no text: copy it again.") from error
    return [(number, line.split()) for number, line in enumerate(lines, 1) if line.strip()]


def joints_from_image(uvz: NDArray[np.float64], focal: Sequence[float], centre: Sequence[float]) -> NDArray[np.float64]:
    """Back-project joints annotated in the image.

    Args:
        uvz: (..., 3) pixel coordinates u, v and depth z in mm.
        focal: fx, fy in pixels.
        centre: cx, cy in pixels.

    Returns:
        (..., 3) in metres, camera frame; NaN where the depth is not positive.
    """
    z = np.where(uvz[..., 2:] > 0, uvz[..., 2:], np.nan) * 1e-3
    return np.concatenate([(uvz[..., :2] - np.asarray(centre)) / np.asarray(focal) * z, z], axis=-1)


def steady_times(positions: Iterable[int], rate: float = 30.0) -> NDArray[np.int64]:
    """Return the times of frames taken at a steady rate.

    Args:
        positions: which picture of the steady stream each frame is, increasing.
        rate: frames per second (the data sets store no times; their cameras ran at 30).

    Returns:
        (N,) nanoseconds since the first frame.
    """
    counts = np.fromiter(positions, dtype=np.int64)
    return np.rint((counts - counts[:1]) * (1e9 / rate)).astype(np.int64)


def check_png_sizes(paths: Iterable[Path]) -> None:
    """Check from their headers that PNG images are of one size.

    Raises:
        SessionError: one is missing, empty, no PNG or of another size than the first.
    """
    first: tuple[Path, tuple[int, int]] | None = None
    for path in paths:
        header = png_header(path)
        size = (header.width, header.height)
        first = first or (path, size)
        if size != first[1]:
            raise SessionError(
                f"The image {path} is {size[0]}×{size[1]}, but {first[0].name} is {first[1][0]}×{first[1][1]}: "
                "put images of one size in a folder."
            )


def check_depth_unit(session: Session, *, leave_damaged: bool = False) -> None:
    """Check on a few frames that the depth is believable in the session's unit.

    Args:
        session: to be checked.
        leave_damaged: whether frames that cannot be read may be there; they are told when somebody asks for them.

    Raises:
        SessionError: no frame looked at can be read or has a reading, or their median depth is far from what a sensor sees.
    """
    looked_at = sorted({int(i) for i in np.linspace(0, len(session) - 1, 5)})
    readings = np.concatenate([raw[raw > 0] for raw in _looked_at(session, looked_at, leave_damaged)])
    if not readings.size:
        raise SessionError(
            f"{session.uri} has no depth reading in the {len(looked_at)} frames looked at: "
            f"either the sensor saw nothing or the depth is in the wrong unit (not in counts of {session.depth_unit:g} m): "
            "set depth_unit, or unit= behind the ?, to the metres of one count."
        )
    median = float(np.median(readings)) * session.depth_unit
    low, high = _BELIEVABLE_DEPTH
    if not low <= median <= high:
        raise SessionError(
            f"{session.uri} has depth in the wrong unit: with {session.depth_unit:g} m a count its median depth is "
            f"{median:.3g} m, and {low:g} to {high:g} m is believable; set depth_unit, or unit= behind the ?, "
            "to the metres of one count."
        )


def _looked_at(session: Session, indices: Sequence[int], leave_damaged: bool) -> list[NDArray[np.uint16]]:
    found, failures = [], []
    for index in indices:
        try:
            found.append(session.raw_depth(index))
        except SessionError as error:
            failures.append(error)
    if failures and not (found and leave_damaged):
        raise failures[0]
    return found
