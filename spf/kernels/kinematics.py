"""Forward kinematics, linear blend skinning and their derivative products (spec 2; eq. 1, 2, 14, 22).

All positions here are relative to the palm's centre ``p[0:3]`` until a point is placed in the camera frame: this keeps
torques well scaled. A bone's skinning matrix is ``S = M · B⁻¹`` (3×4). With ``A = Σ w S`` blended per point,

    x̂ = A [v; 1] + p[0:3]          n̂ = A n / ‖A n‖

and both derivative products act on the small matrices S instead of on a 26-column Jacobian per point:

    JVP:  Ṡ_b = [ω_b]× S_b + [0 | ν_b]           twist (ω, ν) propagated down the tree
    VJP:  G_b = Σ_points w (u_x [v; 1]ᵀ + u_n [n; 0]ᵀ)   gathered; then force and torque summed up the tree
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

__all__ = [
    "Skeleton",
    "Skin",
    "bone_twists",
    "joint_gradient",
    "pose_bones",
    "skin",
    "skinning_matrices",
    "skinning_velocities",
]

Array = NDArray[np.float64]


class Skeleton(NamedTuple):
    """The bones as flat arrays: B bones, R revolute axes.

    Attributes:
        parent: (B,) parent of each bone, parents first; -1 for the palm.
        bind: (B, 3, 4) T_model_bone in the bind pose.
        inverse_bind: (B, 3, 4) T_bone_model in the bind pose.
        rest: (B, 3, 4) T_parent_bone in the bind pose; the palm's is relative to the model frame.
        revolute_bone, revolute_axis, revolute_dof: (R,) a rotation of that bone about its own axis 0-2, driven by a
            pose entry; rotations of a bone follow each other in this order.
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


class Skin(NamedTuple):
    """Points that bones move, as flat arrays: V points, at most 4 influences a point.

    Attributes:
        vertices, normals: (V, 3) bind pose, model frame.
        influence_count: (V,) number of bones that move a vertex.
        influence_bone, influence_weight: (V, 4) which, and how much, strongest first.
    """

    vertices: Array
    normals: Array
    influence_count: NDArray[np.int32]
    influence_bone: NDArray[np.int32]
    influence_weight: Array


@njit(cache=True, nogil=True, fastmath=True, inline="always")
def _turn_columns(rotation, axis, angle):
    """Right-multiply a rotation by a rotation about one of its own axes: two columns mix."""
    c, s = math.cos(angle), math.sin(angle)
    i, j = (axis + 1) % 3, (axis + 2) % 3
    for row in range(3):
        a, b = rotation[row, i], rotation[row, j]
        rotation[row, i] = c * a + s * b
        rotation[row, j] = c * b - s * a


@njit(cache=True, nogil=True, fastmath=True)
def pose_bones(skeleton, pose, reference, frames, axes):
    """Forward kinematics: frames of all bones and the world axes of all rotations.

    Args:
        skeleton: Skeleton.
        pose: (D,).
        reference: (3, 3) R_ref.
        frames: (B, 3, 4) out: T_palm_bone, camera orientation, relative to the palm's centre.
        axes: (3 + R, 3) out: unit axes of the three palm angles, then of every revolute.
    """
    turn = np.eye(3)
    for k in range(3):
        for row in range(3):
            axes[k, row] = turn[row, k]
        _turn_columns(turn, k, pose[3 + k])
    palm = turn @ reference
    count = 0
    for bone in range(skeleton.parent.shape[0]):
        parent = skeleton.parent[bone]
        for i in range(3):
            for j in range(4):
                total = 0.0
                for m in range(3):
                    above = palm[i, m] if parent < 0 else frames[parent, i, m]
                    total += above * skeleton.rest[bone, m, j]
                frames[bone, i, j] = total
            if parent >= 0:
                frames[bone, i, 3] += frames[parent, i, 3]
        while count < skeleton.revolute_bone.shape[0] and skeleton.revolute_bone[count] == bone:
            axis = skeleton.revolute_axis[count]
            for row in range(3):
                axes[3 + count, row] = frames[bone, row, axis]
            _turn_columns(frames[bone], axis, skeleton.revolute_gain[count] * pose[skeleton.revolute_dof[count]])
            count += 1


@njit(cache=True, nogil=True, fastmath=True)
def skinning_matrices(skeleton, frames, matrices):
    """S = M B⁻¹ of every bone, (B, 3, 4)."""
    for bone in range(frames.shape[0]):
        for i in range(3):
            for j in range(4):
                total = frames[bone, i, 3] if j == 3 else 0.0
                for m in range(3):
                    total += frames[bone, i, m] * skeleton.inverse_bind[bone, m, j]
                matrices[bone, i, j] = total


@njit(cache=True, nogil=True, fastmath=True)
def bone_twists(skeleton, frames, axes, direction, twists):
    """Twists (B, 6) = (ω, ν about the palm's centre) of all bones for a velocity of the pose (the tree part of J_F v)."""
    count = 0
    for bone in range(skeleton.parent.shape[0]):
        parent = skeleton.parent[bone]
        if parent < 0:
            for c in range(3):
                twists[bone, c] = axes[0, c] * direction[3] + axes[1, c] * direction[4] + axes[2, c] * direction[5]
                twists[bone, 3 + c] = 0.0
        else:
            for c in range(6):
                twists[bone, c] = twists[parent, c]
        while count < skeleton.revolute_bone.shape[0] and skeleton.revolute_bone[count] == bone:
            rate = skeleton.revolute_gain[count] * direction[skeleton.revolute_dof[count]]
            ax, ay, az = axes[3 + count, 0] * rate, axes[3 + count, 1] * rate, axes[3 + count, 2] * rate
            ox, oy, oz = frames[bone, 0, 3], frames[bone, 1, 3], frames[bone, 2, 3]
            twists[bone, 0] += ax
            twists[bone, 1] += ay
            twists[bone, 2] += az
            twists[bone, 3] += oy * az - oz * ay
            twists[bone, 4] += oz * ax - ox * az
            twists[bone, 5] += ox * ay - oy * ax
            count += 1


@njit(cache=True, nogil=True, fastmath=True)
def skinning_velocities(matrices, twists, velocities):
    """Ṡ = [ω]× S + [0 | ν] of every bone, (B, 3, 4)."""
    for bone in range(matrices.shape[0]):
        wx, wy, wz = twists[bone, 0], twists[bone, 1], twists[bone, 2]
        for j in range(4):
            x, y, z = matrices[bone, 0, j], matrices[bone, 1, j], matrices[bone, 2, j]
            velocities[bone, 0, j] = wy * z - wz * y
            velocities[bone, 1, j] = wz * x - wx * z
            velocities[bone, 2, j] = wx * y - wy * x
        for i in range(3):
            velocities[bone, i, 3] += twists[bone, 3 + i]


@njit(cache=True, nogil=True, fastmath=True)
def joint_gradient(skeleton, frames, axes, matrices, gathered, wrenches, gradient):
    """Turn ∂E/∂S gathered per bone into ∂E/∂p (the tree part of J_Fᵀ u).

    Args:
        gathered: (B, 3, 4) Σ w (u_x [v; 1]ᵀ + u_n [n; 0]ᵀ).
        wrenches: (B, 6) scratch: torque about the palm's centre and force of each bone's subtree.
        gradient: (D,) to which the gradient is **added**.
    """
    bones = matrices.shape[0]
    for bone in range(bones):
        tx = ty = tz = 0.0
        for j in range(4):
            sx, sy, sz = matrices[bone, 0, j], matrices[bone, 1, j], matrices[bone, 2, j]
            gx, gy, gz = gathered[bone, 0, j], gathered[bone, 1, j], gathered[bone, 2, j]
            tx += sy * gz - sz * gy
            ty += sz * gx - sx * gz
            tz += sx * gy - sy * gx
        wrenches[bone, 0], wrenches[bone, 1], wrenches[bone, 2] = tx, ty, tz
        for i in range(3):
            wrenches[bone, 3 + i] = gathered[bone, i, 3]
    for bone in range(bones - 1, 0, -1):
        for c in range(6):
            wrenches[skeleton.parent[bone], c] += wrenches[bone, c]
    for i in range(3):
        gradient[i] += wrenches[0, 3 + i]
        gradient[3 + i] += axes[i, 0] * wrenches[0, 0] + axes[i, 1] * wrenches[0, 1] + axes[i, 2] * wrenches[0, 2]
    for r in range(skeleton.revolute_bone.shape[0]):
        bone = skeleton.revolute_bone[r]
        fx, fy, fz = wrenches[bone, 3], wrenches[bone, 4], wrenches[bone, 5]
        ox, oy, oz = frames[bone, 0, 3], frames[bone, 1, 3], frames[bone, 2, 3]
        torque_x = wrenches[bone, 0] - (oy * fz - oz * fy)
        torque_y = wrenches[bone, 1] - (oz * fx - ox * fz)
        torque_z = wrenches[bone, 2] - (ox * fy - oy * fx)
        torque = axes[3 + r, 0] * torque_x + axes[3 + r, 1] * torque_y + axes[3 + r, 2] * torque_z
        gradient[skeleton.revolute_dof[r]] += skeleton.revolute_gain[r] * torque


@njit(cache=True, nogil=True, fastmath=True)
def skin(surface, matrices, translation, points, normals):
    """Pose all vertices and normals (1, 2): (V, 3) each, camera frame."""
    for i in range(surface.vertices.shape[0]):
        vx, vy, vz = surface.vertices[i, 0], surface.vertices[i, 1], surface.vertices[i, 2]
        nx, ny, nz = surface.normals[i, 0], surface.normals[i, 1], surface.normals[i, 2]
        px, py, pz = translation[0], translation[1], translation[2]
        qx = qy = qz = 0.0
        for c in range(surface.influence_count[i]):
            w = surface.influence_weight[i, c]
            s = matrices[surface.influence_bone[i, c]]
            px += w * (s[0, 0] * vx + s[0, 1] * vy + s[0, 2] * vz + s[0, 3])
            py += w * (s[1, 0] * vx + s[1, 1] * vy + s[1, 2] * vz + s[1, 3])
            pz += w * (s[2, 0] * vx + s[2, 1] * vy + s[2, 2] * vz + s[2, 3])
            qx += w * (s[0, 0] * nx + s[0, 1] * ny + s[0, 2] * nz)
            qy += w * (s[1, 0] * nx + s[1, 1] * ny + s[1, 2] * nz)
            qz += w * (s[2, 0] * nx + s[2, 1] * ny + s[2, 2] * nz)
        scale = 1.0 / math.sqrt(qx * qx + qy * qy + qz * qz)
        points[i, 0], points[i, 1], points[i, 2] = px, py, pz
        normals[i, 0], normals[i, 1], normals[i, 2] = qx * scale, qy * scale, qz * scale
