"""Training samples: pose a hand of some shape among other things, draw it, measure it, crop it, and note the answer."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from spf.kernels.compiling import allocating, index, part
from spf.kernels.crops import crop_depth
from spf.kernels.kinematics import Skeleton, make_chain, pose_bones
from spf.kernels.render import project_skin, rasterise
from spf.kernels.sensing import Pools, sense
from spf.kernels.skinning import Skin

__all__ = ["LARGEST_PICTURE", "SampleScenes", "ShapeArrays", "draw_samples"]

Array = NDArray[np.float64]
Image = NDArray[np.float32]

LARGEST_PICTURE = 144  # pixels along a side
_DRAWN = np.float32(1e8)
_GONE = np.float32(-1.0)  # depth of a vertex that is not drawn


class ShapeArrays(NamedTuple):
    """Hands of K shapes that share their topology.

    Attributes:
        skeleton: of any of them; its ``rest`` is not used.
        skin: of any of them; its ``shares`` are not used.
        rests: (K, B, 3, 4) bind pose of every bone in its parent's frame.
        shares: (K, 4 V, SHARE_COLUMNS) skins in their bones' frames.
        joint_offsets: (K, 21, 3) joints in their bones' frames, m.
        joint_bone: (21,) bone that carries each joint.
        faces: (F, 3) of the hand and, with vertices from V on, of the other things.
    """

    skeleton: Skeleton
    skin: Skin
    rests: Array
    shares: Array
    joint_offsets: Array
    joint_bone: NDArray[np.int32]
    faces: NDArray[np.int32]


class SampleScenes(NamedTuple):
    """N scenes in the frames of their crops' cameras; the cubes' centres lie at (0, 0, away).

    Attributes:
        shape: (N,) which shape.
        drawn: (N,) whether there is a hand.
        poses: (N, D), and ``orientations`` (N, 3, 3): the hand.
        others: (N, W, 3) vertices of the other things, m; z ≤ 0 for what is not there.
        planes: (N, 4) a plane behind the hand: its normal, towards the camera, and the gap, m; zeros for none.
        away: (N,) m from the camera to the cube's centre.
        extents: (N,) m, side of the cube.
        focal: (N,) focal length of the sensor, pixels.
        sizes: (N,) pixels along a side of the picture, at most LARGEST_PICTURE.
        faults: (N, len(FAULTS)).
        starts: (N,) places in the pools.
    """

    shape: NDArray[np.int64]
    drawn: NDArray[np.bool_]
    poses: Array
    orientations: Array
    others: Array
    planes: Array
    away: Array
    extents: Array
    focal: Array
    sizes: NDArray[np.int64]
    faults: Array
    starts: NDArray[np.int64]


@allocating
def draw_samples(shapes: ShapeArrays, scenes: SampleScenes, pools: Pools, crops: Image, joints: Array) -> None:
    """Draw N scenes into crops (N, S, S) and their joints (N, 21, 3), m, in the frames of the crops' cameras."""
    chain = make_chain(shapes.rests.shape[1], shapes.skeleton.revolute_bone.shape[0])
    hand_count = shapes.skin.influence_bone.shape[0]
    projected = np.empty((hand_count + scenes.others.shape[1], 3), np.float32)
    clean = np.empty(LARGEST_PICTURE * LARGEST_PICTURE, np.float32)
    spare, seen = np.empty_like(clean), np.empty_like(clean)
    camera, turn, centre = np.ones(5), np.eye(3), np.zeros(3)
    base, skin = shapes.skeleton, shapes.skin
    for n in range(crops.shape[0]):
        k, size = scenes.shape[n], scenes.sizes[n]
        skeleton = Skeleton(
            base.parent, base.bind, base.inverse_bind, shapes.rests[k], base.revolute_bone, base.revolute_axis,
            base.revolute_gain, base.revolute_dof,
        )  # fmt: skip
        surface = Skin(
            skin.vertices, skin.normals, skin.influence_count, skin.influence_bone, skin.influence_weight,
            shapes.shares[k],
        )  # fmt: skip
        camera[0], camera[1] = scenes.focal[n], scenes.focal[n]
        camera[2], camera[3] = 0.5 * (size - 1), 0.5 * (size - 1)
        pose_bones(skeleton, scenes.poses[n], scenes.orientations[n], chain)
        _place_joints(shapes, k, chain.bones, scenes.poses[n], joints[n])
        project_skin(surface, chain, 1.0, scenes.poses[n], camera, projected[:hand_count])
        if not scenes.drawn[n]:
            projected[:hand_count, 2] = _GONE
        _project_others(scenes.others[n], camera, projected[hand_count:])
        depth = clean[: size * size].reshape((size, size))
        rasterise(projected, shapes.faces, depth)
        _add_plane(depth, camera, scenes.planes[n], joints[n])
        picture = seen[: size * size].reshape((size, size))
        sense(
            depth, camera[0], scenes.faults[n], pools, scenes.starts[n],
            spare[: size * size].reshape((size, size)), picture,
        )  # fmt: skip
        centre[2] = scenes.away[n]
        crop_depth(picture, camera, turn, centre, scenes.extents[n], crops[n])


@part
def _place_joints(shapes: ShapeArrays, k: int, bones: Array, pose: Array, joints: Array) -> None:
    for j in range(joints.shape[0]):
        b = index(shapes.joint_bone[j])
        x, y, z = shapes.joint_offsets[k, j, 0], shapes.joint_offsets[k, j, 1], shapes.joint_offsets[k, j, 2]
        for i in range(3):
            joints[j, i] = (
                bones[b, 4 * i] * x + bones[b, 4 * i + 1] * y + bones[b, 4 * i + 2] * z + bones[b, 4 * i + 3] + pose[i]
            )


@part
def _project_others(points: Array, camera: Array, projected: Image) -> None:
    for i in range(points.shape[0]):
        z = points[i, 2]
        scale = 1.0 / z if z > 1e-3 else 0.0
        projected[i, 0] = points[i, 0] * scale * camera[0] + camera[2]
        projected[i, 1] = points[i, 1] * scale * camera[1] + camera[3]
        projected[i, 2] = z


@part
def _add_plane(depth: Image, camera: Array, plane: Array, joints: Array) -> None:
    """Put a plane behind the hand into a z-buffer, and 0 where nothing is drawn."""
    nx, ny, nz = plane[0], plane[1], plane[2]
    there = nz != 0.0
    offset = 1e9
    for j in range(joints.shape[0]):
        offset = min(offset, nx * joints[j, 0] + ny * joints[j, 1] + nz * joints[j, 2])
    offset -= plane[3]
    for v in range(depth.shape[0]):
        y = (v - camera[3]) / camera[1]
        for u in range(depth.shape[1]):
            z = depth[v, u]
            if there:
                slope = nx * (u - camera[2]) / camera[0] + ny * y + nz
                reach = np.float32(offset / slope) if slope < -1e-3 else np.float32(1e9)
                z = min(z, reach) if reach > np.float32(0.0) else z
            depth[v, u] = z if z < _DRAWN else np.float32(0.0)
