"""The 26-DOF hand model (spec 1, 2): bones, degrees of freedom, joint limits, and the arrays that the kernels read.

The pose ``p`` (D entries, D = 26, or 30 with free DIP joints):

====== =====================================================================================
0-2    translation of the palm's centre, metres, camera frame
3-5    palm rotation: three angles about x, y, z on top of a reference orientation ``R_ref``
6-9    thumb: TM abduction, TM flexion, MP flexion, IP flexion
10-25  index, middle, ring, little: MP abduction, MP flexion, MP twist, PIP flexion
26-29  index, middle, ring, little: DIP flexion, only when free; else DIP = 2/3 PIP
====== =====================================================================================

Flexion is positive when the finger closes, abduction when it moves towards the thumb, on both hands, so that a pose of
the right hand is the mirrored pose of the left one. All angles are relative to the bind pose.
"""

from __future__ import annotations

import math
from functools import lru_cache
from importlib.resources import as_file, files
from pathlib import Path
from typing import Literal, NamedTuple

import fast_simplification
import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from spf.errors import HandError
from spf.hand.glb import SkinnedMesh, read_glb
from spf.kernels.kinematics import Skeleton
from spf.kernels.skinning import MOST_INFLUENCES, SHARE_COLUMNS, Skin

__all__ = [
    "BONES",
    "DOF_NAMES",
    "FINGERS",
    "FREE_DIP_NAMES",
    "MIRROR",
    "Hand",
    "load_hand",
    "mirrored",
    "vertex_normals",
]

Side = Literal["left", "right"]

#: Factors on coordinates that take a right hand to a left one and back, in a hand's own frames as in a camera's.
MIRROR = np.array([-1.0, 1.0, 1.0])

FINGERS = ("thumb", "index", "middle", "ring", "little")

#: Bones, parents first: the palm and three a digit.
BONES: tuple[str, ...] = (
    *("palm", "thumb_metacarpal", "thumb_proximal", "thumb_distal"),
    *(f"{finger}_{bone}" for finger in FINGERS[1:] for bone in ("proximal", "intermediate", "distal")),
)

DOF_NAMES: tuple[str, ...] = (
    *("palm_x", "palm_y", "palm_z", "palm_rotation_x", "palm_rotation_y", "palm_rotation_z"),
    *("thumb_tm_abduction", "thumb_tm_flexion", "thumb_mp_flexion", "thumb_ip_flexion"),
    *(
        f"{finger}_{angle}"
        for finger in FINGERS[1:]
        for angle in ("mp_abduction", "mp_flexion", "mp_twist", "pip_flexion")
    ),
)
FREE_DIP_NAMES: tuple[str, ...] = tuple(f"{finger}_dip_flexion" for finger in FINGERS[1:])

DIP_PER_PIP = 2.0 / 3.0  # intra-finger constraint
_PROXY_FACES = 560  # triangles of the coarse copy: 1-2 mm off the skin, drawn in 20 µs
_FAINT = 0.03  # of a vertex's strongest influence, under which another is left out: 0.05 mm of surface on average
_MIDDLE_TIP = 12

# Degrees, relative to the bind pose: (low, high). Chosen by looking at the mesh posed at each of them: the widest
# that a hand reaches (thumb to the little fingertip, thumb over a fist, fingers spread or crossed) with its skin whole.
_THUMB_LIMITS = ((-40.0, 60.0), (-35.0, 60.0), (-25.0, 70.0), (-35.0, 85.0))
_ABDUCTION_LIMITS = {"index": (-20.0, 30.0), "middle": (-20.0, 20.0), "ring": (-22.0, 20.0), "little": (-32.0, 22.0)}
_MP_FLEXION_LIMITS = (-25.0, 95.0)
_TWIST_LIMITS = (-4.0, 4.0)
_PIP_LIMITS = (-10.0, 112.0)
_DIP_LIMITS = (-10.0, 85.0)

_WEBXR_BONE = {"proximal": "phalanx-proximal", "intermediate": "phalanx-intermediate", "distal": "phalanx-distal"}


def _webxr_finger(finger: str) -> str:
    return "thumb" if finger == "thumb" else f"{'pinky' if finger == 'little' else finger}-finger"


def _webxr_joint(bone: str) -> str:
    """Name of the WebXR joint at which a bone begins."""
    if bone == "palm":
        return "wrist"
    finger, part = bone.split("_")
    return f"{_webxr_finger(finger)}-{_WEBXR_BONE.get(part, part)}"


class Hand(NamedTuple):
    """A hand ready to be posed.

    Attributes:
        side: ``"left"`` or ``"right"``.
        skeleton: bones and their axes of rotation, as the kernels read them.
        skin: the vertices and what moves them.
        faces: (F, 3) int32 triangles of the skin, outward.
        proxy: a coarse copy of the skin, for depth rendering at low resolution.
        proxy_faces: (P, 3) its triangles.
        limits: (D, 2) lowest and highest value of every entry of the pose; ±inf for the palm.
        dof_names: D names.
        joint_bone: (21,) bone whose frame carries each joint of :data:`~spf.frame.JOINT_NAMES`.
        joint_offset: (21, 3) m, the joint in that bone's frame.
        digit: (V,) which digit carries most of a vertex: 0 palm, 1 thumb … 5 little.
    """

    side: Side
    skeleton: Skeleton
    skin: Skin
    faces: NDArray[np.int32]
    proxy: Skin
    proxy_faces: NDArray[np.int32]
    limits: NDArray[np.float64]
    dof_names: tuple[str, ...]
    joint_bone: NDArray[np.int32]
    joint_offset: NDArray[np.float64]
    digit: NDArray[np.int32]

    @property
    def dofs(self) -> int:
        """Number of entries of the pose, D."""
        return len(self.dof_names)

    @property
    def free_dip(self) -> bool:
        """Whether the distal joints of the fingers are free, instead of following the middle ones."""
        return self.dofs > len(DOF_NAMES)

    @property
    def length(self) -> float:
        """Length of the hand from wrist to the middle finger's tip joint in the bind pose, m."""
        bind = self.skeleton.bind[self.joint_bone[_MIDDLE_TIP]]
        tip = bind[:, :3] @ self.joint_offset[_MIDDLE_TIP] + bind[:, 3]
        return float(np.linalg.norm(tip - self.skeleton.bind[0, :, 3]))

    def scaled(self, factor: float) -> Hand:
        """Return the hand enlarged by a factor."""

        def enlarge(transforms: NDArray[np.float64]) -> NDArray[np.float64]:
            return np.ascontiguousarray(transforms * np.array([1.0, 1.0, 1.0, factor]))

        skeleton = self.skeleton._replace(
            bind=enlarge(self.skeleton.bind),
            inverse_bind=enlarge(self.skeleton.inverse_bind),
            rest=enlarge(self.skeleton.rest),
        )
        return self._replace(
            skeleton=skeleton,
            skin=_scaled_skin(self.skin, factor),
            proxy=_scaled_skin(self.proxy, factor),
            joint_offset=self.joint_offset * factor,
        )

    def neutral_pose(self) -> NDArray[np.float64]:
        """Return the bind pose at the origin: zeros, (D,)."""
        return np.zeros(self.dofs)

    def constrain(self, pose: NDArray[np.float64]) -> NDArray[np.float64]:
        """Map poses (…, D) back into the joint limits (23)."""
        return np.clip(pose, self.limits[:, 0], self.limits[:, 1])


@lru_cache(maxsize=8)
def load_hand(side: Side = "right", path: str | Path | None = None, *, free_dip: bool = False) -> Hand:
    """Load the bundled WebXR hand of a side, or any ``.glb`` with the 25 WebXR joint names.

    Args:
        side: which hand; decides the sign of abduction and twist.
        path: a ``.glb`` file; None for the bundled mesh.
        free_dip: 30 degrees of freedom with free DIP joints instead of DIP = 2/3 PIP.

    Raises:
        HandError: the file cannot be read or lacks some of the joints.
    """
    if side not in ("left", "right"):
        raise HandError(f"A hand is 'left' or 'right', not '{side}'.")
    if path is not None:
        return build_hand(read_glb(path), side, free_dip=free_dip)
    with as_file(files("spf.hand") / "assets" / f"{side}.glb") as bundled:
        return build_hand(read_glb(bundled), side, free_dip=free_dip)


def build_hand(mesh: SkinnedMesh, side: Side, *, free_dip: bool = False) -> Hand:
    """Build the hand model from a skinned mesh: 16 bones, their revolute axes, limits and skin.

    Raises:
        HandError: some of the 25 WebXR joints are missing, or a joint is scaled.
    """
    index = {name: number for number, name in enumerate(mesh.joint_names)}
    needed = [_webxr_joint(bone) for bone in BONES] + [f"{_webxr_finger(finger)}-tip" for finger in FINGERS]
    missing = [name for name in needed if name not in index]
    if missing:
        raise HandError(f"The hand model lacks the WebXR joints {', '.join(missing)}; name its joints as WebXR does.")
    bind = _rigid(np.array([mesh.bind[index[_webxr_joint(bone)]] for bone in BONES]))
    joint_bone, joint_offset = _joints(mesh, index, bind)
    weights = _fold_weights(mesh, index)
    return assemble_hand(
        side, mesh.vertices, mesh.faces, weights, bind[:, :3, :], joint_bone, joint_offset, free_dip=free_dip
    )


def assemble_hand(
    side: Side,
    vertices: NDArray[np.float64],
    faces: NDArray[np.int32],
    weights: NDArray[np.float64],
    bind: NDArray[np.float64],
    joint_bone: NDArray[np.int32],
    joint_offset: NDArray[np.float64],
    *,
    free_dip: bool,
) -> Hand:
    """Assemble a hand from bind-pose vertices (V, 3), faces, bone weights (V, B) and bind matrices (B, 3, 4).

    The model's own frame gets its origin at the palm's centre and the wrist's axes: −z to the fingers, +y dorsal.
    """
    knuckles = [BONES.index(f"{finger}_proximal") for finger in FINGERS[1:]]
    centre = 0.4 * bind[0, :, 3] + 0.6 * bind[knuckles, :, 3].mean(axis=0)
    to_model = bind[0, :, :3].T
    vertices = (vertices - centre) @ to_model.T
    bind = np.concatenate([to_model @ bind[:, :, :3], ((bind[:, :, 3] - centre) @ to_model.T)[:, :, None]], axis=2)
    parent = _parents()
    revolutes = _revolutes(side, free_dip)
    skeleton = Skeleton(
        parent=parent,
        bind=np.ascontiguousarray(bind),
        inverse_bind=np.array([np.hstack([b[:, :3].T, -b[:, :3].T @ b[:, 3:]]) for b in bind]),
        rest=np.array([_relative(bind[p], bind[b]) if p >= 0 else bind[b] for b, p in enumerate(parent)]),
        revolute_bone=np.array([r[0] for r in revolutes], dtype=np.int32),
        revolute_axis=np.array([r[1] for r in revolutes], dtype=np.int32),
        revolute_gain=np.array([r[3] for r in revolutes]),
        revolute_dof=np.array([r[2] for r in revolutes], dtype=np.int32),
    )
    skin = _skin(vertices, faces, weights, skeleton.inverse_bind)
    proxy_vertices, proxy_faces = _simplified(vertices, faces)
    # what lies beyond the wrist is arm: it bends as the palm does not
    proxy_faces = np.ascontiguousarray(proxy_faces[(proxy_vertices[proxy_faces, 2] < bind[0, 2, 3]).any(axis=1)])
    nearest = cKDTree(vertices).query(proxy_vertices)[1]
    proxy = _skin(proxy_vertices, proxy_faces, weights[nearest], skeleton.inverse_bind)
    names = DOF_NAMES + (FREE_DIP_NAMES if free_dip else ())
    digit = np.array([0, *([1] * 3), *([2] * 3), *([3] * 3), *([4] * 3), *([5] * 3)], dtype=np.int32)
    digits = digit[skin.influence_bone[:, 0]]
    limits = _limits(free_dip)
    return Hand(side, skeleton, skin, faces, proxy, proxy_faces, limits, names, joint_bone, joint_offset, digits)


def mirrored(hand: Hand) -> Hand:
    """Return the exact mirror image of a hand: the other side, the same mesh reflected in its sagittal plane."""
    bind = hand.skeleton.bind.copy()
    bind[:, :, 3] *= MIRROR
    bind[:, :, :3] = MIRROR[:, None] * bind[:, :, :3] * MIRROR  # M R M is again a rotation
    return assemble_hand(
        "left" if hand.side == "right" else "right",
        hand.skin.vertices * MIRROR,
        np.ascontiguousarray(hand.faces[:, ::-1]),
        bone_weights(hand),
        bind,
        hand.joint_bone,
        hand.joint_offset * MIRROR,
        free_dip=hand.free_dip,
    )


def bone_weights(hand: Hand) -> NDArray[np.float64]:
    """Return the dense skinning weights (V, B)."""
    weights = np.zeros((len(hand.skin.vertices), len(BONES)))
    np.put_along_axis(weights, hand.skin.influence_bone.astype(np.intp), hand.skin.influence_weight, axis=1)
    return weights


def _skin(
    vertices: NDArray[np.float64],
    faces: NDArray[np.int32],
    weights: NDArray[np.float64],
    inverse_bind: NDArray[np.float64],
) -> Skin:
    """Keep the four strongest influences of every vertex, without those that hardly move it."""
    order = np.argsort(-weights, axis=1)[:, :MOST_INFLUENCES]
    strongest = np.take_along_axis(weights, order, axis=1)
    strongest[strongest < _FAINT * strongest[:, :1]] = 0.0
    strongest /= strongest.sum(axis=1, keepdims=True)
    normals = vertex_normals(vertices, faces)
    shares = np.zeros((*order.shape, SHARE_COLUMNS))
    to_bone = inverse_bind[order]
    shares[..., :3] = np.einsum("vcij,vj->vci", to_bone[..., :3], vertices) + to_bone[..., 3]
    shares[..., 3] = 1.0
    shares[..., 4:7] = np.einsum("vcij,vj->vci", to_bone[..., :3], normals)
    shares *= strongest[..., None]
    shares[:, :-1, 7] = strongest[:, 1:] > 0
    return Skin(
        vertices=np.ascontiguousarray(vertices),
        normals=normals,
        influence_count=(strongest > 0).sum(axis=1).astype(np.int32),
        influence_bone=order.astype(np.int32),
        influence_weight=strongest,
        shares=shares.reshape(-1, SHARE_COLUMNS),
    )


def _scaled_skin(skin: Skin, factor: float) -> Skin:
    """Return a skin enlarged by a factor about the model's origin, with bones that are enlarged, too."""
    along = np.array([factor, factor, factor, 1.0, 1.0, 1.0, 1.0, 1.0])
    return skin._replace(vertices=skin.vertices * factor, shares=skin.shares * along)


def _simplified(
    vertices: NDArray[np.float64], faces: NDArray[np.int32]
) -> tuple[NDArray[np.float64], NDArray[np.int32]]:
    points, triangles = fast_simplification.simplify(vertices, faces, target_count=_PROXY_FACES, agg=3)
    return np.asarray(points, dtype=np.float64), np.asarray(triangles, dtype=np.int32)


def vertex_normals(vertices: NDArray[np.float64], faces: NDArray[np.int32]) -> NDArray[np.float64]:
    """Return the area-weighted unit normals (V, 3) of a mesh."""
    corners = vertices[faces]
    face_normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    corner, each = faces.T.ravel(), np.tile(face_normals, (3, 1))
    normals = np.stack([np.bincount(corner, each[:, axis], len(vertices)) for axis in range(3)], axis=1)
    length = np.linalg.norm(normals, axis=1, keepdims=True)
    return np.divide(normals, length, out=np.tile([0.0, 0.0, 1.0], (len(vertices), 1)), where=length > 0)


def _relative(parent: NDArray[np.float64], child: NDArray[np.float64]) -> NDArray[np.float64]:
    rotation = parent[:, :3].T @ child[:, :3]
    return np.hstack([rotation, (parent[:, :3].T @ (child[:, 3] - parent[:, 3]))[:, None]])


def _rigid(bind: NDArray[np.float64]) -> NDArray[np.float64]:
    """Make the rotations of bind matrices (B, 4, 4) exact: files hold them in single precision."""
    left, stretch, right = np.linalg.svd(bind[:, :3, :3])
    if np.abs(stretch - 1.0).max() > 1e-3 or np.linalg.det(bind[:, :3, :3]).min() < 0.0:
        raise HandError("The joints of the hand model are scaled or mirrored; apply their scale and export it again.")
    exact = bind.copy()
    exact[:, :3, :3] = left @ right
    return exact


def _parents() -> NDArray[np.int32]:
    return np.array([-1, 0, 1, 2, 0, 4, 5, 0, 7, 8, 0, 10, 11, 0, 13, 14], dtype=np.int32)


def _revolutes(side: Side, free_dip: bool) -> list[tuple[int, int, int, float]]:
    """List (bone, axis, dof, gain) in the order in which the rotations are applied. Flexion turns about −x."""
    mirror = 1.0 if side == "right" else -1.0
    revolutes = [(1, 1, 6, mirror), (1, 0, 7, -1.0), (2, 0, 8, -1.0), (3, 0, 9, -1.0)]
    for finger in range(4):
        bone, dof = 4 + 3 * finger, 10 + 4 * finger
        dip = (26 + finger, -1.0) if free_dip else (dof + 3, -DIP_PER_PIP)
        revolutes += [(bone, 1, dof, mirror), (bone, 0, dof + 1, -1.0), (bone, 2, dof + 2, mirror)]
        revolutes += [(bone + 1, 0, dof + 3, -1.0), (bone + 2, 0, *dip)]
    return revolutes


def _limits(free_dip: bool) -> NDArray[np.float64]:
    degrees: list[tuple[float, float]] = [(-math.inf, math.inf)] * 6 + list(_THUMB_LIMITS)
    for finger in FINGERS[1:]:
        degrees += [_ABDUCTION_LIMITS[finger], _MP_FLEXION_LIMITS, _TWIST_LIMITS, _PIP_LIMITS]
    if free_dip:
        degrees += [_DIP_LIMITS] * 4
    return np.radians(np.array(degrees))


def _joints(
    mesh: SkinnedMesh, index: dict[str, int], bind: NDArray[np.float64]
) -> tuple[NDArray[np.int32], NDArray[np.float64]]:
    """Bone and offset of the 21 joints: every joint begins a bone, the tips hang on the distal ones."""
    bones: list[int] = [0]
    offsets: list[NDArray[np.float64]] = [np.zeros(3)]
    for digit, finger in enumerate(FINGERS):
        first = 1 + 3 * digit
        bones += [first, first + 1, first + 2, first + 2]
        tip = mesh.bind[index[f"{_webxr_finger(finger)}-tip"]][:3, 3]
        offsets += [np.zeros(3)] * 3 + [bind[first + 2, :3, :3].T @ (tip - bind[first + 2, :3, 3])]
    return np.array(bones, dtype=np.int32), np.array(offsets)


def _fold_weights(mesh: SkinnedMesh, index: dict[str, int]) -> NDArray[np.float64]:
    """Fold the weights of the 25 joints into 16 bones: finger metacarpals into the palm, tips into the distal bones."""
    bone_of = {_webxr_joint(bone): number for number, bone in enumerate(BONES)}
    for finger in FINGERS:
        bone_of[f"{_webxr_finger(finger)}-tip"] = BONES.index(f"{finger}_distal")
        if finger != "thumb":
            bone_of[f"{_webxr_finger(finger)}-metacarpal"] = 0
    weights = np.zeros((len(mesh.vertices), len(BONES)))
    for name, joint in index.items():
        if name in bone_of:
            weights[:, bone_of[name]] += mesh.weights[:, joint]
    return weights / weights.sum(axis=1, keepdims=True)
