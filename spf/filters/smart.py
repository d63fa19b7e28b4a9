"""The Smart Particle Filter (spec 6; Fig. 6, eq. 25-32; Bray, Koller-Meier, Van Gool 2007)."""

from __future__ import annotations

import dataclasses
import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from spf.cost.problem import Problem, golden_of_many, make_problem
from spf.filters import laplace
from spf.filters.dynamics import DynamicsSettings, drift, noise_scale, predict
from spf.filters.estimate import Samples, conclude
from spf.filters.kde import CorrectionSettings, correct
from spf.filters.likelihood import LikelihoodSettings, judge, log_likelihood
from spf.filters.particles import normalise
from spf.filters.proposals import ProposalSettings, origins_of, recombine, restructure, with_suggestion
from spf.filters.resampling import ResamplingSettings, resample
from spf.filters.step import Clock, State, StepInfo
from spf.hand.model import Hand
from spf.kernels.cost import Spheres
from spf.observation import Observation
from spf.optimisers.smd import SmdSettings, optimise
from spf.optimisers.trajectory import Trajectory
from spf.parallel import map_threads
from spf.settings import setting

__all__ = ["SpfSettings", "log_prior", "step"]

Array = NDArray[np.float64]
_FILTER = "Filter"


@dataclasses.dataclass(frozen=True)
class SpfSettings(
    ProposalSettings, CorrectionSettings, ResamplingSettings, DynamicsSettings, SmdSettings, LikelihoodSettings
):
    """All settings of the Smart Particle Filter."""

    n: int = setting(4, "number of particles", group=_FILTER, low=1, high=4096, symbol="N")
    keep_predicted: bool = setting(True, "keep the predicted samples beside the optimised ones", group=_FILTER)
    prediction_pull: float = setting(
        0.01, "pull of SMD to the prediction, in units of the process noise", group=_FILTER, low=0.0, high=10.0
    )
    refine_shape: bool = setting(
        True, "go on refining the hand's shape, in views that tell something of it", group=_FILTER
    )


def step(
    rng: np.random.Generator,
    state: State,
    observation: Observation,
    hand: Hand,
    settings: SpfSettings,
    *,
    spheres: Spheres | None = None,
    record: bool = False,
    effort: float = 1.0,
) -> tuple[State, StepInfo]:
    """Track one frame: the loop body of Fig. 6.

    Args:
        rng: all randomness of the frame.
        state: after the last frame.
        observation: of this frame.
        hand: the calibrated hand.
        settings: of the filter and its parts.
        spheres: of the collision term, when the caller keeps them; made from the hand otherwise.
        record: whether to keep the trajectories of SMD.
        effort: factor on SMD's rounds (a first frame wants more).

    Returns:
        (state, info).
    """
    clock = Clock()
    interval = max(observation.time - state.time, 1e-3)
    problem = make_problem(hand, observation, settings, state.reference, rng, spheres)
    ancestors = resample(state.particles.log_weights, settings.n, settings, rng)  # (a) resample
    before = state.particles.poses[ancestors]
    expected = drift(hand, before, state.particles.velocities[ancestors], interval, settings)
    predicted = predict(hand, expected, interval, settings, rng)  # (b) predict
    clock("predict")
    predicted, screened = with_suggestion(problem, predicted, settings)
    origins = origins_of(settings.n, len(predicted), settings)
    clock("propose")
    added = len(predicted) - settings.n  # the network's particle, which has the heaviest sample for its ancestor
    ancestors = np.append(ancestors, np.full(added, np.argmax(state.particles.log_weights)))
    before, expected = state.particles.poses[ancestors], np.concatenate([expected, predicted[settings.n :]])
    descents = _descend(  # (c) optimise
        problem, predicted, expected, origins, state.estimate, settings, interval, rng, record=record, effort=effort
    )
    predicted, optimised = (np.stack([getattr(one, part) for one in descents]) for part in ("start", "end"))
    trajectories = tuple(one.trajectory for one in descents if one.trajectory is not None)
    evaluations = screened + sum(one.evaluations for one in descents)
    clock("optimise")
    mixed = _recombined(problem, optimised, settings, interval, rng, record)
    if mixed is not None:
        optimised[mixed.place], before[mixed.place] = mixed.pose, before[mixed.source]
        origins = (*origins[: mixed.place], "recombined", *origins[mixed.place + 1 :])
        if mixed.trajectory is not None:
            trajectories = (*trajectories[: mixed.place], mixed.trajectory, *trajectories[mixed.place + 1 :])
        evaluations += mixed.evaluations
    clock("recombine")
    scale = noise_scale(hand, settings, interval)
    prior = log_prior(origins, settings)
    if settings.weighting == "laplace":
        centres = np.array([one.prior for one in descents])
        optimised, log_c = _drawn(problem, predicted, optimised, centres, prior, scale, settings, rng)
        window, prior = math.nan, np.zeros_like(prior)  # the prior is in the ratio
    else:
        window, log_c = correct(predicted, optimised, scale, settings)  # (d) combine, correct
    clock("correct")
    judged = judge(problem, np.concatenate([predicted, optimised]))
    likelihood = log_likelihood(judged, settings, settings.sigma2)
    log_weights = normalise(log_c + likelihood + prior)  # (e) weigh
    clock("weigh")
    jumped = np.array([origin in ("structured", "learned") for origin in origins])
    before[jumped] = optimised[jumped]  # a jump is no motion
    samples = Samples(
        ancestors, origins, before, predicted, optimised, judged, likelihood, log_c, log_weights, window, window * scale
    )  # fmt: skip
    return conclude(  # (f) estimate
        problem, settings.sigma2, state, interval, samples, clock,
        evaluations=evaluations + len(log_weights), trajectories=trajectories,
    )  # fmt: skip


class _Descent(NamedTuple):
    start: Array
    prior: Array
    end: Array
    trajectory: Trajectory | None
    evaluations: int


def _descend(
    problem: Problem,
    predicted: Array,
    expected: Array,
    origins: tuple[str, ...],
    estimate: Array,
    settings: SpfSettings,
    interval: float,
    rng: np.random.Generator,
    *,
    record: bool,
    effort: float,
) -> list[_Descent]:
    """Run SMD from every predicted sample, independently and in parallel, pulled to what was expected without noise.

    A structured sample is changed first, in the same task.
    """
    precision = _precision(problem.hand, settings, interval)
    streams = rng.spawn(len(predicted))

    def run(index: int) -> _Descent:
        start, prior, renders = predicted[index], expected[index], 0
        if origins[index] == "structured":
            start, renders = restructure(problem, estimate, start, settings, streams[index])
            prior = start
        end, trajectory, iterations = optimise(
            problem, settings, streams[index], start, prior=prior, precision=precision, effort=effort, record=record
        )
        return _Descent(start, prior, end, trajectory, iterations + renders)

    longest_first = sorted(range(len(predicted)), key=lambda index: origins[index] != "structured")
    done = dict(zip(longest_first, map_threads(run, longest_first), strict=True))
    return [done[index] for index in range(len(predicted))]


def _precision(hand: Hand, settings: SpfSettings, interval: float) -> Array:
    """Precision (D,) of the pull to the prediction; the palm is free: only digits that nothing is seen of are held."""
    precision = settings.points * settings.prediction_pull / noise_scale(hand, settings, interval) ** 2
    precision[:6] = 0.0
    return precision


class _Recombined(NamedTuple):
    place: int  # of the sample that it takes the place of, the worst
    source: int  # the sample that it is made from, the best
    pose: Array
    trajectory: Trajectory | None
    evaluations: int


def _recombined(
    problem: Problem, optimised: Array, settings: SpfSettings, interval: float, rng: np.random.Generator, record: bool
) -> _Recombined | None:
    """Recombine the digits of the optimised samples (N, D) and optimise the result; None when nothing gets better."""
    if settings.recombination == 0.0:
        return None
    energies, _ = golden_of_many(problem, optimised)
    mixed, renders = recombine(problem, optimised, energies)
    if mixed is None:
        return None
    pose, trajectory, iterations = optimise(
        problem, settings, rng, mixed, prior=mixed, precision=_precision(problem.hand, settings, interval),
        effort=settings.recombination, record=record,
    )  # fmt: skip
    evaluations = len(optimised) + renders + iterations
    return _Recombined(int(np.argmax(energies)), int(np.argmin(energies)), pose, trajectory, evaluations)


def _drawn(
    problem: Problem, predicted: Array, optima: Array, expected: Array, log_prior: Array, noise: Array,
    settings: SpfSettings, rng: np.random.Generator,
) -> tuple[Array, Array]:  # fmt: skip
    """Draw the optimised samples around the optima, and weigh all by the true ratio: (optimised (N, D), log f/q (2 N,))."""
    precisions = laplace.precisions_at(problem, optima, settings.sigma2, noise)
    optimised = problem.hand.constrain(laplace.draw(optima, precisions, rng))
    samples, count = np.concatenate([predicted, optimised]), len(predicted)
    ratio = laplace.log_ratio(
        samples, expected, log_prior[count:], noise, optima, precisions, kept=settings.keep_predicted
    )
    if not settings.keep_predicted:
        ratio[:count] = -np.inf
    return optimised, ratio


def log_prior(origins: tuple[str, ...], settings: SpfSettings) -> Array:
    """Log-prior of the predicted, then the optimised samples; -inf for predicted ones that are not kept."""
    predicted = np.zeros(len(origins)) if settings.keep_predicted else np.full(len(origins), -np.inf)
    predicted[settings.n :] += math.log(settings.learned_prior)
    optimised = np.array([math.log(settings.learned_prior) if origin == "learned" else 0.0 for origin in origins])
    return np.concatenate([predicted, optimised])
