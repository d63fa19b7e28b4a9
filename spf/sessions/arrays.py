"""Depth as an array of (frames, height, width) in a NumPy or HDF5 file, with the camera beside it."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple, cast

import numpy as np
from numpy.typing import NDArray

from spf.errors import SessionError
from spf.frame import Camera, Truth
from spf.progress import Report
from spf.sessions.array_files import DAMAGE, HDF5_MAGIC, NPY_MAGIC, ZIP_MAGIC, ArrayFile, ArrayInfo, open_array_file
from spf.sessions.bag import damaged
from spf.sessions.camera_file import EXAMPLE
from spf.sessions.choice import Choice
from spf.sessions.files import check_depth_unit, steady_times
from spf.sessions.ros_wire import metres_to_counts
from spf.sessions.session import Session, Side
from spf.sessions.streams import choose_stream

__all__ = ["is_arrays", "open_arrays"]

_INTEGER_UNIT, _FLOAT_UNIT, _ROUNDED = 0.001, 1.0, 0.0001  # metres per number as stored, and what metres are rounded to
_MATRICES = ("K", "intrinsics", "intrinsic_matrix", "camera_matrix", "cam_K")
_MOST_FRAMES, _SMALLEST, _MOST_PIXELS = 5_000_000, 16, 2**26


class _Named(NamedTuple):
    """The small things in a file, by the last part of their names."""

    file: ArrayFile
    places: dict[str, str]

    def get(self, *names: str) -> Any:
        """Return the first of some values that is there, as an array; None if none is."""
        for name in names:
            if name in self.file.values:
                return np.asarray(self.file.values[name])
            if name in self.places:
                return self.file.whole(self.places[name])
        return None

    def number(self, *names: str) -> float | None:
        """Return the first of some numbers that is there, None if none is."""
        found = self.get(*names)
        return None if found is None else float(np.asarray(found, dtype=np.float64).reshape(-1)[0])


@dataclass(frozen=True, kw_only=True, eq=False)
class ArraySession(Session):
    """A session in a file of arrays.

    Attributes:
        file: with the arrays.
        array: name of the one with depth.
        stored_unit: metres of a number as it is stored.
        joints: (N, 21, 3) true joints in metres, or None.
    """

    file: ArrayFile
    array: str
    stored_unit: float
    joints: NDArray[np.float64] | None = None

    def raw_depth(self, index: int) -> NDArray[np.uint16]:
        """Return the (H, W) raw counts of a frame."""
        try:
            values = self.file.row(self.array, index)
        except DAMAGE as error:
            raise damaged(Path(self.uri), f"frame {index}: {error}") from error
        if values.dtype == np.uint16:
            return values.astype(np.uint16)
        if values.dtype.kind in "ui":
            return np.where((values > 0) & (values <= 65535), values, 0).astype(np.uint16)
        return metres_to_counts(values.astype(np.float64) * self.stored_unit, self.depth_unit)

    def truth(self, index: int) -> Truth | None:
        """Return the true joints of a frame, or None."""
        return None if self.joints is None else Truth(self.joints[index].copy())

    def close(self) -> None:
        """Close the file."""
        self.file.close()


def is_arrays(path: Path) -> bool:
    """Tell whether a path is a NumPy or HDF5 file."""
    if not path.is_file():
        return False
    with path.open("rb") as file:
        return file.read(8).startswith((NPY_MAGIC, ZIP_MAGIC, HDF5_MAGIC))


def open_arrays(path: Path, choice: Choice, uri: str, report: Report) -> Session:
    """Open a file of arrays.

    Raises:
        SessionError: it has no array of depth images, or several and none is chosen; the camera is not told; the unit is
            not believable; or it is damaged.
    """
    try:
        file = open_array_file(path)
        name = _depth_array(path, file, choice, uri)
        named = _Named(file, {key.rpartition("/")[2]: key for key, info in file.arrays.items() if len(info.shape) <= 3})
        session = _session(path, named, name, choice, uri)
        file.prepare(name, report)
    except DAMAGE as error:
        raise SessionError(f"{path} is damaged or no file of arrays ({_first_line(error)}): save it again.") from error
    check_depth_unit(session)
    return session


def _first_line(error: BaseException) -> str:
    return (str(error) or type(error).__name__).splitlines()[0][:200]


def _is_depth(info: ArrayInfo) -> bool:
    if len(info.shape) != 3 or info.dtype.kind not in "uif":
        return False
    frames, height, width = info.shape
    fits = min(height, width) >= _SMALLEST and height * width <= _MOST_PIXELS
    return fits and 0 < frames <= _MOST_FRAMES and (info.dtype.kind == "f" or info.dtype.itemsize > 1)


def _depth_array(path: Path, file: ArrayFile, choice: Choice, uri: str) -> str:
    found = {name: str(info) for name, info in file.arrays.items() if _is_depth(info)}
    if not found:
        listed = "; ".join(f"{name}: {info}" for name, info in sorted(file.arrays.items())[:10]) or "none"
        raise SessionError(f"{path} has no array of depth images (frames × height × width); its arrays: {listed}.")
    return choose_stream(uri, "arrays", found, choice.topic)


def _session(path: Path, named: _Named, name: str, choice: Choice, uri: str) -> Session:
    info = named.file.arrays[name]
    frames, height, width = info.shape
    is_float = info.dtype.kind == "f"
    stored = choice.depth_unit or named.number("depth_unit") or (_FLOAT_UNIT if is_float else _INTEGER_UNIT)
    if not (math.isfinite(stored) and stored > 0):
        raise SessionError(f"{path} has an impossible depth_unit ({stored}): give it, as in '{uri}?unit=0.001'.")
    times, said = _times(path, named, frames, choice)
    joints = named.get("joints")
    if joints is not None and joints.shape != (frames, 21, 3):
        joints = None
    side, sensor = _text(named.get("side")), _text(named.get("sensor"))
    return ArraySession(
        uri=uri,
        name=path.stem,
        format="arrays",
        camera=_camera(path, named, (width, height), choice, uri),
        times_ns=times - times[0],
        depth_unit=_ROUNDED if is_float else stored,
        side=cast(Side, side) if side in ("left", "right") else None,
        has_truth=joints is not None,
        metadata={
            "array": name,
            **({"sensor": sensor} if sensor else {}),
            **({"depth": f"floating point, rounded to {_ROUNDED:g} m"} if is_float else {}),
            **({} if said else {"times": "not stored: a steady rate is assumed"}),
        },
        contents=tuple(f"{key}: {value}" for key, value in sorted(named.file.arrays.items())),
        file=named.file,
        array=name,
        stored_unit=stored,
        joints=None if joints is None else joints.astype(np.float64),
    )


def _times(path: Path, named: _Named, frames: int, choice: Choice) -> tuple[NDArray[np.int64], bool]:
    """Return the times in ns, and whether they are told."""
    exact, seconds = named.get("times_ns", "timestamps_ns"), named.get("times", "timestamps")
    if exact is None and seconds is None:
        rate = named.number("fps") or (choice.camera.fps if choice.camera else 30.0)
        if not (math.isfinite(rate) and rate > 0):
            raise SessionError(f"{path} has an impossible fps ({rate}): leave it out, or write frames per second.")
        return steady_times(range(frames), rate), False
    if exact is None:
        exact = np.asarray(seconds, dtype=np.float64)
        exact = np.rint((exact - exact.reshape(-1)[:1]) * 1e9)
    if exact.shape != (frames,) or not np.isfinite(exact).all() or not (np.abs(exact) < 2**62).all():
        raise SessionError(
            f"{path} has {exact.shape} times for {frames} frames, or impossible ones: store one a frame."
        )
    stamps = exact.astype(np.int64)
    if not (np.diff(stamps) > 0).all():
        raise SessionError(f"The times in {path} do not increase from frame to frame: sort the frames by time.")
    return stamps, True


def _camera(path: Path, named: _Named, size: tuple[int, int], choice: Choice, uri: str) -> Camera:
    if choice.camera is not None:
        return choice.fitting(size, uri)
    single = [named.number(name) for name in ("fx", "fy", "cx", "cy")]
    if None not in single:
        numbers = [float(number) for number in single if number is not None]
    else:
        matrix = named.get(*_MATRICES)
        flat = None if matrix is None else np.asarray(matrix, dtype=np.float64).reshape(-1)
        if flat is None or flat.size not in (4, 9):
            raise SessionError(
                f"{path} does not say which camera took it (fx, fy, cx, cy, or a matrix K, are missing): give one with "
                f"--camera FILE, a file like {EXAMPLE}."
            )
        numbers = (flat if flat.size == 4 else flat[[0, 4, 2, 5]]).tolist()
    if not all(map(math.isfinite, numbers)) or min(numbers[:2]) <= 0:
        raise SessionError(f"{path} has an impossible camera ({numbers}): give one with --camera.")
    model = _text(named.get("model"))
    fx, fy, cx, cy = numbers
    return Camera(*size, fx, fy, cx, cy, "orthographic" if model == "orthographic" else "pinhole")


def _text(value: Any) -> str:
    if value is None:
        return ""
    item = np.asarray(value).reshape(-1)[0]
    return item.decode("utf-8", "replace") if isinstance(item, bytes) else str(item)
