"""The cost as a list of springs, with correspondences and gates held fixed at the pose where they were taken (spec 4).

A spring has a residual ``e(p)`` and a robust function ρ of its square: E = Σ ½ gain ρ(‖e‖²). The gradient is checked by
differences of E; the Gauss-Newton matrix is ``Σ gain ρ' Jᵀ J`` with J by differences of the residuals.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from spf.cost.problem import Problem
from spf.cost.products import Sample
from tests.reference.hand import bone_transforms, skinned

Array = NDArray[np.float64]
Loss = Callable[[complex], complex]
EMPTY, HAND = 0, 1


class Spring(NamedTuple):
    """A residual of the posed bones, its robust function of the squared residual, and its gain."""

    residual: Callable[[Array], Array]
    loss: Loss
    gain: float

    def slope(self, transforms: Array) -> float:
        """ρ' at a pose, by a complex step."""
        squared = float(np.sum(self.residual(transforms) ** 2))
        return complex(self.loss(squared + 1e-30j)).imag / 1e-30


def square(squared: complex) -> complex:
    return squared


def cauchy(inverse: float) -> Loss:
    return square if inverse == 0 else lambda squared: np.log1p(inverse * squared) / inverse


def geman_mcclure(inverse: float) -> Loss:
    return lambda squared: squared / (1 + inverse * squared)


def springs(problem: Problem, pose: Array, sample: Sample) -> list[Spring]:
    """Take correspondences and gates at a pose."""
    transforms = bone_transforms(problem.hand, pose, problem.reference)
    taken: list[Spring] = []
    for vertex in sample.points:
        taken += _of_model_point(problem, transforms, int(vertex), problem.weights.points / len(sample.points))
    for pixel, vertex in zip(sample.pixels, sample.matches, strict=True):
        if vertex >= 0:
            gain = problem.weights.points / len(sample.pixels) * problem.weights.coverage / problem.weights.length**2
            target = problem.observation.arrays.points[pixel]
            taken.append(Spring(_to_point(problem, int(vertex), target), cauchy(problem.weights.pull), gain))
    return taken + _collisions(problem, transforms)


def _of_model_point(problem: Problem, transforms: Array, vertex: int, scale: float) -> list[Spring]:
    obs, weights, hand, camera = problem.observation.arrays, problem.weights, problem.hand, problem.observation.camera
    place, _ = skinned(hand, transforms, vertex)
    u, v = np.floor(camera.project(place) + 0.5).astype(int)
    height, width = obs.labels.shape
    u, v = min(max(u, 0), width - 1), min(max(v, 0), height - 1)
    gain = scale / weights.length**2
    if obs.labels[v, u] == EMPTY:
        target = obs.points[obs.nearest[v, u]]
        return [Spring(_to_point(problem, vertex, target), cauchy(weights.pull), gain * weights.background)]
    if obs.labels[v, u] != HAND:
        return []
    target, normal = obs.points[v * width + u], obs.normals[v * width + u]
    in_front = normal @ (place - target) > 0
    loss = cauchy(weights.front) if in_front else geman_mcclure(weights.behind)
    depth = Spring(lambda t: np.array([normal @ (skinned(hand, t, vertex)[0] - target)]), loss, gain)
    # the normal's weight follows the robust weight of its point, held fixed like the tangent plane
    stiffness = scale * weights.normal * depth.slope(transforms)
    return [depth, Spring(lambda t: skinned(hand, t, vertex)[1] - normal, square, stiffness)]


def _to_point(problem: Problem, vertex: int, target: Array) -> Callable[[Array], Array]:
    return lambda transforms: skinned(problem.hand, transforms, vertex)[0] - target


def _collisions(problem: Problem, transforms: Array) -> list[Spring]:
    spheres, weights = problem.spheres, problem.weights
    binds = problem.hand.skeleton.bind[spheres.bone]
    gain = weights.points * weights.collision / weights.length**2

    in_model = [bind[:, :3] @ c + bind[:, 3] for bind, c in zip(binds, spheres.centre, strict=True)]

    def place(t: Array, q: int) -> Array:
        return (t[spheres.bone[q]] @ [*in_model[q], 1.0])[:3]

    def overlap(t: Array, a: int, b: int) -> Array:
        return np.array([spheres.radius[a] + spheres.radius[b] - np.linalg.norm(place(t, a) - place(t, b))])

    return [
        Spring(lambda t, a=a, b=b: overlap(t, a, b), square, gain)
        for a, (first, last) in enumerate(spheres.partners.tolist())
        for b in range(first, last)
        if gain > 0 and overlap(transforms, a, b)[0] > 0
    ]


def energy(problem: Problem, taken: list[Spring], pose: Array, prior: Array, precision: Array) -> float:
    """E(p) with the springs held fixed (3)."""
    transforms = bone_transforms(problem.hand, pose, problem.reference)
    total = sum(0.5 * s.gain * float(np.real(s.loss(np.sum(s.residual(transforms) ** 2)))) for s in taken)
    return total + 0.5 * float(np.sum(precision * (pose - prior) ** 2))


def gauss_newton(problem: Problem, taken: list[Spring], pose: Array, precision: Array, step: float = 1e-5) -> Array:
    """H (D, D) = Σ gain ρ' Jᵀ J + diag(π), J by central differences (22)."""
    base = bone_transforms(problem.hand, pose, problem.reference)
    root = np.concatenate([np.full(s.residual(base).size, np.sqrt(s.gain * s.slope(base))) for s in taken])

    def residuals(p: Array) -> Array:
        transforms = bone_transforms(problem.hand, p, problem.reference)
        return root * np.concatenate([s.residual(transforms) for s in taken])

    units = step * np.eye(len(pose))
    jacobian = np.array([(residuals(pose + unit) - residuals(pose - unit)) / (2 * step) for unit in units]).T
    return jacobian.T @ jacobian + np.diag(precision)
