"""The sixteen rigid bodies of a hand, their states ``x = (q, r)``, and the way to and from the 26 degrees of freedom.

A state is a row (7,): the place q of the body's joint, m, and its orientation as a unit quaternion r (x, y, z, w), camera
frame. The paper's bodies are truncated quadrics; here each is the part of the skin that its bone carries.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from spf.hand.kinematics import angles_of, frames_of_each
from spf.hand.model import Hand

__all__ = [
    "PLACE",
    "QUATERNION",
    "STATE",
    "Bodies",
    "aligned",
    "bodies_of",
    "palm_entries",
    "rotations_of",
    "states_of",
]

Array = NDArray[np.float64]
STATE = 7  # entries of a body's state
PLACE, QUATERNION = slice(0, 3), slice(3, 7)
_POINTS = 32  # of a body's skin


class Bodies(NamedTuple):
    """The bodies of a hand, each in its own frame.

    Attributes:
        points, normals: (B, K, 3) m, of the skin, spread evenly.
        centres: (B, 3) m, middle of the skin.
        radii: (B,) m, half of the body's least width.
    """

    points: Array
    normals: Array
    centres: Array
    radii: Array


def bodies_of(hand: Hand) -> Bodies:
    """Cut a hand's skin into rigid bodies: every vertex belongs to the bone that moves it most."""
    bind, skin = hand.skeleton.bind, hand.skin
    parts = []
    for bone in range(len(bind)):
        own = np.flatnonzero(skin.influence_bone[:, 0] == bone)
        local = (skin.vertices[own] - bind[bone, :, 3]) @ bind[bone, :, :3]
        spread = _spread(local, _POINTS)
        widths = np.sort(local.max(axis=0) - local.min(axis=0))
        normals = skin.normals[own] @ bind[bone, :, :3]
        parts.append((local[spread], normals[spread], local.mean(axis=0), 0.5 * widths[0]))
    points, normals, centres, radii = (np.array(part) for part in zip(*parts, strict=True))
    return Bodies(points, normals, centres, radii)


def _spread(points: Array, count: int) -> NDArray[np.intp]:
    """Indices (count,) of points (M, 3), each the farthest from those before (Gonzalez 1985); some twice if M is less."""
    chosen = [0]
    apart = np.linalg.norm(points - points[0], axis=1)
    while len(chosen) < count:
        chosen.append(int(np.argmax(apart)))
        apart = np.minimum(apart, np.linalg.norm(points - points[chosen[-1]], axis=1))
    return np.array(chosen)


def states_of(hand: Hand, poses: Array, reference: Array) -> Array:
    """Return the states (B, N, 7) of the bodies of poses (N, D) relative to R_ref (3, 3)."""
    frames = frames_of_each(hand, poses, reference)
    states = np.empty((frames.shape[1], len(poses), STATE))
    states[..., PLACE] = frames[..., 3].swapaxes(0, 1)
    for body, turned in enumerate(frames[..., :3].swapaxes(0, 1)):
        states[body, :, QUATERNION] = Rotation.from_matrix(turned).as_quat()
    return states


def rotations_of(states: Array) -> Array:
    """Return the orientations (M, 3, 3) of states (M, 7), whose quaternions need not be of length 1."""
    return np.asarray(Rotation.from_quat(states[:, QUATERNION]).as_matrix())


def aligned(states: Array, anchor: Array) -> Array:
    """Return states (M, 7) with unit quaternions on the side of an anchor (4,): q and -q are the same orientation."""
    turned = states.copy()
    quaternions = turned[:, QUATERNION]
    quaternions /= np.linalg.norm(quaternions, axis=1, keepdims=True)
    quaternions *= np.where(quaternions @ anchor < 0.0, -1.0, 1.0)[:, None]
    return turned


def palm_entries(hand: Hand, palms: Array, reference: Array) -> Array:
    """Return the palm's six entries (M, 6) of poses relative to R_ref (3, 3) from palm states (M, 7)."""
    bind = hand.skeleton.bind[0]
    turned = rotations_of(palms) @ bind[:, :3].T
    entries = np.empty((len(palms), 6))
    entries[:, :3] = palms[:, PLACE] - turned @ bind[:, 3]
    entries[:, 3:] = [angles_of(turn) for turn in turned @ reference.T]
    return entries
