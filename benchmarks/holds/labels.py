"""What the benchmark takes from a session's truth: the side, the labelled hand, and the model's joints as labels mark them."""

from __future__ import annotations

import numpy as np

from spf.evaluate.contradictions import labelled_hand
from spf.evaluate.floor import marked
from spf.frame import JOINT_NAMES
from spf.hand.model import Hand
from spf.joint_definitions import offsets_of
from spf.lens import as_seen
from spf.prepare import side_of
from spf.sessions import Session
from spf.synthetic import SyntheticSession

__all__ = ["as_labelled", "hand_of_labels", "true_side"]

_SIDE_FRAMES = 7  # whose truth says the side of a recording's hand …
_SIZE_FRAMES = 9  # … and its size


def true_side(session: Session) -> str | None:
    """Return the side of a session's hand: what it says, or the one that most of the true joints are fitted by."""
    if session.side is not None or not session.has_truth:
        return session.side
    rights = [side_of(joints) == "right" for joints in _some_joints(session, _SIDE_FRAMES)]
    return "right" if np.mean(rights) > 0.5 else "left"


def hand_of_labels(session: Session, lens: float = 1.0) -> Hand:
    """Return the hand that the labels show: the exact one, or one that they size; its joints are where they mark them.

    Args:
        session: with truth.
        lens: that the hand is seen through (:mod:`spf.lens`).
    """
    if isinstance(session, SyntheticSession):
        return session.hand
    joints = as_seen(_some_joints(session, _SIZE_FRAMES), lens)
    return labelled_hand("left" if true_side(session) == "left" else "right", joints, _offsets(session))


def as_labelled(session: Session, hand: Hand) -> Hand:
    """Return a hand with its joints where the session's truth marks them; the model's own where none were fitted."""
    return marked(hand, _offsets(session))


def _offsets(session: Session) -> np.ndarray:
    offsets = offsets_of(session.joint_definition) if session.has_truth else None
    return np.zeros((len(JOINT_NAMES), 3)) if offsets is None else offsets


def _some_joints(session: Session, count: int) -> np.ndarray:
    """True joints (≤ count, 21, 3) of frames spread over the session."""
    chosen = np.linspace(0, len(session) - 1, count).astype(int)
    truths = [session.truth(int(index)) for index in chosen]
    return np.array([truth.joints for truth in truths if truth is not None])
