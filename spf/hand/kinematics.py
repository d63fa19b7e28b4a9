"""Pose a hand: forward kinematics, skinning (1, 2), and the products ``J_F v`` and ``J_Fᵀ u`` (14, 22)."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from spf.errors import HandError
from spf.hand.model import Hand
from spf.kernels.joints import joints_of_poses
from spf.kernels.kinematics import TWIST, Chain, bone_twists, joint_gradient, make_chain, pose_bones
from spf.kernels.skinning import skin, skin_forces, skin_velocities

__all__ = [
    "PosedHand",
    "angles_of",
    "frames_of_each",
    "joint_jacobian",
    "joints_of",
    "joints_of_each",
    "pose_hand",
    "relative_to_camera",
    "rotation_about",
    "rotations_about",
    "skin_jvp",
    "skin_vjp",
]

Array = NDArray[np.float64]


class PosedHand(NamedTuple):
    """A hand in the camera frame.

    Attributes:
        vertices: (V, 3) m.
        normals: (V, 3) unit.
        joints: (21, 3) m, ordered as :data:`~spf.frame.JOINT_NAMES`.
        frames: (16, 3, 4) T_camera_bone.
    """

    vertices: Array
    normals: Array
    joints: Array
    frames: Array


def _chain(hand: Hand, pose: ArrayLike, reference: ArrayLike | None) -> tuple[Array, Chain]:
    """Check a pose, and pose the bones."""
    p = np.ascontiguousarray(pose, dtype=np.float64)
    if p.shape != (hand.dofs,):
        raise HandError(f"A pose of this hand has {hand.dofs} entries, not {p.shape}.")
    if not np.isfinite(p).all():
        raise HandError("The pose holds a value that is not a finite number.")
    rotation = np.eye(3) if reference is None else np.ascontiguousarray(reference, dtype=np.float64)
    chain = make_chain(len(hand.skeleton.parent), len(hand.skeleton.revolute_bone))
    pose_bones(hand.skeleton, p, rotation, chain)
    return p, chain


def _frames(chain: Chain, pose: Array) -> Array:
    """T_camera_bone (B, 3, 4)."""
    frames = chain.bones[:, :12].reshape(-1, 3, 4)
    frames[:, :, 3] += pose[:3]
    return frames


def pose_hand(hand: Hand, pose: ArrayLike, reference: ArrayLike | None = None) -> PosedHand:
    """Pose a hand: linear blend skinning ``v_p = Σ w M B⁻¹ v_b`` (1, 2; Bray et al. 2007).

    Args:
        hand: the model.
        pose: (D,) metres and radians.
        reference: (3, 3) orientation R_ref that the palm's angles turn; identity when None.

    Raises:
        HandError: the pose has the wrong length or is not finite.
    """
    p, chain = _chain(hand, pose, reference)
    vertices, normals = np.empty_like(hand.skin.vertices), np.empty_like(hand.skin.normals)
    skin(hand.skin, chain, p, vertices, normals)
    frames = _frames(chain, p)
    return PosedHand(vertices, normals, _place_joints(hand, frames), frames)


def joints_of(hand: Hand, pose: ArrayLike, reference: ArrayLike | None = None) -> Array:
    """Return the 21 joints (21, 3) of a pose, m; cheaper than :func:`pose_hand`."""
    p, chain = _chain(hand, pose, reference)
    return _place_joints(hand, _frames(chain, p))


def joints_of_each(hand: Hand, poses: ArrayLike, reference: ArrayLike | None = None) -> Array:
    """Return the joints (N, 21, 3), m, of poses (N, D); see :func:`pose_hand` for ``reference``."""
    p = np.ascontiguousarray(poses, dtype=np.float64)
    axes = np.eye(3) if reference is None else np.ascontiguousarray(reference, dtype=np.float64)
    joints = np.empty((len(p), len(hand.joint_bone), 3))
    joints_of_poses(hand.skeleton, hand.joint_bone, hand.joint_offset, p, axes, joints)
    return joints


def frames_of_each(hand: Hand, poses: ArrayLike, reference: ArrayLike | None = None) -> Array:
    """Return T_camera_bone (N, 16, 3, 4) of poses (N, D); see :func:`pose_hand` for ``reference``."""
    return np.array([_frames(chain, p) for p, chain in (_chain(hand, pose, reference) for pose in np.asarray(poses))])


def _place_joints(hand: Hand, frames: Array) -> Array:
    at = frames[hand.joint_bone]
    return np.einsum("jik,jk->ji", at[:, :, :3], hand.joint_offset) + at[:, :, 3]


def joint_jacobian(hand: Hand, pose: ArrayLike, reference: ArrayLike | None = None) -> Array:
    """Return the derivatives (21, 3, D) of the joints by the entries of the pose, m per m and per rad."""
    _, chain = _chain(hand, pose, reference)
    at = chain.bones[:, :TWIST].reshape(-1, 3, 4)[hand.joint_bone]
    arms = np.einsum("jik,jk->ji", at[:, :, :3], hand.joint_offset) + at[:, :, 3]  # from the palm's centre
    jacobian = np.empty((len(arms), 3, hand.dofs))
    for entry, direction in enumerate(np.eye(hand.dofs)):
        bone_twists(hand.skeleton, direction, chain)
        twists = chain.bones[hand.joint_bone, TWIST : TWIST + 6]
        jacobian[:, :, entry] = np.cross(twists[:, :3], arms) + twists[:, 3:] + direction[:3]
    return jacobian


def rotation_about(angles: ArrayLike) -> Array:
    """Return Rx(a) Ry(b) Rz(c), the palm's rotation relative to R_ref, (3, 3)."""
    a, b, c = np.asarray(angles, dtype=np.float64)
    ca, sa, cb, sb, cc, sc = np.cos(a), np.sin(a), np.cos(b), np.sin(b), np.cos(c), np.sin(c)
    rx = np.array([[1, 0, 0], [0, ca, -sa], [0, sa, ca]])
    ry = np.array([[cb, 0, sb], [0, 1, 0], [-sb, 0, cb]])
    rz = np.array([[cc, -sc, 0], [sc, cc, 0], [0, 0, 1]])
    return rx @ ry @ rz


def rotations_about(axis: int, angles: Array) -> Array:
    """Return rotations (N, 3, 3) about a coordinate axis, for angles (N,) in radians."""
    i, j = (axis + 1) % 3, (axis + 2) % 3
    turned = np.tile(np.eye(3), (len(angles), 1, 1))
    turned[:, i, i] = turned[:, j, j] = np.cos(angles)
    turned[:, j, i] = np.sin(angles)
    turned[:, i, j] = -turned[:, j, i]
    return turned


def relative_to_camera(pose: Array, reference: Array) -> Array:
    """Return a pose (D,) that is relative to R_ref (3, 3) as one whose palm's angles are relative to the camera's axes."""
    turned = pose.copy()
    turned[3:6] = angles_of(rotation_about(pose[3:6]) @ reference)
    return turned


def angles_of(rotation: Array) -> Array:
    """Return the palm angles (a, b, c) with Rx(a) Ry(b) Rz(c) = rotation (3, 3); inverts :func:`rotation_about`."""
    b = np.arcsin(min(max(rotation[0, 2], -1.0), 1.0))
    a = np.arctan2(-rotation[1, 2], rotation[2, 2])
    c = np.arctan2(-rotation[0, 1], rotation[0, 0])
    return np.array([a, b, c])


def skin_jvp(
    hand: Hand, pose: ArrayLike, direction: ArrayLike, reference: ArrayLike | None = None
) -> tuple[Array, Array]:
    """``J_F v``: velocities of all vertices and unit normals, (V, 3) each, for a velocity (D,) of the pose.

    One pass over the bones and one over the points; no Jacobian is built. The normals' part includes the derivative
    of their normalisation.
    """
    _, chain = _chain(hand, pose, reference)
    v = np.ascontiguousarray(direction, dtype=np.float64)
    point_rates, normal_rates = np.empty_like(hand.skin.vertices), np.empty_like(hand.skin.normals)
    bone_twists(hand.skeleton, v, chain)
    skin_velocities(hand.skin, chain, v, point_rates, normal_rates)
    return point_rates, normal_rates


def skin_vjp(
    hand: Hand,
    pose: ArrayLike,
    point_forces: ArrayLike,
    normal_forces: ArrayLike,
    reference: ArrayLike | None = None,
) -> Array:
    """``J_Fᵀ u``: gradient (D,) of ``Σ u_x·x̂ + u_n·n̂`` over all vertices, for forces (V, 3) on points and normals."""
    _, chain = _chain(hand, pose, reference)
    u_x = np.ascontiguousarray(point_forces, dtype=np.float64)
    u_n = np.ascontiguousarray(normal_forces, dtype=np.float64)
    skin_forces(hand.skin, chain, u_x, u_n)
    gradient, nothing = np.zeros(hand.dofs), np.zeros(hand.dofs)
    joint_gradient(hand.skeleton, chain, gradient, nothing)
    return gradient
