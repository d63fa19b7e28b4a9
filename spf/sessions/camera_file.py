"""The camera file of a plain image folder: ``camera.json``."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any, NamedTuple

from spf.errors import SessionError
from spf.frame import Camera
from spf.sessions.session import Side

__all__ = ["EXAMPLE", "FolderCamera", "read_camera_file"]

#: The least that a camera file holds, shown to whoever has none.
EXAMPLE = '{"fx": 365.0, "fy": 365.0, "cx": 256.0, "cy": 212.0, "depth_unit": 0.001}'


class FolderCamera(NamedTuple):
    """What a camera file says.

    Attributes:
        fx, fy: focal lengths in pixels (orthographic: pixels per metre).
        cx, cy: principal point in pixels.
        width, height: image size in pixels; None: that of the images.
        depth_unit: metres per count, None if not said.
        no_reading: counts that mean "no reading", besides 0.
        max_valid: the largest count that is a reading, None for any.
        fps: frames per second.
        side: the hand shown, None if not said.
        model: ``"pinhole"`` or ``"orthographic"``.
        sensor: name of the sensor, or "".
    """

    fx: float
    fy: float
    cx: float
    cy: float
    width: int | None = None
    height: int | None = None
    depth_unit: float | None = None
    no_reading: tuple[int, ...] = ()
    max_valid: int | None = None
    fps: float = 30.0
    side: Side | None = None
    model: Any = "pinhole"
    sensor: str = ""

    @classmethod
    def of(cls, camera: Camera) -> FolderCamera:
        """Return what is known when only a camera is given: no depth unit, 30 frames per second."""
        return cls(camera.fx, camera.fy, camera.cx, camera.cy, camera.width, camera.height, model=camera.model)

    def camera(self, width: int, height: int) -> Camera:
        """Return the camera of images of a size in pixels."""
        return Camera(width, height, self.fx, self.fy, self.cx, self.cy, self.model)


def read_camera_file(path: Path) -> FolderCamera:
    """Read a camera file.

    Raises:
        SessionError: it cannot be read, is no JSON object, or a value is missing, unknown or impossible.
    """
    try:
        values = json.loads(path.read_text(encoding="utf-8-sig"))
    except OSError as error:
        raise SessionError(f"The camera file {path} cannot be read: {error.strerror}.") from error
    except ValueError as error:
        raise SessionError(f"The camera file {path} is no JSON: write it like {EXAMPLE}.") from error
    if not isinstance(values, dict):
        raise SessionError(f"The camera file {path} is no JSON object: write it like {EXAMPLE}.")
    missing = [name for name in ("fx", "fy", "cx", "cy") if name not in values]
    if missing:
        raise SessionError(f"The camera file {path} lacks {', '.join(missing)}: write it like {EXAMPLE}.")
    for name, value in values.items():
        _check(path, name, value)
    given = {name: value for name, value in values.items() if value is not None}
    return FolderCamera(**{**given, "no_reading": tuple(values.get("no_reading") or ())})


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)


def _is_positive(value: Any) -> bool:
    return _is_number(value) and value > 0


def _is_size(value: Any) -> bool:
    return _is_positive(value) and value == int(value)


def _is_count(value: Any) -> bool:
    return _is_number(value) and value == int(value) and 0 <= value <= 65535


#: What each value of a camera file must be, and how that is said.
_RULES = {
    **{name: (_is_positive, "a positive number") for name in ("fx", "fy", "depth_unit", "fps")},
    **{name: (_is_number, "a number") for name in ("cx", "cy")},
    **{name: (lambda v: v is None or _is_size(v), "a whole number of pixels") for name in ("width", "height")},
    "no_reading": (lambda v: isinstance(v, list) and all(map(_is_count, v)), "a list of counts from 0 to 65535"),
    "max_valid": (lambda v: v is None or _is_count(v), "a count from 0 to 65535"),
    "side": (lambda v: v in ("left", "right", None), '"left" or "right"'),
    "model": (lambda v: v in ("pinhole", "orthographic"), '"pinhole" or "orthographic"'),
    "sensor": (lambda v: isinstance(v, str), "a text"),
}


def _check(path: Path, name: str, value: Any) -> None:
    if name not in _RULES:
        raise SessionError(f"The camera file {path} has an unknown entry '{name}': known are {', '.join(_RULES)}.")
    fits, wanted = _RULES[name]
    if not fits(value):
        raise SessionError(f"In the camera file {path}, {name} is {json.dumps(value)}: it should be {wanted}.")
