"""Open any session: the table of formats, told apart by their content."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

from spf.errors import SessionError
from spf.frame import Camera
from spf.progress import Report, silent
from spf.sessions.arrays import is_arrays, open_arrays
from spf.sessions.azure_mkv import is_azure_mkv, open_azure_mkv
from spf.sessions.bop import is_bop, open_bop
from spf.sessions.choice import choice_of, split_uri
from spf.sessions.cvar import is_cvar, open_cvar
from spf.sessions.files import natural_key
from spf.sessions.icvl import is_icvl, open_icvl
from spf.sessions.marked import with_own_marks
from spf.sessions.mcap import is_mcap, open_mcap
from spf.sessions.msra15 import is_msra15, open_msra15
from spf.sessions.nyu import is_nyu, open_nyu
from spf.sessions.open3d import is_open3d, open_open3d
from spf.sessions.png_folder import is_png_folder, open_png_folder
from spf.sessions.ros_bags import (
    is_realsense,
    is_ros1,
    is_ros2,
    is_ros_mcap,
    open_realsense,
    open_ros1,
    open_ros2,
    open_ros_mcap,
)
from spf.sessions.session import Session
from spf.sessions.tum import is_tum, open_tum

__all__ = ["FORMATS", "Format", "open_session"]


class Format(NamedTuple):
    """One format of sessions.

    Attributes:
        name: what ``session.format`` says.
        layout: what a path of this format looks like, for people.
        fits: tells whether an existing path is of this format.
        open: opens such a path; with a :class:`Choice` and the URI where something may be chosen.
        chosen: what may be chosen of it; nothing of a format that says everything itself.
        reports: whether opening a long one takes its time, and tells a function ``report`` how far it is.
    """

    name: str
    layout: str
    fits: Callable[[Path], bool]
    open: Callable[..., Session]
    chosen: tuple[str, ...] = ()
    reports: bool = False


_OF_A_BAG = ("topic", "camera", "camera_info", "unit")

#: In the order in which they are tried. A new format is one file and one row.
FORMATS: tuple[Format, ...] = (
    Format("ros-mcap", "an MCAP file with ROS messages", is_ros_mcap, open_ros_mcap, _OF_A_BAG, True),
    Format("mcap", "an MCAP file", is_mcap, open_mcap, (), True),
    Format("realsense", "a RealSense recording (.bag, .db3)", is_realsense, open_realsense, _OF_A_BAG, True),
    Format("ros1-bag", "a ROS 1 bag", is_ros1, open_ros1, _OF_A_BAG, True),
    Format("ros2-bag", "a ROS 2 bag (.db3, or its folder)", is_ros2, open_ros2, _OF_A_BAG, True),
    Format("azure-mkv", "an Azure Kinect recording (.mkv)", is_azure_mkv, open_azure_mkv, ("topic", "camera", "unit")),
    Format("msra15", "an MSRA15 gesture folder (joint.txt, 000000_depth.bin, …)", is_msra15, open_msra15),
    Format("cvar", "a CVAR folder (joint.txt, 000000_depth.png, …)", is_cvar, open_cvar),
    Format("nyu", "an NYU folder (depth_1_0000001.png, …, joint_data.mat)", is_nyu, open_nyu),
    Format("icvl", "an ICVL folder (Depth/, labels.txt)", is_icvl, open_icvl),
    Format("tum", "a TUM RGB-D folder (depth.txt, depth/)", is_tum, open_tum, ("camera", "unit")),
    Format("bop", "a BOP scene (scene_camera.json, depth/)", is_bop, open_bop, ("camera", "unit")),
    Format("open3d", "an Open3D folder (depth/, intrinsic.json)", is_open3d, open_open3d, ("camera", "unit")),
    Format(
        "arrays", "NumPy or HDF5 arrays (.npz, .npy, .h5)", is_arrays, open_arrays, ("topic", "camera", "unit"), True
    ),
    Format(
        "png-folder",
        "a folder of 16-bit depth PNGs with camera.json",
        is_png_folder,
        open_png_folder,
        ("camera", "unit"),
    ),
)


def open_session(uri: str | Path, camera: Camera | str | Path | None = None, report: Report = silent) -> Session:
    """Open a session; its format is found by its content, not by its name.

    Args:
        uri: path of a file or folder; what is chosen of it may follow, as in ``room.bag?topic=/camera/depth``
            (see :mod:`spf.sessions.choice`).
        camera: the camera, or a camera file, of a recording that has none of its own, or a wrong one.
        report: is told what is being done and the share done, while a long recording is opened; what it raises ends that.

    Returns:
        the session, with the joints that a person has marked in it (:mod:`spf.sessions.marked`) as its truth;
        :attr:`Session.warnings` says what a user should know of how it was read.

    Raises:
        SessionError: there is nothing there, no format fits, something is left to choose, or what is there is damaged.
    """
    path, options = split_uri(uri)
    if not path.exists():
        raise SessionError(f"There is no file or folder {path}: check the path of the session.")
    try:
        found = next((form for form in FORMATS if form.fits(path)), None)
        if found is None:
            raise SessionError(
                f"{path} is no session: it is {_what_it_is(path)}. "
                f"Understood are {'; '.join(form.layout for form in FORMATS)}."
            )
        if camera is not None and "camera" not in found.chosen:
            raise SessionError(f"{path} ({found.name}) brings its own camera: open it without giving one.")
        left = [name for name in options if name not in found.chosen]
        if left:
            raise SessionError(f"{path} ({found.name}) leaves no {left[0]} to choose: leave out what follows the ?.")
        told: dict[str, Report] = {"report": report} if found.reports else {}
        if not found.chosen:
            return with_own_marks(found.open(path, **told))
        return with_own_marks(found.open(path, choice_of(str(uri), options, camera), str(uri), **told))
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
