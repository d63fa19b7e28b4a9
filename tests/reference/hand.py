"""Forward kinematics and skinning by homogeneous matrices and loops, from the names of the dofs (spec 1, 2)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from spf.hand.model import BONES, Hand

Array = NDArray[np.float64]

# dof name → bone, axis of the bone (x flexes towards −x, y abducts, z twists), in the order of application
_FINGER = (("mp_abduction", "proximal", "y"), ("mp_flexion", "proximal", "x"), ("mp_twist", "proximal", "z"))
_THUMB = (
    ("tm_abduction", "metacarpal", "y"),
    ("tm_flexion", "metacarpal", "x"),
    ("mp_flexion", "proximal", "x"),
    ("ip_flexion", "distal", "x"),
)


def rotations(hand: Hand, pose: Array) -> dict[str, list[Array]]:
    """Bone name → its 4×4 rotations in the order of application."""
    value = dict(zip(hand.dof_names, pose, strict=True))
    turns: dict[str, list[Array]] = {bone: [] for bone in BONES}
    for dof, bone, axis in _THUMB:
        turns[f"thumb_{bone}"].append(_turn(hand, axis, value[f"thumb_{dof}"]))
    for finger in ("index", "middle", "ring", "little"):
        for dof, bone, axis in _FINGER:
            turns[f"{finger}_{bone}"].append(_turn(hand, axis, value[f"{finger}_{dof}"]))
        pip = value[f"{finger}_pip_flexion"]
        turns[f"{finger}_intermediate"].append(_turn(hand, "x", pip))
        turns[f"{finger}_distal"].append(_turn(hand, "x", value.get(f"{finger}_dip_flexion", 2 / 3 * pip)))
    return turns


def _turn(hand: Hand, axis: str, angle: float) -> Array:
    sign = -1.0 if axis == "x" else (1.0 if hand.side == "right" else -1.0)
    matrix = np.eye(4)
    matrix[:3, :3] = Rotation.from_euler(axis.upper(), sign * angle).as_matrix()
    return matrix


def bone_transforms(hand: Hand, pose: Array, reference: Array) -> Array:
    """(B, 4, 4) ``M B⁻¹``, the camera frame from the bind pose."""
    bind = [np.vstack([b, [0, 0, 0, 1]]) for b in hand.skeleton.bind]
    palm = np.eye(4)
    palm[:3, :3] = Rotation.from_euler("XYZ", pose[3:6]).as_matrix() @ reference
    palm[:3, 3] = pose[:3]
    turns, placed = rotations(hand, pose), []
    for bone, name in enumerate(BONES):
        parent = hand.skeleton.parent[bone]
        local = bind[bone] if parent < 0 else np.linalg.inv(bind[parent]) @ bind[bone]
        matrix = (palm if parent < 0 else placed[parent]) @ local
        for turn in turns[name]:
            matrix = matrix @ turn
        placed.append(matrix)
    return np.array([m @ np.linalg.inv(b) for m, b in zip(placed, bind, strict=True)])


def skinned(hand: Hand, transforms: Array, vertex: int) -> tuple[Array, Array]:
    """Place and unit normal of a vertex (1, 2)."""
    blended = np.zeros((4, 4))
    for bone, weight in zip(hand.skin.influence_bone[vertex], hand.skin.influence_weight[vertex], strict=True):
        blended += weight * transforms[bone]
    place = blended @ [*hand.skin.vertices[vertex], 1.0]
    normal = blended @ [*hand.skin.normals[vertex], 0.0]
    return place[:3], normal[:3] / np.linalg.norm(normal)
