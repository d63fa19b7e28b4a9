"""What the joints of a data set mean on the model: one constant offset a joint in its bone's frame, per data set.

Data sets mark other places than the model's joints (a knuckle on the skin, a tip at the nail). The offsets are fitted
once (``benchmarks/fit_joint_definitions.py``) and stored beside this file with how and when; nothing else is fitted to
truth. They are fractions of the length of the hand, for hands differ in size; those of a left hand are mirrored in x.
"""

from __future__ import annotations

import json
from functools import cache
from importlib.resources import files
from typing import Any

import numpy as np
from numpy.typing import NDArray

from spf.frame import JOINT_NAMES
from spf.hand.kinematics import PosedHand
from spf.hand.model import MIRROR, Hand

__all__ = [
    "MODEL",
    "corrected_joints",
    "definitions",
    "nearest_joints",
    "offset_axes",
    "offsets_of",
    "relative_offsets",
]

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
    return _moved(offset_axes(hand, posed), posed.joints, offsets)


def relative_offsets(hand: Hand, posed: PosedHand, joints: Array) -> Array:
    """Return by how much given joints (21, 3) differ from the model's, in the units of :func:`offsets_of`."""
    return _along(offset_axes(hand, posed), joints - posed.joints)


def offset_axes(hand: Hand, posed: PosedHand) -> Array:
    """Return the axes (21, 3, 3) that offsets are along, in the camera's frame and as long as the hand, m."""
    mirror = MIRROR if hand.side == "left" else np.ones(3)
    return np.asarray(posed.frames[hand.joint_bone][:, :, :3] * mirror * hand.length)


def nearest_joints(axes: Array, joints: Array, truth: Array, held: NDArray[np.bool_]) -> Array:
    """Return the joints of a track with the constant offsets that bring them nearest to a truth, whatever that marks.

    A truth whose joints are defined otherwise, or whose hand has other proportions, is compared with a track by them: they
    take away what is the same in all frames. They are medians over the very frames that they are used in.

    Args:
        axes: (N, 21, 3, 3) from :func:`offset_axes`, of the frames of a track.
        joints: (N, 21, 3) m, of the track.
        truth: (N, 21, 3) m; NaN where a joint is not known.
        held: (N,) frames that the offsets are fitted to.

    Returns:
        (N, 21, 3) m; joints that are never known stay where they are.
    """
    relative = np.ma.masked_invalid(_along(axes[held], (truth - joints)[held]))
    return _moved(axes, joints, np.ma.median(relative, axis=0).filled(0.0))


def _moved(axes: Array, joints: Array, offsets: Array) -> Array:
    """Move joints (…, 3) by offsets (…, 3) along their axes (…, 3, 3)."""
    return np.asarray(joints + np.einsum("...ik,...k->...i", axes, offsets))


def _along(axes: Array, differences: Array) -> Array:
    """Return differences of joints (…, 3) as offsets along their axes (…, 3, 3): what :func:`_moved` undoes."""
    return np.asarray(np.einsum("...ik,...i->...k", axes, differences) / (axes**2).sum(axis=-2))
