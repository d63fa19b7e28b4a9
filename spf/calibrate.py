"""Hand shape from the depth itself (spec 2): scale, lengths of the digits, width and thickness, over several frames.

Gauss-Newton on the poses of all frames and one shape together. Residuals are those of the tracker's cost: visible model
points to their tangent planes, model points beside the hand to its nearest pixel, and observed pixels to their model
points. Each frame's pose is eliminated (Schur complement), so that only a system of the shape's few parameters is left.
No ground truth is involved.
"""

from __future__ import annotations

from functools import partial
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from spf.cost.problem import Problem, correspondences, golden, make_problem
from spf.cost.settings import LENGTH, CostSettings
from spf.cost.spheres import digit_spheres
from spf.hand.kinematics import pose_hand
from spf.hand.model import Hand
from spf.hand.shape import HandShape, lengths_of_digits
from spf.lens import unlikelihood
from spf.observation import Observation
from spf.optimisers.smd import SmdSettings, optimise
from spf.parallel import map_threads
from spf.progress import Report, silent

__all__ = ["View", "fit_shape", "size_by_render"]

Array = NDArray[np.float64]

#: log scale; log length of thumb … little; log palm width, palm thickness, finger thickness
_PRIOR_SPREAD = np.array([0.5, *([0.08] * 5), 0.06, 0.06, 0.06])
_NAMES = len(_PRIOR_SPREAD)
_POOL = 250
_BACKGROUND = 0.2
_DESCENTS = 2
_DELTA = 1e-3
_SIZES = (0.9, 0.95, 1.0, 1.05, 1.1)
_ROUNDS = 2
_AS_GOOD = 0.03  # share by which a golden energy may be higher and weigh 1/e


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


def size_by_render(
    views: list[View], shape: HandShape, rng: np.random.Generator
) -> tuple[HandShape, list[View], float]:
    """Average the scales whose renders explain the views, each weighed by how well it does and by how long hands are.

    Gauss-Newton alone stays near the size that it begins with, because the poses were found with that one. Renders alone make
    a hand too large where the sensor does: it widens outlines by up to a pixel.

    Returns:
        (shape, views with their poses in that shape, mean golden energy).
    """
    energy = 1.0
    for _ in range(_ROUNDS):
        shape, views, energy = _averaged_size(views, shape, rng)
    return shape, views, energy


def _averaged_size(
    views: list[View], shape: HandShape, rng: np.random.Generator
) -> tuple[HandShape, list[View], float]:
    """One round of :func:`size_by_render`, which does not see beyond the sizes around the one that it is given."""
    settings, descent = CostSettings(), SmdSettings()
    energies, seed = [], int(rng.integers(2**32))
    for factor in _SIZES:
        stream = np.random.default_rng(seed)  # the same randomness for all sizes
        hand = shape._replace(scale=shape.scale * factor).hand()
        posed = _repose(_repose(views, hand, settings, descent, stream), hand, settings, descent, stream)
        energies.append(_mean_golden(posed, hand, settings, stream))
    apart = np.array(energies) / min(energies) - 1.0
    lengths = shape.hand().length * np.array(_SIZES)
    weights = np.exp(-apart / _AS_GOOD - unlikelihood(lengths))
    sized = shape._replace(scale=shape.scale * float(np.exp(np.log(_SIZES) @ weights / weights.sum())))
    hand = sized.hand()
    posed = _repose(_repose(views, hand, settings, descent, rng), hand, settings, descent, rng)
    return sized, posed, _mean_golden(posed, hand, settings, rng)


def _mean_golden(views: list[View], hand: Hand, settings: CostSettings, rng: np.random.Generator) -> float:
    spheres = digit_spheres(hand)
    problems = [make_problem(hand, view.observation, settings, view.reference, rng, spheres) for view in views]
    energies = [golden(problem, view.pose[None])[0][0] for problem, view in zip(problems, views, strict=True)]
    return float(np.mean(energies))


class _Normal(NamedTuple):
    """Blocks of the normal equations of one view: pose-pose, pose-shape, shape-shape, and right-hand sides."""

    pp: Array
    ps: Array
    ss: Array
    p: Array
    s: Array


def fit_shape(
    views: list[View],
    first: HandShape,
    rng: np.random.Generator,
    *,
    iterations: int = 8,
    refine: bool = True,
    progress: Report | None = None,
) -> tuple[HandShape, list[View], float]:
    """Fit one hand shape to several views of a hand; of all steps, the one whose render explains them best.

    Args:
        views: frames with poses of the hand of the first shape.
        first: shape to start from; its side stays.
        rng: randomness of the samples.
        iterations: Gauss-Newton steps; poses are re-optimised by SMD after each.
        refine: whether lengths and thickness are fitted too; else the scale alone.
        progress: called with what is being done and the share done.

    Returns:
        (shape, views with their poses in that shape, mean golden energy).
    """
    settings, descent = CostSettings(background=_BACKGROUND), SmdSettings(rounds=4)
    report, parameters = progress or silent, _parameters(first)
    hand = _shape(first, parameters).hand()
    free = np.ones(_NAMES, bool) if refine else np.arange(_NAMES) == 0
    best = first, views, _mean_golden(views, first.hand(), settings, rng)
    for done in range(iterations):
        report("Fitting the hand's shape", done / iterations)
        nudged = [_shape(first, parameters + _DELTA * np.eye(_NAMES)[i]) for i in np.flatnonzero(free)]
        hands = [hand, *(shape.hand() for shape in nudged)]
        seeds, spheres = rng.spawn(len(views)), digit_spheres(hand)
        problems = [
            make_problem(hand, view.observation, settings, view.reference, seed, spheres, pool=_POOL)
            for view, seed in zip(views, seeds, strict=True)
        ]
        normals = map_threads(
            partial(_equations_of, hands),
            list(zip(problems, views, strict=True)),
        )
        step = _shape_step(normals, parameters, free)
        parameters = parameters + np.clip(step, -0.1, 0.1)
        shape = _shape(first, parameters)
        hand = shape.hand()
        views = _repose(views, hand, settings, descent, rng)
        explained = _mean_golden(views, hand, settings, rng)
        if explained < best[2]:
            best = shape, views, explained
    return best


def _parameters(shape: HandShape) -> Array:
    digits = np.log(np.array(shape.lengths).reshape(5, 3)).mean(axis=1)
    rest = np.log([shape.palm_width, shape.palm_thickness, shape.finger_thickness])
    return np.concatenate([[np.log(shape.scale)], digits, rest])


def _shape(first: HandShape, parameters: Array) -> HandShape:
    values = np.exp(parameters)
    return first._replace(
        scale=float(values[0]),
        lengths=lengths_of_digits(tuple(values[1:6])),
        palm_width=float(values[6]),
        palm_thickness=float(values[7]),
        finger_thickness=float(values[8]),
    )


def _equations_of(hands: list[Hand], item: tuple[Problem, View]) -> _Normal:
    problem, view = item
    return _normal_equations(problem, view.pose, hands)


def _normal_equations(problem: Problem, pose: Array, hands: list[Hand]) -> _Normal:
    """Residuals of one view with their derivatives by pose and by shape, as normal equations."""
    found = correspondences(problem, pose)
    arrays, weights = problem.observation.arrays, problem.weights
    by_pose = _pose_jacobian(problem.hand, pose, problem.reference)
    by_shape = np.stack(
        [(pose_hand(hand, pose, problem.reference).vertices - found.vertices) / _DELTA for hand in hands[1:]], axis=2
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
    a, b = np.concatenate(rows), np.concatenate(right)
    h, g, dofs = a.T @ a, a.T @ b, len(pose)
    return _Normal(h[:dofs, :dofs], h[:dofs, dofs:], h[dofs:, dofs:], g[:dofs], g[dofs:])


def _pose_jacobian(hand: Hand, pose: Array, reference: Array) -> Array:
    """(V, 3, D) by central differences: exact enough for Gauss-Newton."""
    columns = []
    for entry in np.eye(len(pose)) * _DELTA:
        ahead, behind = pose_hand(hand, pose + entry, reference), pose_hand(hand, pose - entry, reference)
        columns.append((ahead.vertices - behind.vertices) / (2 * _DELTA))
    return np.stack(columns, axis=2)


def _shape_step(normals: list[_Normal], parameters: Array, free: NDArray[np.bool_]) -> Array:
    """Gauss-Newton step of the shape, each view's pose eliminated."""
    spread = _PRIOR_SPREAD[free]
    strength = 0.1 * len(normals)  # of the prior, against E of about one per point and view
    system, right = strength * np.diag(1 / spread**2), strength * parameters[free] / spread**2
    for block in normals:
        damped = block.pp + np.diag(1e-3 * np.diag(block.pp) + 1.0)
        eliminate = np.linalg.solve(damped, np.column_stack([block.ps, block.p]))
        system = system + block.ss - block.ps.T @ eliminate[:, :-1]
        right = right + block.s - block.ps.T @ eliminate[:, -1]
    step = np.zeros(len(parameters))
    step[free] = -np.linalg.solve(system, right)
    return step


def _repose(
    views: list[View], hand: Hand, settings: CostSettings, descent: SmdSettings, rng: np.random.Generator
) -> list[View]:
    """Re-optimise every view's pose for a hand: where descents end, their mean, or where it was; what the render likes best.

    A single descent ends anywhere around the optimum, and a size that is fitted to where it did comes out too small.
    """
    seeds, spheres = rng.spawn(len(views)), digit_spheres(hand)

    def run(item: tuple[View, np.random.Generator]) -> View:
        view, seed = item
        problem = make_problem(hand, view.observation, settings, view.reference, seed, spheres)
        ends = [optimise(problem, descent, seed, view.pose)[0] for _ in range(_DESCENTS)]
        poses = np.stack([view.pose, *ends, np.mean(ends, axis=0)])
        return view._replace(pose=poses[int(np.argmin(golden(problem, poses)[0]))])

    return map_threads(run, list(zip(views, seeds, strict=True)))
