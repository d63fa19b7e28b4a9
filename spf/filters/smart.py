"""The Smart Particle Filter (spec 6; Fig. 6, eq. 25-32; Bray, Koller-Meier, Van Gool 2007)."""

from __future__ import annotations

import dataclasses
import math
import time
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from spf.cost.problem import Problem, costs, golden, make_problem
from spf.cost.settings import CostSettings
from spf.filters.dynamics import DynamicsSettings, noise_scale, predict
from spf.filters.kde import log_correction, paper_window, silverman_window
from spf.filters.particles import ParticleSet, ess, normalise, weighted_mean
from spf.filters.proposals import ProposalSettings, propose
from spf.filters.resampling import systematic
from spf.hand.kinematics import angles_of, rotation_about
from spf.hand.model import Hand
from spf.kernels.cost import Spheres
from spf.observation import Observation
from spf.optimisers.smd import SmdSettings, SmdTrace, optimise
from spf.parallel import map_threads
from spf.settings import setting

__all__ = ["SpfSettings", "State", "StepInfo", "start", "step"]

Array = NDArray[np.float64]
_FILTER = "Filter"
WINDOW_RULES = ("fixed", "paper", "silverman")


@dataclasses.dataclass(frozen=True)
class SpfSettings(ProposalSettings, DynamicsSettings, SmdSettings, CostSettings):
    """All settings of the Smart Particle Filter."""

    n: int = setting(4, "number of particles", group=_FILTER, low=1, high=4096, symbol="N")
    h: float = setting(
        4.0,
        "window of the kernel density estimate, in units of the process noise",
        group=_FILTER,
        low=0.01,
        high=100.0,
        symbol="h",
    )
    window_rule: str = setting(
        "fixed",
        "how the window is chosen: h itself, the paper's (29), or the d-dimensional rule",
        group=_FILTER,
        choices=WINDOW_RULES,
    )
    correction: bool = setting(True, "correct the weights of optimised samples (32)", group=_FILTER)
    keep_predicted: bool = setting(True, "keep the predicted samples beside the optimised ones", group=_FILTER)
    sigma2: float = setting(
        4.5, "variance of the likelihood, log p = -(E + golden)/σ²", group=_FILTER, low=1e-3, high=1e4, symbol="σ²"
    )
    prediction_pull: float = setting(
        0.01, "pull of SMD to the prediction, in units of the process noise", group=_FILTER, low=0.0, high=10.0
    )


class State(NamedTuple):
    """What the filter carries from frame to frame.

    Attributes:
        particles: the weighted set, relative to ``reference``.
        reference: (3, 3) R_ref.
        estimate: (D,) pose, relative to ``reference``.
        time: s, of the frame.
    """

    particles: ParticleSet
    reference: Array
    estimate: Array
    time: float


class StepInfo(NamedTuple):
    """Everything that happened in a frame: all that a view may read besides the state.

    N particles give N predicted and N optimised samples; the samples' arrays hold the predicted ones first.

    Attributes:
        reference: (3, 3) R_ref of all poses here.
        ancestors: (N,) which sample of the last frame each particle came from.
        origins: (N,) proposal that each particle was predicted by.
        predicted, optimised: (N, D).
        cost_before, cost_after: (N,) E of the predicted and of the optimised samples.
        golden: (2N,) rendered comparison.
        overlap: (2N,) silhouette overlap.
        log_likelihood: (2N,).
        log_correction: (2N,) log c (32); zeros when switched off.
        log_weights: (2N,) normalised.
        ess: effective sample size of the 2N samples.
        optimised_share: weight of the optimised half.
        window: h that was used.
        estimate: (D,) pose, relative to ``reference``.
        estimate_golden, estimate_overlap, estimate_cost, estimate_log_likelihood: of the estimate.
        trajectories: N trajectories of SMD, or () when not recorded.
        evaluations: cost evaluations in the frame.
        timings: seconds by stage.
    """

    reference: Array
    ancestors: NDArray[np.intp]
    origins: tuple[str, ...]
    predicted: Array
    optimised: Array
    cost_before: Array
    cost_after: Array
    golden: Array
    overlap: Array
    log_likelihood: Array
    log_correction: Array
    log_weights: Array
    ess: float
    optimised_share: float
    window: float
    estimate: Array
    estimate_golden: float
    estimate_overlap: float
    estimate_cost: float
    estimate_log_likelihood: float
    trajectories: tuple[SmdTrace, ...]
    evaluations: int
    timings: dict[str, float]


def start(hand: Hand, pose: Array, reference: Array, time_: float, count: int) -> State:
    """Begin with ``count`` particles at one pose (D,) relative to ``reference``, at rest."""
    poses = np.repeat(np.asarray(pose, dtype=np.float64)[None], count, axis=0)
    uniform = np.full(count, -math.log(count))
    particles = ParticleSet(hand.constrain(poses), np.zeros_like(poses), uniform)
    return _recentred(State(particles, np.asarray(reference, dtype=np.float64), particles.poses[0], time_))


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
    clock = _Clock()
    interval = max(observation.time - state.time, 1e-3)
    problem = make_problem(hand, observation, settings, state.reference, rng, spheres)
    ancestors = systematic(state.particles.log_weights, settings.n, rng)  # (a) resample
    before = state.particles.poses[ancestors]
    predicted = predict(hand, before, state.particles.velocities[ancestors], interval, settings, rng)  # (b) predict
    clock("predict")
    predicted, origins, screened = propose(problem, state.estimate, predicted, settings, rng)
    clock("propose")
    optimised, trajectories, iterations = _optimise(problem, predicted, settings, interval, rng, record, effort)  # (c)
    clock("optimise")
    samples = np.concatenate([predicted, optimised])  # (d) combine and correct
    window, log_c = _correction(hand, predicted, optimised, settings, interval)
    clock("correct")
    energy, golden_energy, overlap = _judge(problem, samples)
    log_likelihood = _log_likelihood(energy, golden_energy, settings)
    log_weights = normalise(log_c + log_likelihood + _kept(settings))  # (e) weigh
    clock("weigh")
    estimate = weighted_mean(samples, log_weights)  # (f) estimate
    judged = _judge(problem, estimate[None])
    estimate_energy, estimate_golden, estimate_overlap = (float(part[0]) for part in judged)
    estimate_log_likelihood = float(_log_likelihood(judged[0], judged[1], settings)[0])
    clock("estimate")
    velocities = (samples - np.concatenate([before, before])) / interval
    new = State(ParticleSet(samples, velocities, log_weights), state.reference, estimate, observation.time)
    count = settings.n
    info = StepInfo(
        state.reference, ancestors, origins, predicted, optimised, energy[:count], energy[count:], golden_energy, overlap,
        log_likelihood, log_c, log_weights, ess(log_weights), float(np.exp(log_weights[count:]).sum()), window,
        estimate, estimate_golden, estimate_overlap, estimate_energy,
        estimate_log_likelihood, trajectories,
        iterations + screened + len(samples) + 1, clock.seconds,
    )  # fmt: skip
    return _recentred(new), info


def _optimise(
    problem: Problem,
    predicted: Array,
    settings: SpfSettings,
    interval: float,
    rng: np.random.Generator,
    record: bool,
    effort: float,
) -> tuple[Array, tuple[SmdTrace, ...], int]:
    """Run SMD from every predicted sample, independently and in parallel."""
    noise = noise_scale(problem.hand, settings, interval)
    precision = settings.points * settings.prediction_pull / noise**2
    precision[:6] = 0.0  # the palm is free: only digits that nothing is seen of are held
    streams = rng.spawn(len(predicted))

    def run(index: int) -> tuple[Array, SmdTrace | None, int]:
        pose = predicted[index]
        return optimise(
            problem, settings, streams[index], pose, prior=pose, precision=precision, effort=effort, record=record
        )

    results = map_threads(run, range(len(predicted)))
    traces = tuple(trace for _, trace, _ in results if trace is not None)
    return np.stack([pose for pose, _, _ in results]), traces, sum(count for _, _, count in results)


def _correction(
    hand: Hand, predicted: Array, optimised: Array, settings: SpfSettings, interval: float
) -> tuple[float, Array]:
    """Window h and log c (32) of the predicted, then the optimised samples."""
    noise = noise_scale(hand, settings, interval)
    white, white_optimised = predicted / noise, optimised / noise
    rules: dict[str, Callable[[Array], float]] = {"paper": paper_window, "silverman": silverman_window}
    window = settings.h if settings.window_rule == "fixed" else max(rules[settings.window_rule](white), 1e-6)
    if not settings.correction:
        return window, np.zeros(2 * len(predicted))
    return window, log_correction(white, white_optimised, window)


def _log_likelihood(energy: Array, golden_energy: Array, settings: SpfSettings) -> Array:
    """log p(z|s) = -E/σ² (6), E joined by the rendered comparison; up to a constant."""
    return -(energy + settings.golden * settings.points * golden_energy) / settings.sigma2


def _kept(settings: SpfSettings) -> Array:
    """Log-prior of the samples: -inf for predicted ones that are not kept."""
    return np.repeat([0.0 if settings.keep_predicted else -np.inf, 0.0], settings.n)


def _judge(problem: Problem, poses: Array) -> tuple[Array, Array, Array]:
    """E, golden energy and overlap of poses, in parallel."""

    def run(chunk: Array) -> tuple[Array, Array, Array]:
        return costs(problem, chunk), *golden(problem, chunk)

    parts = map_threads(run, [chunk for chunk in np.array_split(poses, 2) if len(chunk)])
    energy, golden_energy, overlap = (np.concatenate(arrays) for arrays in zip(*parts, strict=True))
    return energy, golden_energy, overlap


def _recentred(state: State) -> State:
    """Turn R_ref to the estimate, so that the palm's angles stay small and their differences meaningful (spec 1)."""
    turn = rotation_about(state.estimate[3:6])
    reference = turn @ state.reference
    u, _, vt = np.linalg.svd(reference)
    reference = u @ vt
    poses, velocities = state.particles.poses.copy(), state.particles.velocities
    for pose in poses:
        pose[3:6] = angles_of(rotation_about(pose[3:6]) @ turn.T)
    estimate = state.estimate.copy()
    estimate[3:6] = 0.0
    return State(ParticleSet(poses, velocities, state.particles.log_weights), reference, estimate, state.time)


class _Clock:
    """Seconds by stage."""

    def __init__(self) -> None:
        self.seconds: dict[str, float] = {}
        self._last = time.perf_counter()

    def __call__(self, stage: str) -> None:
        now = time.perf_counter()
        self.seconds[stage] = self.seconds.get(stage, 0.0) + now - self._last
        self._last = now
