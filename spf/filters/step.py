"""What every tracker's step takes and gives: the state between frames, and everything that happened in one."""

from __future__ import annotations

import math
import time
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from spf.filters.particles import ParticleSet
from spf.hand.kinematics import angles_of, rotation_about
from spf.hand.model import Hand
from spf.optimisers.trajectory import Trajectory

__all__ = ["Clock", "Layer", "State", "StepInfo", "recentred", "start_at"]

Array = NDArray[np.float64]


class State(NamedTuple):
    """What a tracker carries from frame to frame.

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


class Layer(NamedTuple):
    """A layer of an annealed filter.

    Attributes:
        exponent: β, of the weights.
        survival: α, the share of the particles that survives.
        spread: standard deviation of the noise before this layer, relative to the process noise.
    """

    exponent: float
    survival: float
    spread: float


class StepInfo(NamedTuple):
    """Everything that happened in a frame: all that a view may read besides the state.

    N particles give N predicted samples and M optimised ones: M = N, or M = 0 in a filter that optimises none. Arrays of
    all N + M samples hold the predicted ones first.

    Attributes:
        reference: (3, 3) R_ref of all poses here.
        ancestors: (N,) which sample of the last frame each particle came from.
        origins: (N,) proposal that each particle was predicted by; "recombined" where the optimised sample was replaced by
            a recombination of the others, whose trajectory starts there and not at the predicted sample.
        predicted, optimised: (N, D) and (M, D).
        cost_before, cost_after: (N,) and (M,) E of the predicted and of the optimised samples.
        golden: (N + M,) rendered comparison; nan where it was left out.
        overlap: (N + M,) silhouette overlap; nan where it was left out.
        log_likelihood: (N + M,).
        log_correction: (N + M,) log c (32); zeros when nothing is corrected.
        log_weights: (N + M,) normalised; -inf for samples that are not kept.
        ess: effective sample size of the N + M samples.
        optimised_share: weight of the optimised samples.
        window: h that was used; nan when there is no kernel density estimate.
        bandwidth: (D,) the window in the units of a pose, m and rad: h times the process noise; nan when there is none.
        resampled: whether the ancestors were drawn anew; otherwise every particle goes on with its weight.
        estimate: (D,) pose, relative to ``reference``.
        estimate_golden, estimate_overlap, estimate_cost, estimate_log_likelihood: of the estimate.
        trajectories: M paths from a predicted to its optimised sample, or () when not recorded.
        evaluations: cost evaluations in the frame.
        timings: seconds by stage.
        layers: of an annealed filter; () in others.
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
    bandwidth: Array
    resampled: bool
    estimate: Array
    estimate_golden: float
    estimate_overlap: float
    estimate_cost: float
    estimate_log_likelihood: float
    trajectories: tuple[Trajectory, ...]
    evaluations: int
    timings: dict[str, float]
    layers: tuple[Layer, ...] = ()

    @property
    def predicted_weights(self) -> Array:
        """Weights (N,) of the predicted samples."""
        return np.exp(self.log_weights[: len(self.predicted)])

    @property
    def optimised_weights(self) -> Array:
        """Weights (M,) of the optimised samples."""
        return np.exp(self.log_weights[len(self.predicted) :])

    @property
    def winner(self) -> str:
        """Proposal that the heaviest particle, its predicted and its optimised sample together, was predicted by."""
        weights = self.predicted_weights
        if len(self.optimised):
            weights = weights + self.optimised_weights
        return self.origins[int(np.argmax(weights))]


def start_at(hand: Hand, pose: Array, reference: Array, time_: float, count: int) -> State:
    """Begin with ``count`` particles at one pose (D,) relative to ``reference``, at rest."""
    poses = np.repeat(np.asarray(pose, dtype=np.float64)[None], count, axis=0)
    uniform = np.full(count, -math.log(count))
    particles = ParticleSet(hand.constrain(poses), np.zeros_like(poses), uniform)
    return recentred(State(particles, np.asarray(reference, dtype=np.float64), particles.poses[0], time_))


def recentred(state: State) -> State:
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


class Clock:
    """Seconds by stage of a step."""

    def __init__(self) -> None:
        self.seconds: dict[str, float] = {}
        self._last = time.perf_counter()

    def __call__(self, stage: str) -> None:
        """End a stage that began when the last one ended."""
        now = time.perf_counter()
        self.seconds[stage] = self.seconds.get(stage, 0.0) + now - self._last
        self._last = now
