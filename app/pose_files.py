"""Poses and hands as files: handed to the visitor, or kept for a start."""

from __future__ import annotations

import json
from pathlib import Path

from spf.errors import HandError
from spf.hand import SavedPose, read_pose, write_pose

__all__ = ["file_of", "keep_pose"]


def file_of(name: str, content: object) -> tuple[str, bytes]:
    """Return name and content of a JSON file."""
    return f"{name}.json", (json.dumps(content, indent=2) + "\n").encode()


def keep_pose(pose: SavedPose, folder: Path, name: str) -> Path:
    """Write a pose to a file that is not there yet: those that runs began with are never written over.

    Args:
        pose: that Start is to begin with.
        folder: of all poses, made if need be.
        name: of the file, without its ending; a number is added where it is taken.

    Raises:
        HandError: it cannot be written, or is none that a run can begin with.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise HandError(f"The folder {folder} for poses cannot be made: {error.strerror}.") from None
    names = (f"{name}{f'-{number}' if number > 1 else ''}.json" for number in range(1, 10**6))
    path = next(folder / free for free in names if not (folder / free).exists())
    write_pose(pose, path)
    read_pose(path)
    return path
