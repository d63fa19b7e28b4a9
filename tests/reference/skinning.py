"""Linear blend skinning as the textbook has it: one 4×4 matrix a joint of the file, by recursion over joint names.

``v_p = Σ_j w_j M_j B_j⁻¹ v`` over all 25 joints: no bones are folded, no axes are kept, no kernel is called.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from spf.hand.glb import SkinnedMesh
from spf.hand.model import vertex_normals

Array = NDArray[np.float64]

FINGERS = {"index": "index-finger", "middle": "middle-finger", "ring": "ring-finger", "little": "pinky-finger"}


def parent_name(joint: str) -> str | None:
    """The joint above a WebXR joint, None above the wrist."""
    if joint == "wrist":
        return None
    finger, part = joint.rsplit("-", 1) if not joint.endswith(("proximal", "intermediate", "distal")) else (
        joint.rsplit("-phalanx-", 1)
    )  # fmt: skip
    order = ["metacarpal", "proximal", "intermediate", "distal", "tip"]
    if finger == "thumb":
        order.remove("intermediate")
    above = order.index(part) - 1
    if above < 0:
        return "wrist"
    return f"{finger}-{order[above]}" if order[above] == "metacarpal" else f"{finger}-phalanx-{order[above]}"


def joint_rotation(joint: str, side: str, angle: dict[str, float]) -> Array:
    """The rotation (3, 3) that a pose, given by names, adds to a joint in its own frame."""
    mirror = 1.0 if side == "right" else -1.0

    def turn(axis: str, radians: float) -> Rotation:
        return Rotation.from_euler(axis, radians)

    rotation = Rotation.identity()
    if joint == "thumb-metacarpal":
        rotation = turn("y", mirror * angle["thumb_tm_abduction"]) * turn("x", -angle["thumb_tm_flexion"])
    elif joint == "thumb-phalanx-proximal":
        rotation = turn("x", -angle["thumb_mp_flexion"])
    elif joint == "thumb-phalanx-distal":
        rotation = turn("x", -angle["thumb_ip_flexion"])
    for finger, webxr in FINGERS.items():
        if joint == f"{webxr}-phalanx-proximal":
            rotation = (
                turn("y", mirror * angle[f"{finger}_mp_abduction"])
                * turn("x", -angle[f"{finger}_mp_flexion"])
                * turn("z", mirror * angle[f"{finger}_mp_twist"])
            )
        elif joint == f"{webxr}-phalanx-intermediate":
            rotation = turn("x", -angle[f"{finger}_pip_flexion"])
        elif joint == f"{webxr}-phalanx-distal":
            dip = angle.get(f"{finger}_dip_flexion", 2.0 / 3.0 * angle[f"{finger}_pip_flexion"])
            rotation = turn("x", -dip)
    return rotation.as_matrix()


def pose_mesh(
    mesh: SkinnedMesh, side: str, angle: dict[str, float], reference: Array
) -> tuple[Array, Array, dict[str, Array]]:
    """Pose a mesh straight from its file.

    Args:
        mesh: vertices, weights and bind matrices of the file.
        side: of the hand.
        angle: all entries of the pose by name.
        reference: (3, 3) R_ref.

    Returns:
        vertices (V, 3), unit normals (V, 3), and the position (3,) of every joint by name.
    """
    bind = dict(zip(mesh.joint_names, mesh.bind, strict=True))
    knuckles = [bind[f"{finger}-phalanx-proximal"][:3, 3] for finger in FINGERS.values()]
    centre = 0.4 * bind["wrist"][:3, 3] + 0.6 * np.mean(knuckles, axis=0)
    palm = np.eye(4)
    angles = [angle[f"palm_rotation_{axis}"] for axis in "xyz"]
    palm[:3, :3] = Rotation.from_euler("XYZ", angles).as_matrix() @ reference @ bind["wrist"][:3, :3].T
    palm[:3, 3] = np.array([angle[f"palm_{axis}"] for axis in "xyz"]) - palm[:3, :3] @ centre

    def world(joint: str) -> Array:
        above = parent_name(joint)
        if above is None:
            return palm @ bind[joint]
        local = np.eye(4)
        local[:3, :3] = joint_rotation(joint, side, angle)
        return world(above) @ np.linalg.inv(bind[above]) @ bind[joint] @ local

    posed = {joint: world(joint) for joint in mesh.joint_names}
    skinning = np.array([posed[joint] @ np.linalg.inv(bind[joint]) for joint in mesh.joint_names])
    blended = np.einsum("vj,jab->vab", mesh.weights, skinning)
    points = np.einsum("vab,vb->va", blended, np.hstack([mesh.vertices, np.ones((len(mesh.vertices), 1))]))
    normals = np.einsum("vab,vb->va", blended[:, :3, :3], vertex_normals(mesh.vertices, mesh.faces))
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    return points[:, :3], normals, {joint: frame[:3, 3] for joint, frame in posed.items()}
