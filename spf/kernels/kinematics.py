"""Forward kinematics of the bones and its derivative products (spec 2; eq. 1, 14, 22).

All positions here are relative to the palm's centre ``p[0:3]`` until a point is placed in the camera frame: this keeps
torques well scaled. A degree of freedom is a rotation about a line, written as a screw ``ξ = (axis, origin × axis)``
that serves both products, which never build a 26-column Jacobian:

    JVP:  twist of a bone  (ω, ν) = Σ ξ_d v_d    over the rotations above it; a point at x moves with ω × x + ν
    VJP:  g_d = ξ_d · (torque, force)            of all bones below it, summed up the tree

All that is known of a bone lies in one row of a table, so that the loops over points have one place to read and write.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from spf.kernels.compiling import allocating, index, part

__all__ = [
    "BONE_COLUMNS",
    "FRAME",
    "GRADIENT",
    "PRODUCT",
    "TWIST",
    "Chain",
    "Skeleton",
    "bone_twists",
    "joint_gradient",
    "make_chain",
    "pose_bones",
]

Array = NDArray[np.float64]

# Columns of a bone's row: T_palm_bone (3×4, row by row), its twist, and two wrenches (torque, force).
FRAME, TWIST, GRADIENT, PRODUCT, BONE_COLUMNS = 0, 12, 18, 24, 30


class Skeleton(NamedTuple):
    """The bones as flat arrays: B bones, R revolute axes.

    Attributes:
        parent: (B,) parent of each bone, parents first; -1 for the palm.
        bind: (B, 3, 4) T_model_bone in the bind pose.
        inverse_bind: (B, 3, 4) T_bone_model in the bind pose.
        rest: (B, 3, 4) T_parent_bone in the bind pose; the palm's is relative to the model frame.
        revolute_bone, revolute_axis, revolute_dof: (R,) a rotation of that bone about its own axis 0-2, driven by a
            pose entry; in the order of the bones, and of a bone in the order of application.
        revolute_gain: (R,) radians of rotation per radian of the pose entry (sign of the side; 2/3 for a tied DIP).
    """

    parent: NDArray[np.int32]
    bind: Array
    inverse_bind: Array
    rest: Array
    revolute_bone: NDArray[np.int32]
    revolute_axis: NDArray[np.int32]
    revolute_gain: Array
    revolute_dof: NDArray[np.int32]


class Chain(NamedTuple):
    """The posed bones; made once, filled for every pose.

    Attributes:
        bones: (B, BONE_COLUMNS) frames T_palm_bone (camera orientation, from the palm's centre), twists, wrenches.
        screws: (3 + R, 6) of the three palm angles, then of every revolute.
        angles, cosines, sines: (R,) of the revolutes.
    """

    bones: Array
    screws: Array
    angles: Array
    cosines: Array
    sines: Array


@allocating
def make_chain(bones: int, revolutes: int) -> Chain:
    """Allocate a Chain."""
    return Chain(
        np.zeros((bones, BONE_COLUMNS)),
        np.zeros((3 + revolutes, 6)),
        np.zeros(revolutes),
        np.zeros(revolutes),
        np.zeros(revolutes),
    )


@part
def pose_bones(skeleton: Skeleton, pose: Array, reference: Array, chain: Chain) -> None:
    """Forward kinematics: the frames of all bones and the screws of all rotations, for a pose (D,) and R_ref (3, 3)."""
    parents, rest = skeleton.parent, skeleton.rest
    owners, axes = skeleton.revolute_bone, skeleton.revolute_axis
    bones, screws, cosines, sines = chain.bones, chain.screws, chain.cosines, chain.sines
    _cosines(skeleton.revolute_gain, skeleton.revolute_dof, pose, chain.angles, cosines, sines)
    _pose_palm(pose, reference, rest, bones, screws)
    turn = 0
    for b in range(1, parents.shape[0]):
        p = index(parents[b])
        for i in range(0, 12, 4):
            x, y, z = bones[p, i], bones[p, i + 1], bones[p, i + 2]
            for j in range(4):
                bones[b, i + j] = x * rest[b, 0, j] + y * rest[b, 1, j] + z * rest[b, 2, j]
            bones[b, i + 3] += bones[p, i + 3]
        while turn < owners.shape[0] and owners[turn] == b:
            axis = index(axes[turn])
            _screw(bones, b, axis, screws, turn + 3)
            _turn_columns(bones, b, axis, cosines[turn], sines[turn])
            turn += 1


@part
def _cosines(gains: Array, dofs: NDArray[np.int32], pose: Array, angles: Array, cosines: Array, sines: Array) -> None:
    """cos and sin of all revolutes, in loops that the compiler vectorises."""
    for r in range(gains.shape[0]):
        angles[r] = gains[r] * pose[index(dofs[r])]
    for r in range(gains.shape[0]):
        cosines[r], sines[r] = _cos_sin(angles[r])


@part
def _cos_sin(angle: float) -> tuple[float, float]:
    """cos and sin to 1e-15 for angles of a few turns: Taylor series of what remains after removing quarter turns."""
    quarters = math.floor(angle * (2.0 / math.pi) + 0.5)
    x = angle - quarters * (0.5 * math.pi)
    z = x * x
    s = 1 / 362880 + z * (-1 / 39916800 + z * (1 / 6227020800 - z / 1307674368000))
    s = x + x * z * (-1 / 6 + z * (1 / 120 + z * (-1 / 5040 + z * s)))
    c = -1 / 3628800 + z * (1 / 479001600 + z * (-1 / 87178291200 + z / 20922789888000))
    c = 1.0 + z * (-1 / 2 + z * (1 / 24 + z * (-1 / 720 + z * (1 / 40320 + z * c))))
    quadrant = int(quarters) & 3
    c, s = (s, c) if quadrant & 1 else (c, s)
    return (-c if quadrant == 1 or quadrant == 2 else c), (-s if quadrant >= 2 else s)


@part
def _pose_palm(pose: Array, reference: Array, rest: Array, bones: Array, screws: Array) -> None:
    """Set the palm's frame to Rx(a) Ry(b) Rz(c) R_ref, and the screws of the three angles."""
    ca, sa = _cos_sin(pose[3])
    cb, sb = _cos_sin(pose[4])
    cc, sc = _cos_sin(pose[5])
    screws[:3] = 0.0
    screws[0, 0] = 1.0
    screws[1, 1], screws[1, 2] = ca, sa
    screws[2, 0], screws[2, 1], screws[2, 2] = sb, -sa * cb, ca * cb
    for j in range(4):
        x, y, z = rest[0, 0, j], rest[0, 1, j], rest[0, 2, j]
        x, y, z = (
            reference[0, 0] * x + reference[0, 1] * y + reference[0, 2] * z,
            reference[1, 0] * x + reference[1, 1] * y + reference[1, 2] * z,
            reference[2, 0] * x + reference[2, 1] * y + reference[2, 2] * z,
        )
        x, y = cc * x - sc * y, sc * x + cc * y
        x, z = cb * x + sb * z, cb * z - sb * x
        y, z = ca * y - sa * z, sa * y + ca * z
        bones[0, j], bones[0, 4 + j], bones[0, 8 + j] = x, y, z


@part
def _screw(bones: Array, b: int, axis: int, screws: Array, s: int) -> None:
    """Screw of the rotation of a bone about one of its own axes as it is now turned."""
    ax, ay, az = bones[b, axis], bones[b, 4 + axis], bones[b, 8 + axis]
    ox, oy, oz = bones[b, 3], bones[b, 7], bones[b, 11]
    screws[s, 0], screws[s, 1], screws[s, 2] = ax, ay, az
    screws[s, 3], screws[s, 4], screws[s, 5] = oy * az - oz * ay, oz * ax - ox * az, ox * ay - oy * ax


@part
def _turn_columns(bones: Array, b: int, axis: int, c: float, s: float) -> None:
    """Right-multiply a bone's rotation by one about its own axis: two columns mix."""
    i, j = index((axis + 1) % 3), index((axis + 2) % 3)
    for row in range(0, 12, 4):
        x, y = bones[b, row + i], bones[b, row + j]
        bones[b, row + i] = c * x + s * y
        bones[b, row + j] = c * y - s * x


@part
def bone_twists(skeleton: Skeleton, direction: Array, chain: Chain) -> None:
    """Set the twists of all bones about the palm's centre, for a velocity (D,) of the pose (the tree part of J_F v).

    The palm's own translation is no part of them.
    """
    parents, owners = skeleton.parent, skeleton.revolute_bone
    gains, dofs = skeleton.revolute_gain, skeleton.revolute_dof
    bones, screws = chain.bones, chain.screws
    a, b, c = direction[3], direction[4], direction[5]
    for i in range(6):
        bones[0, TWIST + i] = a * screws[0, i] + b * screws[1, i] + c * screws[2, i]
    turn = 0
    for bone in range(1, parents.shape[0]):
        p = index(parents[bone])
        x, y, z = bones[p, TWIST], bones[p, TWIST + 1], bones[p, TWIST + 2]
        u, v, w = bones[p, TWIST + 3], bones[p, TWIST + 4], bones[p, TWIST + 5]
        while turn < owners.shape[0] and owners[turn] == bone:
            rate = gains[turn] * direction[index(dofs[turn])]
            x += rate * screws[turn + 3, 0]
            y += rate * screws[turn + 3, 1]
            z += rate * screws[turn + 3, 2]
            u += rate * screws[turn + 3, 3]
            v += rate * screws[turn + 3, 4]
            w += rate * screws[turn + 3, 5]
            turn += 1
        bones[bone, TWIST], bones[bone, TWIST + 1], bones[bone, TWIST + 2] = x, y, z
        bones[bone, TWIST + 3], bones[bone, TWIST + 4], bones[bone, TWIST + 5] = u, v, w


@part
def joint_gradient(skeleton: Skeleton, chain: Chain, gradient: Array, product: Array) -> None:
    """Turn the wrenches on the bones into gradients of the pose (the tree part of J_Fᵀ u), for both wrenches.

    Args:
        skeleton: the bones.
        chain: with wrenches about the palm's centre; afterwards a bone's hold those of all bones below it, too.
        gradient, product: (D,) to which the two are **added**.
    """
    parents, owners = skeleton.parent, skeleton.revolute_bone
    gains, dofs = skeleton.revolute_gain, skeleton.revolute_dof
    bones, screws = chain.bones, chain.screws
    for b in range(parents.shape[0] - 1, 0, -1):
        p = index(parents[b])
        for i in range(GRADIENT, BONE_COLUMNS):
            bones[p, i] += bones[b, i]
    for i in range(3):
        gradient[i] += bones[0, GRADIENT + 3 + i]
        product[i] += bones[0, PRODUCT + 3 + i]
        gradient[3 + i] += _work(screws, i, bones, 0, GRADIENT)
        product[3 + i] += _work(screws, i, bones, 0, PRODUCT)
    for r in range(owners.shape[0]):
        b, d, gain = index(owners[r]), index(dofs[r]), gains[r]
        gradient[d] += gain * _work(screws, r + 3, bones, b, GRADIENT)
        product[d] += gain * _work(screws, r + 3, bones, b, PRODUCT)


@part
def _work(screws: Array, s: int, bones: Array, b: int, at: int) -> float:
    """Work rate of a wrench in a screw: their product as 6-vectors."""
    rotation = screws[s, 0] * bones[b, at] + screws[s, 1] * bones[b, at + 1] + screws[s, 2] * bones[b, at + 2]
    shift = screws[s, 3] * bones[b, at + 3] + screws[s, 4] * bones[b, at + 4] + screws[s, 5] * bones[b, at + 5]
    return rotation + shift
