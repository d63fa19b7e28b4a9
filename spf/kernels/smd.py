"""Stochastic Meta-Descent on the hand's cost (spec 5; eq. 14-24), the inner loop of a smart particle.

Rounds of iterations: a round refreshes what the camera sees of the model (z-buffer) and the matches of the observed
pixels; every iteration draws a fresh sample of points, (14), and makes one update, (15)-(24).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from spf.kernels.compiling import allocating, kernel, strict_kernel
from spf.kernels.cost import allocate, cost_products
from spf.kernels.curvature import gauss_newton_diagonal
from spf.kernels.kinematics import pose_bones
from spf.kernels.render import beyond_wrist, project_skin, project_vertices, rasterise, visible_vertices
from spf.kernels.skinning import skin

__all__ = ["SmdParameters", "match_pixels", "see", "smd_run", "smd_update"]


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


@strict_kernel
def smd_update(pose, step, trace, gradient, product, meta_step, decay, first, low, high, bound, limits):
    """One SMD update in place, (19), (15), (23), (24), (21).

    Args:
        pose, step, trace: (D,) p, a and v, updated in place.
        gradient, product: (D,) g and H v at p.
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


@kernel
def see(
    skeleton, surface, proxy, proxy_faces, obs, pose, reference, zbuffer,
    work, points, normals, projected, depth, coarse, visible,
):  # fmt: skip
    """Pose the skin and list the vertices of the hand that the camera sees in this pose; returns their number.

    Vertices past the wrist belong to the arm, which bends as the palm does not: they are never listed.
    """
    pose_bones(skeleton, pose, reference, work.chain)
    skin(surface, work.chain, pose, points, normals)
    project_vertices(points, obs.grid_camera, projected)
    if zbuffer:
        project_skin(proxy, work.chain, 1.0, pose, obs.grid_camera, coarse)
        rasterise(coarse, proxy_faces, depth)
    else:
        depth[:] = np.float32(1e9)
    count = visible_vertices(points, normals, projected, depth, 0.006, obs.grid_camera[4] != 0.0, visible)
    bones, kept = work.chain.bones, 0
    for c in range(count):
        i = visible[c]
        past = (
            (points[i, 0] - pose[0] - bones[0, 3]) * bones[0, 2]
            + (points[i, 1] - pose[1] - bones[0, 7]) * bones[0, 6]
            + (points[i, 2] - pose[2] - bones[0, 11]) * bones[0, 10]
        )
        if past < 0.0:
            visible[kept] = i
            kept += 1
    return kept


@kernel
def match_pixels(points, normals, visible, count, obs, bones, pose, pixels, radius, matches):
    """Match observed pixels with the nearest visible vertex; pixels of the forearm get -1.

    The forearm is what lies beyond the wrist's plane in a wide cone around the palm's axis.
    """
    squared_radius = radius * radius
    # wrist and palm axis (+z of the palm's frame points to the forearm)
    wx, wy, wz = bones[0, 3] + pose[0], bones[0, 7] + pose[1], bones[0, 11] + pose[2]
    ax, ay, az = bones[0, 2], bones[0, 6], bones[0, 10]
    for s in range(pixels.shape[0]):
        pixel = pixels[s]
        x, y, z = obs.points[pixel, 0], obs.points[pixel, 1], obs.points[pixel, 2]
        if beyond_wrist(x - wx, y - wy, z - wz, ax, ay, az):
            matches[s] = -1
            continue
        nx, ny, nz = obs.normals[pixel, 0], obs.normals[pixel, 1], obs.normals[pixel, 2]
        best, least = -1, squared_radius
        for c in range(count):
            i = visible[c]
            dx, dy, dz = points[i, 0] - x, points[i, 1] - y, points[i, 2] - z
            squared = dx * dx + dy * dy + dz * dz
            if squared < least:
                # normals that disagree make a vertex farther
                agree = normals[i, 0] * nx + normals[i, 1] * ny + normals[i, 2] * nz
                squared += 0.0002 * (1.0 - agree)
                if squared < least:
                    best, least = i, squared
        matches[s] = best


@allocating
def evaluate_poses(
    skeleton, surface, proxy, proxy_faces, spheres, obs, weights, parameters, poses, reference, data_pool, energies
):  # fmt: skip
    """E of many poses (N, D) on all their visible vertices and the same observed pixels, without the prior's pull."""
    dofs, vertices = poses.shape[1], surface.vertices.shape[0]
    work = allocate(skeleton.parent.shape[0], skeleton.revolute_bone.shape[0], spheres.bone.shape[0], dofs)
    points, normals = np.empty((vertices, 3)), np.empty((vertices, 3))
    projected = np.empty((vertices, 3), np.float32)
    coarse = np.empty((proxy.vertices.shape[0], 3), np.float32)
    depth = np.empty(obs.grid_depth.shape, np.float32)
    visible, matches = np.empty(vertices, np.int32), np.empty(data_pool.shape[0], np.int32)
    nothing, gradient, product = np.zeros(dofs), np.empty(dofs), np.empty(dofs)
    for n in range(poses.shape[0]):
        count = see(
            skeleton, surface, proxy, proxy_faces, obs, poses[n], reference, parameters.zbuffer,
            work, points, normals, projected, depth, coarse, visible,
        )  # fmt: skip
        match_pixels(
            points,
            normals,
            visible,
            count,
            obs,
            work.chain.bones,
            poses[n],
            data_pool,
            parameters.match_radius,
            matches,
        )
        energies[n] = cost_products(
            skeleton, surface, spheres, obs, weights, nothing, nothing,
            poses[n], reference, visible[:count], data_pool, matches, nothing, gradient, product, work,
        )  # fmt: skip


@allocating
def smd_run(
    skeleton, surface, proxy, proxy_faces, spheres, limits, obs, weights, parameters,
    start, reference, prior, precision, bound, floor, draws, data_pool, result, trace_pose, trace_cost, trace_step,
):  # fmt: skip
    """Run SMD from ``start``; writes the final pose into ``result``.

    Args:
        bound: (D,) bound of a step's length.
        floor: (D,) least curvature per entry, which bounds a₀.
        draws: (rounds · iterations, points + data_points) uint32 random numbers.
        data_pool: (n,) int32 observed pixels that the coverage term samples from.
        trace_pose, trace_cost, trace_step: (iterations + 1, …) out, recorded when not empty.

    Returns:
        Number of iterations run.
    """
    dofs = start.shape[0]
    vertices = surface.vertices.shape[0]
    work = allocate(skeleton.parent.shape[0], skeleton.revolute_bone.shape[0], spheres.bone.shape[0], dofs)
    points, normals = np.empty((vertices, 3)), np.empty((vertices, 3))
    projected = np.empty((vertices, 3), np.float32)
    coarse = np.empty((proxy.vertices.shape[0], 3), np.float32)
    depth = np.empty(obs.grid_depth.shape, np.float32)
    visible = np.empty(vertices, np.int32)
    pool_matches = np.empty(data_pool.shape[0], np.int32)
    sample = np.empty(parameters.points, np.int32)
    pixels = np.empty(min(parameters.data_points, data_pool.shape[0]), np.int32)
    matches = np.empty(pixels.shape[0], np.int32)
    gradient, product, curvature = np.empty(dofs), np.empty(dofs), np.empty(dofs)
    step, trace, first_step = np.empty(dofs), np.zeros(dofs), np.empty(dofs)
    low, high = np.empty(dofs), np.empty(dofs)
    recording = trace_cost.shape[0] > 0
    result[:] = start
    total = parameters.rounds * parameters.iterations
    previous, done = 1e300, 0
    for turn in range(parameters.rounds):
        count = see(
            skeleton, surface, proxy, proxy_faces, obs, result, reference, parameters.zbuffer,
            work, points, normals, projected, depth, coarse, visible,
        )  # fmt: skip
        if count == 0:
            break
        if pixels.shape[0] > 0:
            match_pixels(
                points,
                normals,
                visible,
                count,
                obs,
                work.chain.bones,
                result,
                data_pool,
                parameters.match_radius,
                pool_matches,
            )
        if turn == 0:
            many = min(count, 120)
            spread = np.empty(many, np.int32)
            for s in range(many):
                spread[s] = visible[(s * count) // many]
            gauss_newton_diagonal(
                skeleton, surface, spheres, obs, weights, precision,
                result, reference, spread, data_pool, pool_matches, curvature, work,
            )  # fmt: skip
            for d in range(dofs):
                first_step[d] = parameters.initial_step / (curvature[d] + floor[d])
                step[d] = first_step[d]
        mean = 0.0
        for _ in range(parameters.iterations):
            for s in range(sample.shape[0]):
                sample[s] = visible[draws[done, s] % count]
            for s in range(pixels.shape[0]):
                at = draws[done, sample.shape[0] + s] % data_pool.shape[0]
                pixels[s], matches[s] = data_pool[at], pool_matches[at]
            energy = cost_products(
                skeleton, surface, spheres, obs, weights, prior, precision,
                result, reference, sample, pixels, matches, trace, gradient, product, work,
            )  # fmt: skip
            most = parameters.most
            if parameters.anneal and 2 * done > total:
                most = parameters.most * (0.1 / parameters.most) ** (2.0 * done / total - 1.0)
            for d in range(dofs):
                low[d] = min(parameters.least, most) * first_step[d]
                high[d] = most * first_step[d]
            if recording:
                trace_pose[done] = result
                trace_cost[done] = energy
                trace_step[done] = step
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
        trace_pose[done] = result
        trace_step[done] = step
        trace_cost[done] = trace_cost[done - 1] if done > 0 else 0.0
    return done
