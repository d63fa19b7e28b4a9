"""A cost to minimise: a hand, an observation, the weights of the terms, a sample of pixels shared by all particles."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from spf.cost.settings import CostSettings
from spf.cost.spheres import digit_spheres
from spf.hand.kinematics import pose_hand
from spf.hand.model import Hand
from spf.kernels.cost import CostWeights, Spheres, allocate
from spf.kernels.golden import golden_energies, make_canvas
from spf.kernels.kinematics import make_chain
from spf.kernels.sight import make_sight, match_pixels, see
from spf.kernels.smd import Scratch, evaluate_poses, make_scratch
from spf.observation import Observation
from spf.parallel import map_threads, per_thread, threads

__all__ = [
    "Correspondences",
    "Problem",
    "correspondences",
    "costs",
    "golden",
    "golden_of_many",
    "make_problem",
    "scratch_of",
]

Array = NDArray[np.float64]
GOLDEN_TRUNCATION = 0.04  # T, m
POOL = 90  # observed pixels that are matched anew each round
_MATCH_RADIUS = 0.06  # m
_canvas = per_thread(make_canvas)


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
    chosen = (
        rng.choice(len(pixels), size=min(pool, len(pixels)), replace=False) if len(pixels) else np.empty(0, np.intp)
    )
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


def costs(problem: Problem, poses: Array, order: NDArray[np.int32] | None = None) -> Array:
    """E (3) of poses (N, D) on model points that the camera sees and on the frame's pool of pixels, (N,).

    Args:
        problem: the frame's cost.
        poses: (N, D).
        order: (V,) of the vertices, whose first |S| visible ones are compared; None to compare all visible ones.
    """
    hand, energies = problem.hand, np.empty(len(poses))
    none = np.empty(0, np.int32)
    evaluate_poses(
        hand.skeleton, hand.skin, hand.proxy, hand.proxy_faces, problem.spheres, problem.observation.arrays,
        problem.weights, bool(problem.settings.zbuffer), problem.match_radius,
        np.ascontiguousarray(poses), problem.reference, problem.data_pool,
        none if order is None else order, int(problem.settings.points), scratch_of(problem), energies,
    )  # fmt: skip
    return energies


def golden(problem: Problem, poses: Array, scales: Array | None = None) -> tuple[Array, Array]:
    """Compare renders of poses (N, D) with the observed depth: golden energy (N,), silhouette overlap (N,).

    Each pose may have its own scale (N,) of the hand.
    """
    if scales is None:
        scales = np.ones(len(poses))
    hand, arrays = problem.hand, problem.observation.arrays
    canvas = _canvas(
        len(hand.skeleton.parent), len(hand.skeleton.revolute_bone), len(hand.proxy.vertices), *arrays.grid_depth.shape
    )
    energies, overlaps = np.empty(len(poses)), np.empty(len(poses))
    golden_energies(
        hand.skeleton, hand.proxy, hand.proxy_faces, arrays, np.ascontiguousarray(poses),
        np.ascontiguousarray(scales), problem.reference, GOLDEN_TRUNCATION, canvas, energies, overlaps,
    )  # fmt: skip
    return energies, overlaps


def golden_of_many(problem: Problem, poses: Array) -> tuple[Array, Array]:
    """The same as :func:`golden`, by all threads together; not to be called within one of them."""
    chunks = np.array_split(poses, min(threads(), len(poses)))
    parts = map_threads(lambda chunk: golden(problem, chunk), chunks)
    return np.concatenate([energies for energies, _ in parts]), np.concatenate([overlaps for _, overlaps in parts])


def scratch_of(problem: Problem) -> Scratch:
    """Return what kernels need to work on a problem in this thread, until it is asked for the next time."""
    hand, settings = problem.hand, problem.settings
    return _scratch(
        len(hand.skeleton.parent), len(hand.skeleton.revolute_bone), len(problem.spheres.bone), hand.dofs,
        len(hand.skin.vertices), len(hand.proxy.vertices), *problem.observation.arrays.grid_depth.shape,
        settings.points, settings.data_points if settings.coverage > 0 else 0, len(problem.data_pool),
    )  # fmt: skip


@per_thread
def _scratch(
    bones: int, revolutes: int, spheres: int, dofs: int, vertices: int, proxy_vertices: int, height: int, width: int,
    points: int, data_points: int, pool: int,
) -> Scratch:  # fmt: skip
    work, sight = allocate(bones, revolutes, spheres, dofs), make_sight(vertices, proxy_vertices, height, width)
    return make_scratch(dofs, points, data_points, pool, work, sight)


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


def correspondences(problem: Problem, pose: Array, *, zbuffer: bool = True) -> Correspondences:
    """Pose the hand (D,), and find what the camera sees of it and which vertex each observed pixel belongs to."""
    hand, arrays, p = problem.hand, problem.observation.arrays, np.ascontiguousarray(pose, dtype=np.float64)
    chain = make_chain(len(hand.skeleton.parent), len(hand.skeleton.revolute_bone))
    sight = make_sight(len(hand.skin.vertices), len(hand.proxy.vertices), *arrays.grid_depth.shape)
    count = see(
        hand.skeleton, hand.skin, hand.proxy, hand.proxy_faces, arrays, p, problem.reference,
        zbuffer, chain, sight,
    )  # fmt: skip
    matches = np.empty(len(problem.data_pool), np.int32)
    match_pixels(sight, count, arrays, chain, p, problem.data_pool, problem.match_radius, matches)
    posed = pose_hand(hand, p, problem.reference)
    return Correspondences(posed.vertices, posed.normals, sight.visible[:count].copy(), matches)
