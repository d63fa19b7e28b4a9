"""What the joints of a data set mean on the model: one constant offset a joint in its bone's frame, per data set.

Data sets mark other places than the model's joints (a knuckle on the skin, a tip at the nail). The offsets are fitted
once (``benchmarks/fit_joint_definitions.py``) and stored beside this file with how and when; nothing else is fitted to
truth. They are fractions of the length of the hand, for hands differ in size; those of a left hand are mirrored in x.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from functools import cache
from importlib.resources import files
from typing import Any

import numpy as np
from numpy.typing import NDArray

from spf.frame import JOINT_NAMES
from spf.hand.kinematics import PosedHand
from spf.hand.model import MIRROR, Hand

__all__ = ["MODEL", "corrected_joints", "definitions", "offsets_of", "own_offsets", "relative_offsets"]

Array = NDArray[np.float64]
MODEL = "model"  # the project's own definition, which needs no correction


@cache
def definitions() -> dict[str, dict[str, Any]]:
    """Return what is stored: data set → ``offsets`` (joint name → 3 fractions), and how they were fitted."""
    content = (files("spf") / "joint_definitions.json").read_text(encoding="utf-8")
    return dict(json.loads(content))


def offsets_of(definition: str) -> Array | None:
    """Return the offsets (21, 3) of a data set's joints, as fractions of a right hand's length.

    Args:
        definition: ``"model"`` or the name of a data set.

    Returns:
        zeros for the model's own joints; None where none were fitted.
    """
    if definition == MODEL:
        return np.zeros((len(JOINT_NAMES), 3))
    if definition not in definitions():
        return None
    stored = definitions()[definition]["offsets"]
    return np.array([stored[name] for name in JOINT_NAMES])


def corrected_joints(hand: Hand, posed: PosedHand, offsets: Array) -> Array:
    """Return where a data set would mark the joints of a posed hand: (21, 3) m.

    Args:
        hand: the calibrated hand.
        posed: its pose.
        offsets: (21, 3) from :func:`offsets_of`.
    """
    mirror = MIRROR if hand.side == "left" else np.ones(3)
    rotations = posed.frames[hand.joint_bone][:, :, :3]
    return posed.joints + np.einsum("jik,jk->ji", rotations, offsets * mirror * hand.length)


def relative_offsets(hand: Hand, posed: PosedHand, joints: Array) -> Array:
    """Return by how much given joints (21, 3) differ from the model's, in the units of :func:`offsets_of`."""
    mirror = MIRROR if hand.side == "left" else np.ones(3)
    rotations = posed.frames[hand.joint_bone][:, :, :3]
    return np.asarray(np.einsum("jik,ji->jk", rotations, joints - posed.joints) * mirror / hand.length)


def own_offsets(hands: Sequence[tuple[Hand, PosedHand]], joints: Array) -> Array:
    """Return the constant offsets (21, 3) that bring the joints of a track nearest to a truth, whatever that marks.

    A truth whose joints are defined otherwise, or whose hand has other proportions, is compared with a track by them: they
    take away what is the same in all frames. They are fitted to the very frames that they are used in.

    Args:
        hands: N, of a track, with their poses.
        joints: (N, 21, 3) m, true joints; NaN where one is not known.

    Returns:
        medians over the frames; zeros for a joint that is never known.
    """
    relative = [relative_offsets(hand, posed, own) for (hand, posed), own in zip(hands, joints, strict=True)]
    known = np.ma.masked_invalid(np.reshape(relative, (-1, *joints.shape[1:])))
    return np.asarray(np.ma.median(known, axis=0).filled(0.0))
