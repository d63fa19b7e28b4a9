"""What one view says of a hand's shape: the tracker's residuals with their derivatives by pose and by shape (spec 2).

Residuals are those of the tracker's cost: visible model points to their tangent planes, model points beside the hand to its
nearest pixel, and observed pixels to their model points. Gauss-Newton's normal equations of pose and shape together; the
pose of the view is eliminated (Schur complement), so that only a system of the shape's few parameters is left.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from spf.cost.problem import Problem, correspondences
from spf.cost.settings import LENGTH
from spf.hand.kinematics import pose_hand
from spf.hand.model import Hand
from spf.hand.shape import SHAPE_PARAMETERS, HandShape, varied
from spf.observation import Observation
from spf.parallel import map_threads

__all__ = ["BACKGROUND", "POOL", "ShapeEquations", "View", "equations_of", "nudged"]

Array = NDArray[np.float64]

#: Settings of a :class:`~spf.cost.problem.Problem` whose equations are asked for: how strongly the hand's outline counts
#: (sensors widen it), and observed pixels that are matched.
BACKGROUND, POOL = 0.2, 250
_DELTA = 1e-3  # of the numerical derivatives
_PIECE = 128
_DAMPING, _LEAST = 1e-3, 1.0  # of the eliminated poses: relative, and absolute


class View(NamedTuple):
    """One frame that the shape is fitted to.

    Attributes:
        observation: of the frame.
        pose: (D,) relative to ``reference``.
        reference: (3, 3) R_ref.
    """

    observation: Observation
    pose: Array
    reference: Array


class ShapeEquations(NamedTuple):
    """Normal equations of a view for S of the shape's parameters: ``information @ step = −gradient``.

    Attributes:
        information: (S, S).
        gradient: (S,).
    """

    information: Array
    gradient: Array


def nudged(shape: HandShape, count: int = len(SHAPE_PARAMETERS), *, free_dip: bool = False) -> list[Hand]:
    """Return the hands of a shape that is changed a little in one parameter each, for :func:`equations_of`.

    Args:
        shape: to change.
        count: S, of the first of ``SHAPE_PARAMETERS``.
        free_dip: whether the hand's distal joints are free.
    """
    changes = _DELTA * np.eye(len(SHAPE_PARAMETERS))[:count]
    return map_threads(lambda change: varied(shape, change).hand(free_dip=free_dip), list(changes))


def equations_of(problem: Problem, pose: Array, hands: list[Hand]) -> ShapeEquations:
    """Return what a view says of the shape of its hand.

    Args:
        problem: of the view and the hand, with ``BACKGROUND`` and ``POOL``.
        pose: (D,) of the hand.
        hands: S hands from :func:`nudged`.
    """
    found = correspondences(problem, pose)
    arrays, weights = problem.observation.arrays, problem.weights
    by_pose = _pose_jacobian(problem.hand, pose, problem.reference)
    by_shape = np.stack(
        [(pose_hand(hand, pose, problem.reference).vertices - found.vertices) / _DELTA for hand in hands], axis=2
    )
    jacobian = np.concatenate([by_pose, by_shape], axis=2)  # (V, 3, D + S)
    rows, right = [], []

    def add(vertices: NDArray[Any], residual: Array, weight: Array, direction: Array | None) -> None:
        root = np.sqrt(weight)
        blocks = jacobian[vertices]
        if direction is None:
            rows.append((blocks * root[:, None, None]).reshape(-1, blocks.shape[2]))
            right.append((residual * root[:, None]).reshape(-1))
        else:
            rows.append(np.einsum("ni,nij->nj", direction, blocks) * root[:, None])
            right.append(residual * root)

    visible = found.visible
    height, width = arrays.labels.shape
    uv = np.rint(problem.observation.camera.project(found.vertices[visible])).astype(np.intp)
    u, v = uv[:, 0].clip(0, width - 1), uv[:, 1].clip(0, height - 1)
    label, pixel = arrays.labels[v, u], v * width + u
    scale = problem.settings.points / max(len(visible), 1) / LENGTH**2
    on = label == 1
    difference = found.vertices[visible[on]] - arrays.points[pixel[on]]
    normal = arrays.normals[pixel[on]]
    r = np.sum(normal * difference, axis=1)
    robust = np.where(r > 0, 1 / (1 + (r / weights.front) ** 2), 1 / (1 + (r / weights.behind) ** 2) ** 2)
    add(visible[on], r, scale * robust, normal)
    off = label == 0
    away = found.vertices[visible[off]] - arrays.points[arrays.nearest.reshape(-1)[pixel[off]]]
    add(visible[off], away, scale * weights.background / (1 + (away**2).sum(axis=1) / weights.pull**2), None)
    matched = found.matches >= 0
    ends = found.vertices[found.matches[matched]] - arrays.points[problem.data_pool[matched]]
    gain = weights.coverage * problem.settings.points / max(len(found.matches), 1) / LENGTH**2
    add(found.matches[matched], ends, gain / (1 + (ends**2).sum(axis=1) / weights.pull**2), None)
    products = _products(np.column_stack([np.concatenate(rows), np.concatenate(right)]))
    return _without_pose(products[:-1, :-1], products[:-1, -1], len(pose))


def _products(rows: Array) -> Array:
    """rowsᵀ rows, in pieces too small for the threads of BLAS, which would go on spinning in the way of the next frames."""
    padded = np.zeros((-(-len(rows) // _PIECE), _PIECE, rows.shape[1]))
    padded.reshape(-1, rows.shape[1])[: len(rows)] = rows
    return np.asarray(np.matmul(padded.transpose(0, 2, 1), padded).sum(axis=0))


def _without_pose(hessian: Array, gradient: Array, dofs: int) -> ShapeEquations:
    """Eliminate the view's pose, a little damped, from the normal equations of pose and shape."""
    pose, both, shape = hessian[:dofs, :dofs], hessian[:dofs, dofs:], hessian[dofs:, dofs:]
    damped = pose + np.diag(_DAMPING * np.diag(pose) + _LEAST)
    eliminated = np.linalg.solve(damped, np.column_stack([both, gradient[:dofs]]))
    return ShapeEquations(shape - both.T @ eliminated[:, :-1], gradient[dofs:] - both.T @ eliminated[:, -1])


def _pose_jacobian(hand: Hand, pose: Array, reference: Array) -> Array:
    """(V, 3, D) by central differences: exact enough for Gauss-Newton."""
    columns = []
    for entry in np.eye(len(pose)) * _DELTA:
        ahead, behind = pose_hand(hand, pose + entry, reference), pose_hand(hand, pose - entry, reference)
        columns.append((ahead.vertices - behind.vertices) / (2 * _DELTA))
    return np.stack(columns, axis=2)
