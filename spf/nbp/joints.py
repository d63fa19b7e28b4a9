"""Kinematic potentials (1): where a body can be, given the one it is joined to, and the angles between two that are."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from spf.hand.kinematics import rotations_about
from spf.nbp.bodies import PLACE, QUATERNION, STATE, rotations_of
from spf.nbp.graph import Joint

__all__ = ["angles_between", "child_of", "draw_angles", "parent_of"]

Array = NDArray[np.float64]


def draw_angles(joint: Joint, around: Array, reach: float, rng: np.random.Generator) -> Array:
    """Draw angles (M, R) of a joint, alike within its limits and within ``reach`` rad of others (M, R)."""
    low = np.clip(around - reach, *joint.limits.T)
    high = np.clip(around + reach, *joint.limits.T)
    return rng.uniform(low, high)


def child_of(joint: Joint, parents: Array, angles: Array) -> Array:
    """Return the states (M, 7) of the child for states (M, 7) of the parent and angles (M, R)."""
    base = rotations_of(parents)
    states = np.empty((len(parents), STATE))
    states[:, PLACE] = parents[:, PLACE] + base @ joint.rest[:, 3]
    states[:, QUATERNION] = Rotation.from_matrix(base @ joint.rest[:, :3] @ _turns(joint, angles)).as_quat()
    return states


def parent_of(joint: Joint, children: Array, angles: Array) -> Array:
    """Return the states (M, 7) of the parent for states (M, 7) of the child and angles (M, R)."""
    turned = rotations_of(children) @ (joint.rest[:, :3] @ _turns(joint, angles)).swapaxes(1, 2)
    states = np.empty((len(children), STATE))
    states[:, PLACE] = children[:, PLACE] - turned @ joint.rest[:, 3]
    states[:, QUATERNION] = Rotation.from_matrix(turned).as_quat()
    return states


def angles_between(joint: Joint, parents: Array, children: Array) -> Array:
    """Return the angles (M, R), within the limits, that explain how children (M, 7) are turned against parents (M, 7).

    About each axis in turn the angle of the rotation that is nearest to what remains; exact for two axes.
    """
    remaining = joint.rest[:, :3].T @ rotations_of(parents).swapaxes(1, 2) @ rotations_of(children)
    angles = np.empty((len(parents), len(joint.axes)))
    for r, axis in enumerate(joint.axes):
        i, j = (axis + 1) % 3, (axis + 2) % 3
        turn = np.arctan2(
            remaining[:, j, i] - remaining[:, i, j],
            remaining[:, i, i] + remaining[:, j, j],
        )
        angles[:, r] = turn / joint.gains[r]
        remaining = rotations_about(int(axis), -turn) @ remaining
    return np.clip(angles, *joint.limits.T)


def _turns(joint: Joint, angles: Array) -> Array:
    """Rotations (M, 3, 3) of a joint."""
    turned = np.tile(np.eye(3), (len(angles), 1, 1))
    for axis, gain, angle in zip(joint.axes, joint.gains, angles.T, strict=True):
        turned = turned @ rotations_about(int(axis), gain * angle)
    return turned
