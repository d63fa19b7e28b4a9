"""The annealed particle filter (Deutscher, Blake, Reid 2000; spec 7).

A frame is searched in layers. A layer weighs the particles with a power β of the likelihood, so small at first that
broad peaks count, and larger in every layer; between two layers the set is resampled and spread by noise that shrinks.
β is chosen such that the survival rate α = 1/(N Σ π²) meets its target, and the variance of the noise is multiplied by
the same α from layer to layer, as in the authors' section 5.
"""

from __future__ import annotations

import dataclasses
import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from spf.cost.problem import Problem, make_problem
from spf.cost.settings import CostSettings
from spf.filters.dynamics import DynamicsSettings, drift, noise_scale, predict
from spf.filters.estimate import Samples, conclude
from spf.filters.likelihood import SIGMA2, Judged, judge, log_likelihood
from spf.filters.particles import ess, normalise
from spf.filters.resampling import ResamplingSettings, resample
from spf.filters.step import Clock, Layer, State, StepInfo
from spf.hand.model import Hand
from spf.kernels.cost import Spheres
from spf.observation import Observation
from spf.optimisers.trajectory import Trajectory
from spf.settings import setting

__all__ = ["ApfSettings", "annealing_exponent", "step"]

Array = NDArray[np.float64]
Indices = NDArray[np.intp]
_FILTER = "Filter"
_BISECTIONS = 50
_MOST_EXPONENT = 1e12


@dataclasses.dataclass(frozen=True)
class ApfSettings(ResamplingSettings, DynamicsSettings, CostSettings):
    """All settings of the annealed particle filter."""

    n: int = setting(200, "number of particles", group=_FILTER, low=2, high=100000, symbol="N")
    layers: int = setting(10, "number of annealing layers", group=_FILTER, low=1, high=100, symbol="M")
    survival: float = setting(
        0.5,
        "survival rate of the particles that a layer's β is chosen for",
        group=_FILTER,
        low=0.01,
        high=0.99,
        symbol="α",
    )


class _Annealed(NamedTuple):
    """The particles in one layer.

    Attributes:
        poses: (N, D).
        parents: (N,) particle of the layer before that each comes from.
        judged: how well they explain the frame.
        log_weights: (N,) normalised, to the power β.
        layer: what was chosen.
    """

    poses: Array
    parents: Indices
    judged: Judged
    log_weights: Array
    layer: Layer


def step(
    rng: np.random.Generator,
    state: State,
    observation: Observation,
    hand: Hand,
    settings: ApfSettings,
    *,
    spheres: Spheres | None = None,
    record: bool = False,
    effort: float = 1.0,
) -> tuple[State, StepInfo]:
    """Track one frame; arguments as of :func:`spf.filters.smart.step`.

    The optimised samples are those of the last layer, the predicted ones, without weight, are what they descend from
    in the first; a trajectory is a line of descent. E is evaluated on the same ``points`` model points for all
    particles, as far as they are visible. A first frame takes no more effort than others.
    """
    clock = Clock()
    interval = max(observation.time - state.time, 1e-3)
    problem = make_problem(hand, observation, settings, state.reference, rng, spheres)
    ancestors = resample(state.particles.log_weights, settings.n, settings, rng)
    before = state.particles.poses[ancestors]
    expected = drift(hand, before, state.particles.velocities[ancestors], interval, settings)
    predicted = predict(hand, expected, interval, settings, rng)
    clock("predict")
    layers = _anneal(problem, predicted, settings, interval, rng)
    clock("anneal")
    lines, first, last = _lines_of_descent(layers), layers[0], layers[-1]
    started = lines[0]
    judged = Judged(
        *(np.concatenate([one[started], other]) for one, other in zip(first.judged, last.judged, strict=True))
    )
    log_weights = np.concatenate([np.full(settings.n, -np.inf), last.log_weights])
    samples = Samples(
        ancestors[started], ("dynamics",) * settings.n, before[started], predicted[started], last.poses,
        judged, log_likelihood(judged, settings, SIGMA2), np.zeros(2 * settings.n), log_weights, float("nan"),
    )  # fmt: skip
    return conclude(
        problem, SIGMA2, state, interval, samples, clock, evaluations=settings.layers * settings.n,
        trajectories=_trajectories(layers, lines) if record else (), layers=tuple(part.layer for part in layers),
    )  # fmt: skip


def annealing_exponent(log_likelihoods: Array, survival: float) -> float:
    """Find β such that weights ∝ exp(β log p) have the survival rate α = 1/(N Σ π²), by bisection.

    Args:
        log_likelihoods: (N,) up to a constant.
        survival: target of α, in (0, 1).

    Returns:
        β; the largest that is tried when so many particles are equal that no β is enough.
    """
    apart = log_likelihoods - log_likelihoods.max()

    def surviving(log_exponent: float) -> float:
        weights = np.exp(math.exp(log_exponent) * apart)
        return float(weights.sum() ** 2 / (weights @ weights) / len(weights))

    low, high = -math.log(_MOST_EXPONENT), math.log(_MOST_EXPONENT)
    for _ in range(_BISECTIONS):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if surviving(middle) > survival else (low, middle)
    return math.exp(high)


def _anneal(
    problem: Problem, predicted: Array, settings: ApfSettings, interval: float, rng: np.random.Generator
) -> list[_Annealed]:
    """Search in layers, from the predicted particles on."""
    noise = noise_scale(problem.hand, settings, interval)
    order = rng.permutation(len(problem.hand.skin.vertices)).astype(np.int32)
    layers: list[_Annealed] = []
    poses, parents, spread = predicted, np.arange(settings.n), 1.0
    for index in range(settings.layers):
        if index > 0:
            parents = resample(layers[-1].log_weights, settings.n, settings, rng)
            spread *= math.sqrt(settings.survival)
            poses = problem.hand.constrain(poses[parents] + spread * noise * rng.normal(size=poses.shape))
        judged = judge(problem, poses, order, render=settings.golden > 0.0)
        likelihood = log_likelihood(judged, settings, SIGMA2)
        exponent = annealing_exponent(likelihood, settings.survival)
        log_weights = normalise(exponent * likelihood)
        chosen = Layer(exponent, ess(log_weights) / settings.n, spread)
        layers.append(_Annealed(poses, parents, judged, log_weights, chosen))
    return layers


def _lines_of_descent(layers: list[_Annealed]) -> Indices:
    """Ancestor in every layer of each particle of the last one, (M, N)."""
    lines = [np.arange(len(layers[-1].poses))]
    for later in reversed(layers[1:]):
        lines.append(later.parents[lines[-1]])
    return np.stack(lines[::-1])


def _trajectories(layers: list[_Annealed], lines: Indices) -> tuple[Trajectory, ...]:
    """The way of each particle of the last layer through all of them."""
    poses = np.stack([layer.poses[line] for layer, line in zip(layers, lines, strict=True)], axis=1)
    energies = np.stack([layer.judged.energy[line] for layer, line in zip(layers, lines, strict=True)], axis=1)
    return tuple(Trajectory(*way, np.full_like(way[0], np.nan)) for way in zip(poses, energies, strict=True))
