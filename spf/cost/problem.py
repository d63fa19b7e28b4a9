"""A cost to minimise: one hand, one observation, the weights of the terms, and a sample of pixels shared by all particles."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from spf.cost.settings import CostSettings
from spf.cost.spheres import digit_spheres
from spf.hand.model import Hand
from spf.kernels.cost import CostWeights, Spheres, allocate
from spf.kernels.render import golden_energies
from spf.kernels.smd import SmdParameters, evaluate_poses, match_pixels, see
from spf.observation import Observation

__all__ = ["Correspondences", "Problem", "correspondences", "costs", "golden", "make_problem"]

Array = NDArray[np.float64]
GOLDEN_TRUNCATION = 0.04  # T, m
POOL = 90  # observed pixels that are matched anew each round
_MATCH_RADIUS = 0.06  # m


class Problem(NamedTuple):
    """The cost of one frame.

    Attributes:
        hand, spheres, observation, settings, weights: what is compared, and how.
        reference: (3, 3) R_ref of all poses.
        data_pool: (n,) int32 observed pixels, the same for all particles of the frame.
        curvature_floor: (D,) least curvature per entry that a₀ is computed with.
        match_radius: m.
    """

    hand: Hand
    spheres: Spheres
    observation: Observation
    settings: CostSettings
    weights: CostWeights
    reference: Array
    data_pool: NDArray[np.int32]
    curvature_floor: Array
    match_radius: float


def make_problem(
    hand: Hand,
    observation: Observation,
    settings: CostSettings,
    reference: Array,
    rng: np.random.Generator,
    spheres: Spheres | None = None,
    pool: int = POOL,
) -> Problem:
    """Set up the cost of a frame; draws the pool of observed pixels."""
    pixels = observation.arrays.pixels
    chosen = rng.permutation(len(pixels))[:pool]
    floor = np.array([10.0 * settings.points] * 3 + [0.01 * settings.points] * (hand.dofs - 3))
    return Problem(
        hand,
        digit_spheres(hand) if spheres is None else spheres,
        observation,
        settings,
        settings.weights(),
        np.ascontiguousarray(reference),
        pixels[chosen],
        floor,
        _MATCH_RADIUS,
    )


def costs(problem: Problem, poses: Array) -> Array:
    """E (3) of poses (N, D) on all the model points that the camera sees and the frame's pool of pixels, (N,)."""
    hand, energies = problem.hand, np.empty(len(poses))
    parameters = SmdParameters(
        0.0, 0.0, 0.0, 0.0, 0.0, 0, 0, 0, 0, False, 0.0, problem.match_radius, bool(problem.settings.zbuffer)
    )
    evaluate_poses(
        hand.skeleton, hand.skin, hand.proxy, hand.proxy_faces, problem.spheres, problem.observation.arrays,
        problem.weights, parameters, np.ascontiguousarray(poses), problem.reference, problem.data_pool, energies,
    )  # fmt: skip
    return energies


def golden(problem: Problem, poses: Array, scales: Array | None = None) -> tuple[Array, Array]:
    """Compare renders of poses (N, D) with the observed depth: golden energy (N,), silhouette overlap (N,).

    Each pose may have its own scale (N,) of the hand.
    """
    if scales is None:
        scales = np.ones(len(poses))
    hand = problem.hand
    energies, overlaps = np.empty(len(poses)), np.empty(len(poses))
    golden_energies(
        hand.skeleton, hand.proxy, hand.proxy_faces, problem.observation.arrays, np.ascontiguousarray(poses),
        np.ascontiguousarray(scales), problem.reference, GOLDEN_TRUNCATION, energies, overlaps,
    )  # fmt: skip
    return energies, overlaps


class Correspondences(NamedTuple):
    """What is compared with what in one pose.

    Attributes:
        vertices, normals: (V, 3) the posed skin.
        visible: (n,) vertices that the camera sees.
        matches: (m,) vertex matched to each pixel of the problem's pool; -1 for none.
    """

    vertices: Array
    normals: Array
    visible: NDArray[np.int32]
    matches: NDArray[np.int32]


def correspondences(problem: Problem, pose: Array) -> Correspondences:
    """Pose the hand (D,), and find what the camera sees of it and which vertex each observed pixel belongs to."""
    hand, arrays = problem.hand, problem.observation.arrays
    count = len(hand.skin.vertices)
    work = allocate(len(hand.skeleton.parent), len(hand.skeleton.revolute_bone), len(problem.spheres.bone), hand.dofs)
    vertices, normals = np.empty((count, 3)), np.empty((count, 3))
    projected, coarse = np.empty((count, 3), np.float32), np.empty((len(hand.proxy.vertices), 3), np.float32)
    depth, visible = np.empty(arrays.grid_depth.shape, np.float32), np.empty(count, np.int32)
    seen = see(
        hand.skeleton, hand.skin, hand.proxy, hand.proxy_faces, arrays, np.ascontiguousarray(pose), problem.reference,
        True, work, vertices, normals, projected, depth, coarse, visible,
    )  # fmt: skip
    matches = np.empty(len(problem.data_pool), np.int32)
    match_pixels(
        vertices, normals, visible, seen, arrays, work.chain.bones, np.ascontiguousarray(pose), problem.data_pool,
        problem.match_radius, matches,
    )  # fmt: skip
    return Correspondences(vertices, normals, visible[:seen].copy(), matches)
