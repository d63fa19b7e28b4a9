"""The joints of many poses of one hand."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from spf.kernels.compiling import allocating, index
from spf.kernels.kinematics import Skeleton, make_chain, pose_bones

__all__ = ["joints_of_poses"]

Array = NDArray[np.float64]


@allocating
def joints_of_poses(
    skeleton: Skeleton, joint_bone: NDArray[np.int32], offsets: Array, poses: Array, reference: Array, joints: Array
) -> None:
    """Write the joints (N, 21, 3), m, of poses (N, D) relative to R_ref (3, 3), from their places in their bones (21, 3)."""
    chain = make_chain(skeleton.parent.shape[0], skeleton.revolute_bone.shape[0])
    for n in range(poses.shape[0]):
        pose_bones(skeleton, poses[n], reference, chain)
        for j in range(joints.shape[1]):
            b = index(joint_bone[j])
            for i in range(3):
                at = poses[n, i] + chain.bones[b, 4 * i + 3]
                for k in range(3):
                    at += chain.bones[b, 4 * i + k] * offsets[j, k]
                joints[n, j, i] = at
