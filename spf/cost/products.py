"""E(p), its gradient and its Gauss-Newton product at one pose: what an optimiser asks of a cost (3, 14, 22)."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from spf.cost.problem import Problem, correspondences, scratch_of
from spf.errors import HandError
from spf.kernels.cost import Workspace, cost_products
from spf.kernels.curvature import gauss_newton_diagonal

__all__ = ["Products", "Sample", "curvature", "gauss_newton", "products", "see"]

Array = NDArray[np.float64]


class Sample(NamedTuple):
    """What a cost is evaluated on.

    Attributes:
        points: (m,) int32 vertices of the skin.
        pixels: (n,) int32 observed pixels, flat indices into the crop.
        matches: (n,) int32 the vertex that each pixel is compared with; -1 for none.
    """

    points: NDArray[np.int32]
    pixels: NDArray[np.int32]
    matches: NDArray[np.int32]


class Products(NamedTuple):
    """A cost at a pose.

    Attributes:
        energy: E.
        gradient: (D,) g.
        product: (D,) H v.
    """

    energy: float
    gradient: Array
    product: Array


def see(problem: Problem, pose: ArrayLike) -> Sample:
    """Return all vertices that the camera sees in a pose (D,), and the frame's pool of pixels with their matches."""
    found = correspondences(problem, _checked(problem, pose), zbuffer=bool(problem.settings.zbuffer))
    return Sample(found.visible, problem.data_pool, found.matches)


def products(
    problem: Problem,
    pose: ArrayLike,
    direction: ArrayLike,
    sample: Sample,
    *,
    prior: ArrayLike | None = None,
    precision: ArrayLike | None = None,
    work: Workspace | None = None,
) -> Products:
    """Evaluate E, its gradient (14) and its Gauss-Newton product with a direction (22), in one pass.

    Args:
        problem: cost and observation.
        pose: (D,) p, relative to ``problem.reference``.
        direction: (D,) v.
        sample: what is compared; correspondences and tangent planes are taken at ``pose`` and held fixed (7-11).
        prior, precision: (D,) pull ½ π (p − p̄)²; none when None.
        work: to work in, for a caller that evaluates many poses in one thread.

    Raises:
        HandError: a pose has the wrong length or is not finite.
    """
    hand, p, v = problem.hand, _checked(problem, pose), _checked(problem, direction)
    work = scratch_of(problem).work if work is None else work
    gradient, product = np.empty(hand.dofs), np.empty(hand.dofs)
    energy = cost_products(
        hand.skeleton, hand.skin, problem.spheres, problem.observation.arrays, problem.weights,
        p if prior is None else _checked(problem, prior),
        np.zeros(hand.dofs) if precision is None else _checked(problem, precision),
        p, problem.reference, *sample, v, gradient, product, work,
    )  # fmt: skip
    return Products(float(energy), gradient, product)


def curvature(problem: Problem, pose: ArrayLike, sample: Sample, *, precision: ArrayLike | None = None) -> Array:
    """Return the diagonal (D,) of the Gauss-Newton Hessian whose products :func:`products` gives."""
    hand, p = problem.hand, _checked(problem, pose)
    diagonal = np.empty(hand.dofs)
    gauss_newton_diagonal(
        hand.skeleton, hand.skin, problem.spheres, problem.observation.arrays, problem.weights,
        np.zeros(hand.dofs) if precision is None else _checked(problem, precision),
        p, problem.reference, *sample, diagonal, scratch_of(problem).work,
    )  # fmt: skip
    return diagonal


def gauss_newton(problem: Problem, pose: ArrayLike, sample: Sample) -> Array:
    """Return the Gauss-Newton Hessian (D, D) of the cost, of D products with unit vectors (22)."""
    directions, work = np.eye(problem.hand.dofs), scratch_of(problem).work
    matrix = np.array([products(problem, pose, direction, sample, work=work).product for direction in directions])
    return np.asarray(0.5 * (matrix + matrix.T))


def _checked(problem: Problem, pose: ArrayLike) -> Array:
    p = np.ascontiguousarray(pose, dtype=np.float64)
    if p.shape != (problem.hand.dofs,) or not np.isfinite(p).all():
        raise HandError(f"A pose of this hand has {problem.hand.dofs} finite entries; this one has shape {p.shape}.")
    return p
