"""What a user chooses of a recording: in its URI, as in ``room.bag?topic=/camera/depth&unit=0.001``, or by an option."""

from __future__ import annotations

import math
from pathlib import Path
from typing import NamedTuple
from urllib.parse import parse_qsl

from spf.errors import SessionError
from spf.frame import Camera
from spf.sessions.camera_file import EXAMPLE, FolderCamera, read_camera_file

__all__ = ["Choice", "choice_of", "split_uri"]

_MEANINGS = {
    "topic": "the topic, track or array with the depth",
    "camera": "a camera file",
    "camera_info": "the topic that tells the camera",
    "unit": "metres per count of depth",
}


class Choice(NamedTuple):
    """What was chosen.

    Attributes:
        topic: the topic, track or array with the depth, "" if there is only one.
        camera: a camera to take instead of what the recording says, None for the recording's own.
        camera_info: the topic that tells the camera, "" for the one that belongs to the depth.
        unit: metres per count, None for what the recording says.
    """

    topic: str = ""
    camera: FolderCamera | None = None
    camera_info: str = ""
    unit: float | None = None

    @property
    def depth_unit(self) -> float | None:
        """Metres per count that were chosen, in the URI or in the camera file."""
        return self.unit or (self.camera and self.camera.depth_unit)

    def fitting(self, size: tuple[int, int], uri: str) -> Camera:
        """Return the camera that was chosen, for images of a size.

        Args:
            size: (width, height) in pixels.
            uri: for messages.

        Raises:
            SessionError: it is for images of another size.
        """
        assert self.camera is not None
        given = (self.camera.width or size[0], self.camera.height or size[1])
        if given != size:
            raise SessionError(
                f"The images of {uri} are {size[0]}×{size[1]}, but the camera given is {given[0]}×{given[1]}: give the "
                "width, height and focal lengths of the images."
            )
        return self.camera.camera(*size)


def split_uri(uri: str | Path) -> tuple[Path, dict[str, str]]:
    """Split a URI into the path of a session and what was chosen of it.

    A path that exists is taken as it is, whatever is in its name.

    Raises:
        SessionError: something unknown is chosen, or chosen twice.
    """
    path, text = Path(uri), str(uri)
    if "?" not in text or path.exists():
        return path, {}
    name, _, query = text.rpartition("?")
    pairs = parse_qsl(query, keep_blank_values=True)
    options = dict(pairs)
    unknown = [key for key in options if key not in _MEANINGS]
    if unknown or not pairs or len(options) < len(pairs):
        what = f"'{unknown[0]}'" if unknown else f"'{query}'"
        known = ", ".join(f"{key}= ({meaning})" for key, meaning in _MEANINGS.items())
        raise SessionError(f"{what} in {text} cannot be chosen: behind the ? may stand {known}, joined by &.")
    return Path(name), options


def choice_of(uri: str, options: dict[str, str], camera: Camera | str | Path | None) -> Choice:
    """Return what was chosen in a URI and beside it.

    Args:
        uri: for messages.
        options: the part of the URI behind the ``?``.
        camera: the camera, or a camera file, given beside the URI.

    Raises:
        SessionError: the camera is given twice or cannot be read, or the unit is no positive number.
    """
    if camera is not None and "camera" in options:
        raise SessionError(f"{uri} is given a camera twice: leave one out.")
    chosen = options.get("camera") if camera is None else camera
    if isinstance(chosen, Camera):
        given: FolderCamera | None = FolderCamera.of(chosen)
    elif chosen is None:
        given = None
    elif Path(chosen).is_file():
        given = read_camera_file(Path(chosen))
    else:
        raise SessionError(f"There is no camera file {chosen}: write one like {EXAMPLE}.")
    unit = None
    if "unit" in options:
        try:
            unit = float(options["unit"])
        except ValueError:
            unit = math.nan
        if not (math.isfinite(unit) and unit > 0):
            raise SessionError(f"unit={options['unit']} in {uri} is no positive number of metres per count: try 0.001.")
    return Choice(options.get("topic", ""), given, options.get("camera_info", ""), unit)
