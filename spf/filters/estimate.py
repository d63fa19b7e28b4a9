"""The end of every tracker's step: the estimate Σ π s (Fig. 6f), how well it explains the frame, state and info."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from spf.cost.problem import Problem
from spf.filters.likelihood import Judged, judge, log_likelihood
from spf.filters.particles import ParticleSet, ess, weighted_mean
from spf.filters.step import Clock, Layer, State, StepInfo, recentred
from spf.optimisers.trajectory import Trajectory

__all__ = ["Samples", "conclude"]

Array = NDArray[np.float64]


class Samples(NamedTuple):
    """The weighed samples of a frame: N predicted ones, then M optimised ones, as :class:`~spf.filters.step.StepInfo` says.

    Attributes:
        ancestors, origins: (N,) of the predicted samples.
        before: (N, D) poses in the last frame that they come from.
        predicted, optimised: (N, D), (M, D).
        judged: of all N + M samples.
        log_likelihood, log_correction, log_weights: (N + M,).
        window: h; nan when there is no kernel density estimate.
        bandwidth: (D,) h times the process noise; None when there is no kernel density estimate.
        resampled: whether the ancestors were drawn anew.
    """

    ancestors: NDArray[np.intp]
    origins: tuple[str, ...]
    before: Array
    predicted: Array
    optimised: Array
    judged: Judged
    log_likelihood: Array
    log_correction: Array
    log_weights: Array
    window: float
    bandwidth: Array | None = None
    resampled: bool = True


def conclude(
    problem: Problem,
    sigma2: float,
    last: State,
    interval: float,
    samples: Samples,
    clock: Clock,
    *,
    evaluations: int,
    trajectories: tuple[Trajectory, ...] = (),
    layers: tuple[Layer, ...] = (),
) -> tuple[State, StepInfo]:
    """Estimate the pose and gather what happened.

    Args:
        problem: of the frame.
        sigma2: σ² of the likelihood.
        last: state before the frame.
        interval: s since then.
        samples: of the frame.
        clock: of the step.
        evaluations: of the cost, that of the estimate not counted.
        trajectories: of the optimiser, when recorded.
        layers: of an annealed filter.
    """
    count, log_weights = len(samples.predicted), samples.log_weights
    poses = np.concatenate([samples.predicted, samples.optimised])
    estimate = weighted_mean(poses, log_weights)
    judged = judge(problem, estimate[None])
    likelihood = float(log_likelihood(judged, problem.settings, sigma2)[0])
    clock("estimate")
    came_from = np.concatenate([samples.before, samples.before])[: len(poses)]
    particles = ParticleSet(poses, (poses - came_from) / interval, log_weights)
    info = StepInfo(
        reference=last.reference,
        ancestors=samples.ancestors,
        origins=samples.origins,
        predicted=samples.predicted,
        optimised=samples.optimised,
        cost_before=samples.judged.energy[:count],
        cost_after=samples.judged.energy[count:],
        golden=samples.judged.golden,
        overlap=samples.judged.overlap,
        log_likelihood=samples.log_likelihood,
        log_correction=samples.log_correction,
        log_weights=log_weights,
        ess=ess(log_weights),
        optimised_share=float(np.exp(log_weights[count:]).sum()),
        window=samples.window,
        bandwidth=np.full(poses.shape[1], np.nan) if samples.bandwidth is None else samples.bandwidth,
        resampled=samples.resampled,
        estimate=estimate,
        estimate_golden=float(judged.golden[0]),
        estimate_overlap=float(judged.overlap[0]),
        estimate_cost=float(judged.energy[0]),
        estimate_log_likelihood=likelihood,
        trajectories=trajectories,
        evaluations=evaluations + 1,
        timings=clock.seconds,
        layers=layers,
    )
    return recentred(State(particles, last.reference, estimate, problem.observation.time)), info
