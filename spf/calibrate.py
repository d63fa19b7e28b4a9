"""Hand shape from the depth itself (spec 2): scale, lengths of the digits, width and thickness, over several frames.

Gauss-Newton on the poses of all frames and one shape together (:mod:`spf.shape_equations`). No ground truth is involved.
"""

from __future__ import annotations

from functools import partial

import numpy as np
from numpy.typing import NDArray

from spf.cost.problem import Problem, golden, make_problem
from spf.cost.settings import CostSettings
from spf.cost.spheres import digit_spheres
from spf.hand.model import Hand
from spf.hand.shape import SHAPE_PARAMETERS, HandShape, varied
from spf.lens import unlikelihood
from spf.optimisers.smd import SmdSettings, optimise
from spf.parallel import map_threads
from spf.progress import Report, silent
from spf.shape_equations import BACKGROUND, POOL, ShapeEquations, View, equations_of, nudged

__all__ = ["fit_shape", "size_by_render"]

Array = NDArray[np.float64]

_PRIOR_SPREAD = np.array([0.5, *([0.08] * 5), 0.06, 0.06, 0.06])  # of the logarithms of SHAPE_PARAMETERS
_DESCENTS = 2
_SIZES = (0.9, 0.95, 1.0, 1.05, 1.1)
_ROUNDS = 2
_AS_GOOD = 0.03  # share by which a golden energy may be higher and weigh 1/e


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
    settings, descent = CostSettings(background=BACKGROUND), SmdSettings(rounds=4)
    report, parameters = progress or silent, _parameters(first)
    usual = HandShape(first.side, mesh=first.mesh, lens=first.lens)
    shape = varied(usual, parameters)
    hand = shape.hand()
    count = len(SHAPE_PARAMETERS) if refine else 1
    best = first, views, _mean_golden(views, first.hand(), settings, rng)
    for done in range(iterations):
        report("Fitting the hand's shape", done / iterations)
        hands = nudged(shape, count)
        seeds, spheres = rng.spawn(len(views)), digit_spheres(hand)
        problems = [
            make_problem(hand, view.observation, settings, view.reference, seed, spheres, pool=POOL)
            for view, seed in zip(views, seeds, strict=True)
        ]
        told = map_threads(partial(_told, hands), list(zip(problems, views, strict=True)))
        step = _shape_step(told, parameters, count)
        parameters = parameters + np.clip(step, -0.1, 0.1)
        shape = varied(usual, parameters)
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


def _told(hands: list[Hand], item: tuple[Problem, View]) -> ShapeEquations:
    problem, view = item
    return equations_of(problem, view.pose, hands)


def _shape_step(told: list[ShapeEquations], parameters: Array, count: int) -> Array:
    """Gauss-Newton step of the shape, in the first so many of its parameters."""
    spread = _PRIOR_SPREAD[:count]
    strength = 0.1 * len(told)  # of the prior, against E of about one per point and view
    system = strength * np.diag(1 / spread**2) + sum(one.information for one in told)
    right = strength * parameters[:count] / spread**2 + sum(one.gradient for one in told)
    step = np.zeros(len(parameters))
    step[:count] = -np.linalg.solve(system, right)
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
