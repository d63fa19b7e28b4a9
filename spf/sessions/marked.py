"""A session whose frames carry joints that a person marked, in place of the truth that was recorded, joint by joint."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from spf.frame import Truth
from spf.progress import Report, silent
from spf.sessions.choice import split_uri
from spf.sessions.marks import (
    Mark,
    Marks,
    count_marks,
    joints_of_marks,
    marks_file,
    marks_from_json,
    read_marks,
    write_marks,
)
from spf.sessions.mcap import McapSession
from spf.sessions.mcap_index import index_file
from spf.sessions.mcap_messages import MARKS_RECORD
from spf.sessions.session import Session

__all__ = [
    "BY_HAND",
    "MarkedSession",
    "keep_frame",
    "keep_marks",
    "marks_in",
    "path_of",
    "with_marks",
    "with_own_marks",
]

#: The joint definition of a session that has no other truth than marks.
BY_HAND = "marks"


@dataclass(frozen=True, kw_only=True, eq=False)
class MarkedSession(Session):
    """A session and marks.

    Attributes:
        inner: the session as it was recorded.
        marks: by a person.
    """

    inner: Session
    marks: Marks = field(default_factory=dict)

    def raw_depth(self, index: int) -> NDArray[np.uint16]:
        """Return the (H, W) raw counts of a frame."""
        return self.inner.raw_depth(index)

    def colour(self, index: int) -> NDArray[np.uint8] | None:
        """Return the (H, W, 3) RGB image of a frame, or None."""
        return self.inner.colour(index)

    def truth(self, index: int) -> Truth | None:
        """Return the joints marked, those of the recorded truth where none is; None where nothing is known.

        A frame with a joint marked has no exact pose any more: that is another opinion.
        """
        recorded = self.inner.truth(index)
        joints = joints_of_marks(self.marks.get(index, {}))
        marked = np.isfinite(joints).all(axis=1)
        if not marked.any():
            return recorded
        if recorded is not None:
            joints[~marked] = recorded.joints[~marked]
        return Truth(joints)

    def fingerprint(self, report: Report = silent) -> str:
        """Return that of the recording: marks do not make another one of it."""
        return self.inner.fingerprint(report)

    def close(self) -> None:
        """Give back what the recording holds."""
        self.inner.close()


def with_marks(session: Session, marks: Marks) -> Session:
    """Return a session with these marks in place of those that it has; the recording itself when there are none."""
    inner = session.inner if isinstance(session, MarkedSession) else session
    if not marks:
        return inner
    frames, joints = count_marks(marks)
    told = f"{frames} frame{'s' * (frames != 1)} with {joints} joint{'s' * (joints != 1)} marked by hand"
    known = {entry.name: getattr(inner, entry.name) for entry in dataclasses.fields(Session)}
    known["metadata"] = {**inner.metadata, "marks": told}
    if inner.has_truth and joints:
        known["warnings"] = (*inner.warnings, f"{told}: they stand in for the recorded truth.")
    elif joints:
        known |= {"has_truth": True, "joint_definition": BY_HAND}
    return MarkedSession(**known, inner=inner, marks=marks)


def marks_in(session: Session) -> Marks:
    """Return the marks of a session."""
    return session.marks if isinstance(session, MarkedSession) else {}


def path_of(session: Session) -> Path:
    """Return the file or folder that a session was read from."""
    return split_uri(session.uri)[0]


def with_own_marks(session: Session) -> Session:
    """Return a session with the marks that are kept with it: in the file beside it, else within a native file.

    Raises:
        SessionError: the marks are torn, or of another recording.
    """
    inside = session.index.metadata.get(MARKS_RECORD) if isinstance(session, McapSession) else None
    return with_marks(session, _kept(session, inside))


def _kept(session: Session, inside: dict[str, str] | None) -> Marks:
    size = session.camera.width, session.camera.height
    beside = marks_file(path_of(session))
    if beside.is_file():
        return read_marks(beside, len(session), size)
    if inside is None:
        return {}
    return marks_from_json(inside["marks"], len(session), size, f"The marks within {session.uri}")


def keep_marks(session: Session, marks: Marks) -> Session:
    """Keep marks beside a session, in place of all that it had, and return the session with them.

    Raises:
        SessionError: the file beside it cannot be written.
    """
    size = session.camera.width, session.camera.height
    write_marks(marks, marks_file(path_of(session)), len(session), size)
    return with_marks(session, marks)


def keep_frame(session: Session, index: int, joints: Mapping[str, Mark]) -> Session:
    """Keep the marks of one frame beside a session, and return the session with all that is kept by now, whoever marked it.

    Raises:
        SessionError: what is kept cannot be read, or the file beside it not be written.
    """
    inner = session.inner if isinstance(session, MarkedSession) else session
    inside = index_file(inner.path).metadata.get(MARKS_RECORD) if isinstance(inner, McapSession) else None
    others = {frame: marks for frame, marks in _kept(inner, inside).items() if frame != index}
    return keep_marks(inner, dict(sorted({**others, index: joints}.items())) if joints else others)
