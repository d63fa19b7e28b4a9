"""Open any session: the table of formats, told apart by their content."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

from spf.errors import SessionError
from spf.frame import Camera
from spf.sessions.cvar import is_cvar, open_cvar
from spf.sessions.files import natural_key
from spf.sessions.icvl import is_icvl, open_icvl
from spf.sessions.mcap import is_mcap, open_mcap
from spf.sessions.msra15 import is_msra15, open_msra15
from spf.sessions.nyu import is_nyu, open_nyu
from spf.sessions.png_folder import is_png_folder, open_png_folder
from spf.sessions.session import Session

__all__ = ["FORMATS", "Format", "open_session"]


class Format(NamedTuple):
    """One format of sessions.

    Attributes:
        name: what ``session.format`` says.
        layout: what a path of this format looks like, for people.
        fits: tells whether an existing path is of this format.
        open: opens such a path.
        takes_camera: whether ``open`` takes a camera as its second argument.
    """

    name: str
    layout: str
    fits: Callable[[Path], bool]
    open: Callable[..., Session]
    takes_camera: bool = False


#: In the order in which they are tried. A new format is one file and one row.
FORMATS: tuple[Format, ...] = (
    Format("mcap", "an MCAP file", is_mcap, open_mcap),
    Format("msra15", "an MSRA15 gesture folder (joint.txt, 000000_depth.bin, …)", is_msra15, open_msra15),
    Format("cvar", "a CVAR folder (joint.txt, 000000_depth.png, …)", is_cvar, open_cvar),
    Format("nyu", "an NYU folder (depth_1_0000001.png, …, joint_data.mat)", is_nyu, open_nyu),
    Format("icvl", "an ICVL folder (Depth/, labels.txt)", is_icvl, open_icvl),
    Format("png-folder", "a folder of 16-bit depth PNGs with camera.json", is_png_folder, open_png_folder, True),
)


def open_session(uri: str | Path, camera: Camera | str | Path | None = None) -> Session:
    """Open a session; its format is found by its content, not by its name.

    Args:
        uri: path of a file or folder.
        camera: the camera, or a camera file, of an image folder that has no ``camera.json`` of its own.

    Returns:
        the session; :attr:`Session.warnings` says what a user should know of how it was read.

    Raises:
        SessionError: there is nothing there, no format fits, or what is there is damaged.
    """
    path = Path(uri)
    if not path.exists():
        raise SessionError(f"There is no file or folder {path}: check the path of the session.")
    try:
        found = next((form for form in FORMATS if form.fits(path)), None)
        if found is None:
            raise SessionError(
                f"{path} is no session: it is {_what_it_is(path)}. "
                f"Understood are {'; '.join(form.layout for form in FORMATS)}."
            )
        if found.takes_camera:
            return found.open(path, camera if camera is None or isinstance(camera, Camera) else Path(camera))
        if camera is not None:
            raise SessionError(f"{path} ({found.name}) brings its own camera: open it without giving one.")
        return found.open(path)
    except OSError as error:
        raise SessionError(f"{path} cannot be read: {error.strerror or error}.") from error


def _what_it_is(path: Path) -> str:
    if path.is_dir():
        children = sorted(path.iterdir(), key=lambda child: natural_key(child.name))
        names = [child.name + ("/" if child.is_dir() else "") for child in children]
        if not names:
            return "an empty folder"
        return f"a folder with {', '.join(names[:4])}" + (f" and {len(names) - 4} more" if len(names) > 4 else "")
    size = path.stat().st_size
    return f"a file of {size} bytes that no reader knows" if size else "an empty file"
