"""Stochastic Meta-Descent on the hand's cost (spec 5; eq. 14-24), the inner loop of a smart particle.

Rounds of iterations: a round refreshes what the camera sees of the model (z-buffer) and the matches of the observed
pixels; every iteration draws a fresh sample of points, (14), and makes one update, (15)-(24).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from spf.kernels.compiling import allocating, index, kernel, part, strict_part
from spf.kernels.cost import CostWeights, ObservationArrays, Spheres, Workspace, cost_products
from spf.kernels.curvature import gauss_newton_diagonal
from spf.kernels.kinematics import Skeleton
from spf.kernels.sight import Sight, keep_first, match_pixels, see
from spf.kernels.skinning import Skin

__all__ = ["Scratch", "SmdParameters", "evaluate_poses", "make_scratch", "smd_run", "smd_update"]

Array = NDArray[np.float64]
_CURVATURE_POINTS = 120


class SmdParameters(NamedTuple):
    """Parameters of SMD.

    Attributes:
        meta_step: μ.
        decay: λ.
        initial_step: a₀ times the Gauss-Newton curvature of its entry.
        least, most: bounds of a/a₀.
        rounds, iterations: number of rounds, and of iterations in each.
        points, data_points: sample sizes per iteration.
        anneal: whether a/a₀ is bounded by a decreasing factor over the second half.
        tolerance: relative change of E between two rounds under which the run has converged.
        match_radius: m beyond which an observed pixel has no match.
        zbuffer: whether hidden vertices are found with the z-buffer; else front-facing vertices are sampled.
    """

    meta_step: float
    decay: float
    initial_step: float
    least: float
    most: float
    rounds: int
    iterations: int
    points: int
    data_points: int
    anneal: bool
    tolerance: float
    match_radius: float
    zbuffer: bool


@strict_part
def smd_update(
    pose: Array, step: Array, trace: Array, gradient: Array, product: Array, meta_step: float, decay: float,
    first: bool, low: Array, high: Array, bound: Array, limits: Array,
) -> None:  # fmt: skip
    """One SMD update in place, (19), (15), (23), (24), (21).

    Args:
        pose, step, trace: (D,) p, a and v, updated in place.
        gradient, product: (D,) g and H v at p.
        meta_step, decay: μ and λ.
        first: whether this is the first iteration, a = a₀.
        low, high: (D,) bounds of a.
        bound: (D,) bound of a step's length per entry.
        limits: (D, 2) joint limits.
    """
    for d in range(pose.shape[0]):
        if not first:
            step[d] *= max(0.5, 1.0 + meta_step * trace[d] * gradient[d])  # (19)
        step[d] = min(max(step[d], low[d]), high[d])
        move = min(max(step[d] * gradient[d], -bound[d]), bound[d])
        constrained = min(max(pose[d] - move, limits[d, 0]), limits[d, 1])  # (15), (23)
        effective = (pose[d] - constrained) / step[d]  # (24)
        trace[d] = decay * trace[d] + step[d] * (effective - decay * product[d])  # (21)
        pose[d] = constrained


class Scratch(NamedTuple):
    """What a run works in; one per thread.

    Attributes:
        work, sight: of the cost, and of what is seen.
        sample: (points,) model points of an iteration.
        pixels, matches: (data_points,) observed pixels of an iteration, and their model points.
        pool_matches: (n,) model points of the whole pool of observed pixels.
        spread: (_CURVATURE_POINTS,) model points that the first step sizes are computed with.
        gradient, product: (D,) g and H v.
        step, trace: (D,) a and v.
        first_step, low, high: (D,) a₀ and the bounds of a.
        zeros: (D,).
    """

    work: Workspace
    sight: Sight
    sample: NDArray[np.int32]
    pixels: NDArray[np.int32]
    matches: NDArray[np.int32]
    pool_matches: NDArray[np.int32]
    spread: NDArray[np.int32]
    gradient: Array
    product: Array
    step: Array
    trace: Array
    first_step: Array
    low: Array
    high: Array
    zeros: Array


@allocating
def make_scratch(dofs: int, points: int, data_points: int, pool: int, work: Workspace, sight: Sight) -> Scratch:
    """Allocate a Scratch."""
    return Scratch(
        work,
        sight,
        np.zeros(points, np.int32),
        np.zeros(min(data_points, pool), np.int32),
        np.zeros(min(data_points, pool), np.int32),
        np.zeros(pool, np.int32),
        np.zeros(_CURVATURE_POINTS, np.int32),
        np.zeros(dofs),
        np.zeros(dofs),
        np.zeros(dofs),
        np.zeros(dofs),
        np.zeros(dofs),
        np.zeros(dofs),
        np.zeros(dofs),
        np.zeros(dofs),
    )


@kernel
def evaluate_poses(
    skeleton: Skeleton, surface: Skin, proxy: Skin, proxy_faces: NDArray[np.int32], spheres: Spheres,
    obs: ObservationArrays, weights: CostWeights, zbuffer: bool, match_radius: float,
    poses: Array, reference: Array, data_pool: NDArray[np.int32], order: NDArray[np.int32], points: int,
    scratch: Scratch, energies: Array,
) -> None:  # fmt: skip
    """E of many poses (N, D) on their visible vertices and the same observed pixels, without the prior's pull.

    Of the visible vertices, the first ``points`` in the order (V,) are used; all of them when the order is empty.
    """
    work, sight, matches, zeros = scratch.work, scratch.sight, scratch.pool_matches, scratch.zeros
    gradient, product = scratch.gradient, scratch.product
    for n in range(poses.shape[0]):
        count = see(skeleton, surface, proxy, proxy_faces, obs, poses[n], reference, zbuffer, work.chain, sight)
        match_pixels(sight, count, obs, work.chain, poses[n], data_pool, match_radius, matches)
        if order.shape[0] > 0:
            count = keep_first(sight, count, order, points)
        energies[n] = cost_products(
            skeleton, surface, spheres, obs, weights, zeros, zeros,
            poses[n], reference, sight.visible[:count], data_pool, matches, zeros, gradient, product, work,
        )  # fmt: skip


@kernel
def smd_run(
    skeleton: Skeleton, surface: Skin, proxy: Skin, proxy_faces: NDArray[np.int32], spheres: Spheres, limits: Array,
    obs: ObservationArrays, weights: CostWeights, parameters: SmdParameters,
    start: Array, reference: Array, prior: Array, precision: Array, bound: Array, floor: Array,
    draws: NDArray[np.uint32], data_pool: NDArray[np.int32], scratch: Scratch,
    result: Array, trace_pose: Array, trace_cost: Array, trace_step: Array,
) -> int:  # fmt: skip
    """Run SMD from ``start``; writes the final pose into ``result``.

    Args:
        skeleton, surface, proxy, proxy_faces, spheres, limits: the hand.
        obs, weights, parameters: what it is compared with, and how.
        start, reference: (D,) and (3, 3) R_ref.
        prior, precision: (D,) p̄ and π.
        bound: (D,) bound of a step's length.
        floor: (D,) least curvature per entry, which bounds a₀.
        draws: (rounds · iterations, points + data_points) random numbers.
        data_pool: (n,) observed pixels that the coverage term samples from.
        scratch: to work in.
        result: (D,) out.
        trace_pose, trace_cost, trace_step: (iterations + 1, …) out, recorded when not empty.

    Returns:
        Number of iterations run.
    """
    work, sight, sample, pixels, matches = scratch.work, scratch.sight, scratch.sample, scratch.pixels, scratch.matches
    pool_matches, step, trace, first_step = scratch.pool_matches, scratch.step, scratch.trace, scratch.first_step
    gradient, product, low, high = scratch.gradient, scratch.product, scratch.low, scratch.high
    recording = trace_cost.shape[0] > 0
    for d in range(step.shape[0]):
        result[d], trace[d] = start[d], 0.0
    total = parameters.rounds * parameters.iterations
    previous, done = 1e300, 0
    for turn in range(parameters.rounds):
        count = see(
            skeleton, surface, proxy, proxy_faces, obs, result, reference, parameters.zbuffer, work.chain, sight
        )
        if count == 0:
            break
        match_pixels(sight, count, obs, work.chain, result, data_pool, parameters.match_radius, pool_matches)
        if turn == 0:
            spread = scratch.spread[: _spread(sight.visible, count, scratch.spread)]
            gauss_newton_diagonal(
                skeleton, surface, spheres, obs, weights, precision,
                result, reference, spread, data_pool, pool_matches, first_step, work,
            )  # fmt: skip
            for d in range(step.shape[0]):
                first_step[d] = parameters.initial_step / (first_step[d] + floor[d])
                step[d] = first_step[d]
        mean = 0.0
        for _ in range(parameters.iterations):
            _draw_sample(draws, done, sight.visible, count, data_pool, pool_matches, sample, pixels, matches)
            energy = cost_products(
                skeleton, surface, spheres, obs, weights, prior, precision,
                result, reference, sample, pixels, matches, trace, gradient, product, work,
            )  # fmt: skip
            most = _most_step(parameters, done, total)
            for d in range(step.shape[0]):
                low[d] = min(parameters.least, most) * first_step[d]
                high[d] = most * first_step[d]
            if recording:
                _record(done, result, energy, step, trace_pose, trace_cost, trace_step)
            smd_update(
                result, step, trace, gradient, product, parameters.meta_step, parameters.decay,
                done == 0, low, high, bound, limits,
            )  # fmt: skip
            done += 1
            mean += energy
        mean /= parameters.iterations
        if abs(previous - mean) < parameters.tolerance * mean:
            break
        previous = mean
    if recording:
        last = trace_cost[done - 1] if done > 0 else 0.0
        _record(done, result, last, step, trace_pose, trace_cost, trace_step)
    return done


@part
def _record(
    at: int, pose: Array, energy: float, step: Array, trace_pose: Array, trace_cost: Array, trace_step: Array
) -> None:
    """Write one row of the trajectory."""
    trace_cost[at] = energy
    for d in range(pose.shape[0]):
        trace_pose[at, d], trace_step[at, d] = pose[d], step[d]


@part
def _draw_sample(
    draws: NDArray[np.uint32], iteration: int, visible: NDArray[np.int32], count: int,
    data_pool: NDArray[np.int32], pool_matches: NDArray[np.int32],
    sample: NDArray[np.int32], pixels: NDArray[np.int32], matches: NDArray[np.int32],
) -> None:  # fmt: skip
    """Draw an iteration's model points among the visible ones, and its pixels from the pool."""
    for s in range(sample.shape[0]):
        sample[s] = visible[draws[iteration, s] % index(count)]
    for s in range(pixels.shape[0]):
        at = draws[iteration, sample.shape[0] + s] % index(data_pool.shape[0])
        pixels[s], matches[s] = data_pool[at], pool_matches[at]


@part
def _spread(visible: NDArray[np.int32], count: int, spread: NDArray[np.int32]) -> int:
    """Choose visible vertices evenly, as many as there is room for; returns their number."""
    many = min(count, spread.shape[0])
    for s in range(many):
        spread[s] = visible[index(s * count // many)]
    return many


@part
def _most_step(parameters: SmdParameters, done: int, total: int) -> float:
    """Upper bound of a/a₀; with annealing it falls to a tenth over the second half."""
    if parameters.anneal and 2 * done > total:
        return parameters.most * (0.1 / parameters.most) ** (2.0 * done / total - 1.0)
    return parameters.most
