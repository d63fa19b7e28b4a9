"""A pose in a small JSON file: the first pose of a run, as a person or another program gives it."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any, NamedTuple, cast

import numpy as np
from numpy.typing import NDArray

from spf.errors import HandError
from spf.hand.model import DOF_NAMES, Side
from spf.hand.shape import HandShape

__all__ = ["SavedPose", "read_pose", "write_pose"]

_FORMAT = "spf-pose"


class SavedPose(NamedTuple):
    """One pose of one frame.

    Attributes:
        side: of the hand.
        pose: (26,) metres and radians, relative to ``reference``.
        reference: (3, 3) R_ref.
        frame: index of the frame that it is for, None where the file does not say.
        shape: of the hand, None where the file does not say.
    """

    side: Side
    pose: NDArray[np.float64]
    reference: NDArray[np.float64]
    frame: int | None = None
    shape: HandShape | None = None

    def to_dict(self) -> dict[str, Any]:
        """Return the content of a pose file."""
        content: dict[str, Any] = {"format": _FORMAT, "version": 1, "side": self.side, "pose": self.pose.tolist()}
        content["reference"] = self.reference.tolist()
        if self.frame is not None:
            content["frame"] = self.frame
        if self.shape is not None:
            content["hand"] = self.shape.to_dict()
        return content

    @classmethod
    def from_dict(cls, content: Any, source: str = "The pose file") -> SavedPose:
        """Check and build a pose from the content of a pose file.

        Raises:
            HandError: it is no pose, or one of another hand model.
        """
        if not isinstance(content, dict) or content.get("format") != _FORMAT:
            raise HandError(f'{source} is no pose file: it should hold "format": "{_FORMAT}", "side" and "pose".')
        side = content.get("side")
        if side not in ("left", "right"):
            raise HandError(f'{source} does not say whose pose it is: write "side": "left" or "right".')
        pose = _numbers(content.get("pose"), source, "pose")
        if pose.shape != (len(DOF_NAMES),):
            raise HandError(
                f"{source} holds the pose of another hand: it has {pose.size} entries, and this hand takes "
                f"{len(DOF_NAMES)}."
            )
        reference = _numbers(content.get("reference", np.eye(3).tolist()), source, "reference")
        if reference.shape != (3, 3) or not np.allclose(reference @ reference.T, np.eye(3), atol=1e-6):
            raise HandError(f"{source} holds a reference that is no rotation matrix of 3×3 numbers.")
        frame = content.get("frame")
        if frame is not None and (not isinstance(frame, int) or isinstance(frame, bool) or frame < 0):
            raise HandError(f"{source} says that it is for frame {frame!r}, which is no frame's number.")
        shape = HandShape.from_dict(content["hand"], source) if "hand" in content else None
        return cls(cast(Side, side), pose, reference, frame, shape)


def _numbers(values: Any, source: str, name: str) -> NDArray[np.float64]:
    try:
        array = np.array(values, dtype=np.float64)
    except (TypeError, ValueError):
        raise HandError(f"{source} holds a {name} that is not a list of numbers.") from None
    if not np.isfinite(array).all():
        raise HandError(f"{source} holds a {name} with a value that is not a finite number.")
    return array


def write_pose(saved: SavedPose, path: str | Path) -> None:
    """Write a pose as JSON.

    Raises:
        HandError: the file cannot be written.
    """
    try:
        Path(path).write_text(json.dumps(saved.to_dict(), indent=2) + "\n", encoding="utf-8")
    except OSError as error:
        raise HandError(f"The pose file {path} cannot be written: {error.strerror}.") from None


def read_pose(path: str | Path) -> SavedPose:
    """Read a pose written by :func:`write_pose` or by hand.

    Raises:
        HandError: the file is missing, torn, no pose, or a pose of another hand model.
    """
    try:
        content = json.loads(Path(path).read_text(encoding="utf-8"))
    except OSError as error:
        raise HandError(f"The pose file {path} cannot be read: {error.strerror}.") from None
    except ValueError:
        raise HandError(f"The pose file {path} is torn or not JSON.") from None
    return SavedPose.from_dict(content, f"The pose file {path}")
