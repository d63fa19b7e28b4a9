"""The native session format: MCAP as ROS 2 writes it, one chunk a message (see docs/formats.md)."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from spf.errors import SessionError
from spf.frame import Camera, Truth
from spf.progress import Report, silent
from spf.sessions.mcap_index import McapIndex, has_magic, index_file, read_message
from spf.sessions.mcap_messages import (
    CAMERA_TOPIC,
    COLOUR_TOPIC,
    DEPTH_TOPIC,
    FREE_RECORD,
    JOINTS_TOPIC,
    NOTES_TOPIC,
    ORIENTATION_TOPIC,
    POSE_TOPIC,
    SESSION_RECORD,
    Description,
    decode_array,
    decode_camera,
    decode_image,
    decode_joints,
    decode_note,
)
from spf.sessions.session import Note, Session

__all__ = ["McapSession", "is_mcap", "open_mcap"]


@dataclass(frozen=True, kw_only=True, eq=False)
class McapSession(Session):
    """A session in the native format.

    Attributes:
        path: the file.
        index: where its messages lie.
        stamps: the N log times of the depth messages, in ns; all parts of a frame have the same.
    """

    path: Path
    index: McapIndex
    stamps: tuple[int, ...]

    def raw_depth(self, index: int) -> NDArray[np.uint16]:
        """Return the (H, W) raw counts of a frame."""
        image = decode_image(read_message(self.path, self.index, DEPTH_TOPIC, self.stamps[index]))
        if image.dtype != np.uint16 or image.shape != (self.camera.height, self.camera.width):
            raise SessionError(f"Frame {index} of {self.path} is no depth image of its camera's size: record it again.")
        return image

    def colour(self, index: int) -> NDArray[np.uint8] | None:
        """Return the (H, W, 3) RGB image of a frame, or None."""
        data = self._part(COLOUR_TOPIC, index)
        return None if data is None else decode_image(data)

    def truth(self, index: int) -> Truth | None:
        """Return the ground truth of a frame, or None."""
        joints = self._part(JOINTS_TOPIC, index)
        if joints is None:
            return None
        pose, orientation = self._part(POSE_TOPIC, index), self._part(ORIENTATION_TOPIC, index)
        return Truth(
            joints=decode_joints(joints),
            pose=None if pose is None else decode_array(pose),
            orientation=None if orientation is None else decode_array(orientation),
        )

    def _part(self, topic: str, index: int) -> bytes | None:
        stamp = self.stamps[index]
        if stamp not in self.index.places.get(topic, {}):
            return None
        return read_message(self.path, self.index, topic, stamp)


def is_mcap(path: Path) -> bool:
    """Tell whether a path is an MCAP file."""
    return has_magic(path)


def open_mcap(path: Path, report: Report = silent) -> Session:
    """Open a session in the native format; of a torn file, all the complete frames.

    Args:
        path: of the file.
        report: is told how far looking through a torn file is.

    Raises:
        SessionError: it is another program's MCAP file, of a newer version, or holds no complete frame.
    """
    index = index_file(path, report)
    stamps = tuple(sorted(index.places.get(DEPTH_TOPIC, {})))
    if SESSION_RECORD in index.metadata and not stamps:
        why = "was torn before its first frame was complete" if not index.whole else "holds no frame"
        raise SessionError(f"{path} {why}: record it again.")
    description = _describe(path, index)
    return McapSession(
        uri=str(path),
        name=path.stem,
        format="mcap",
        camera=_read_camera(path, index, description.camera_model),
        times_ns=np.array(stamps, dtype=np.int64) - stamps[0],
        depth_unit=description.depth_unit,
        side=description.side,
        joint_definition=description.joint_definition,
        has_truth=bool(index.places.get(JOINTS_TOPIC)),
        hand_shape=description.hand_shape,
        start_time_ns=description.start_time_ns and stamps[0],
        metadata=index.metadata.get(FREE_RECORD, {}),
        notes=_read_notes(path, index, stamps[0]),
        warnings=() if index.whole else (_what_was_lost(path, index, len(stamps)),),
        path=path,
        index=index,
        stamps=stamps,
    )


def _what_was_lost(path: Path, index: McapIndex, frames: int) -> str:
    """Say what of a torn file was recovered, and what was not."""
    lost = []
    if index.damaged:
        lost.append(f"{index.damaged} damaged stretch{'es' if index.damaged > 1 else ''} in the middle")
    if index.lost_bytes:
        lost.append(f"the last {index.lost_bytes} bytes, an incomplete record,")
    told = f"; {' and '.join(lost)} could not be read" if lost else " and nothing but its index is missing"
    return (
        f"{path.name} was torn: {frames} complete frames were recovered{told}. "
        f"'spf convert {path.name} OUT.mcap' writes a whole file."
    )


def _read_notes(path: Path, index: McapIndex, first: int) -> tuple[Note, ...]:
    stamps = sorted(index.places.get(NOTES_TOPIC, {}))
    read = ((stamp, *decode_note(read_message(path, index, NOTES_TOPIC, stamp))) for stamp in stamps)
    return tuple(Note((stamp - first) / 1e9, kind, text) for stamp, kind, text in read)


def _describe(path: Path, index: McapIndex) -> Description:
    if SESSION_RECORD not in index.metadata:
        if not index.whole and not index.places:
            raise SessionError(f"{path} is torn or damaged from its start on, and no frame can be recovered.")
        topics = ", ".join(sorted(index.places)) or "none"
        raise SessionError(
            f"{path} is an MCAP file that this program did not write (topics: {topics}): convert it to a session first."
        )
    try:
        return Description.from_record(index.metadata[SESSION_RECORD])
    except (KeyError, ValueError) as error:
        raise SessionError(f"The metadata record of {path} is damaged: record it again.") from error


def _read_camera(path: Path, index: McapIndex, model: Any) -> Camera:
    times = index.places.get(CAMERA_TOPIC)
    if not times:
        raise SessionError(f"{path} does not say what camera took it ({CAMERA_TOPIC} is missing): record it again.")
    return decode_camera(read_message(path, index, CAMERA_TOPIC, min(times)), model)
