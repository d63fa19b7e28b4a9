"""The cost E(p) with its gradient and Gauss-Newton product, all terms in one pass (spec 4; eq. 3-14, 22).

Everything is evaluated at one pose for a sample of model points and a sample of observed pixels, with correspondences
and tangent planes held fixed, as the paper does (eq. 7-11). Each term adds forces to the bones; the tree turns them
into derivatives of the pose. Besides the terms of the other files,

    prior       ½ (p − p̄)ᵀ diag(π) (p − p̄)                        pull to the prediction
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from spf.kernels.collision_term import collision_term
from spf.kernels.compiling import part
from spf.kernels.cost_inputs import CostWeights, ObservationArrays, Spheres, Workspace, allocate
from spf.kernels.coverage_term import coverage_term
from spf.kernels.depth_term import depth_term
from spf.kernels.kinematics import BONE_COLUMNS, GRADIENT, Skeleton, bone_twists, joint_gradient, pose_bones
from spf.kernels.skinning import Skin

__all__ = ["CostWeights", "ObservationArrays", "Spheres", "Workspace", "allocate", "cost_products"]

Array = NDArray[np.float64]


@part
def cost_products(
    skeleton: Skeleton, surface: Skin, spheres: Spheres, obs: ObservationArrays, weights: CostWeights,
    prior: Array, prior_precision: Array, pose: Array, reference: Array,
    sample: NDArray[np.int32], pixels: NDArray[np.int32], matches: NDArray[np.int32],
    direction: Array, gradient: Array, product: Array, work: Workspace,
) -> float:  # fmt: skip
    """E(p), its gradient (14) and its Gauss-Newton product with a direction (22).

    Args:
        skeleton, surface, spheres: the hand.
        obs, weights: what it is compared with, and how.
        prior, prior_precision: (D,) p̄ and π.
        pose, reference: (D,) p and (3, 3) R_ref.
        sample: (m,) model points, visible ones.
        pixels, matches: (n,) observed pixels and their model points.
        direction: (D,) v.
        gradient, product: (D,) out.
        work: scratch.

    Returns:
        E.
    """
    chain = work.chain
    bones = chain.bones
    pose_bones(skeleton, pose, reference, chain)
    bone_twists(skeleton, direction, chain)
    for b in range(bones.shape[0]):
        for i in range(GRADIENT, BONE_COLUMNS):
            bones[b, i] = 0.0
    # every term is called, whatever its weight: a branch here makes the compiler count references to every array
    energy = depth_term(surface, obs, weights, pose, direction, sample, bones)
    energy += coverage_term(surface, obs, weights, pose, direction, pixels, matches, bones)
    energy += collision_term(spheres, weights, bones, work.places)
    for d in range(pose.shape[0]):
        away = pose[d] - prior[d]
        pull = prior_precision[d] * away
        energy += 0.5 * pull * away
        gradient[d] = pull
        product[d] = prior_precision[d] * direction[d]
    joint_gradient(skeleton, chain, gradient, product)
    return energy
