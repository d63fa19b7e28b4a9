"""Condensation, the plain particle filter (Isard, Blake 1998; spec 7): resample, predict, weigh by the likelihood."""

from __future__ import annotations

import dataclasses

import numpy as np

from spf.cost.problem import make_problem
from spf.filters.dynamics import DynamicsSettings, drift, predict
from spf.filters.estimate import Samples, conclude
from spf.filters.likelihood import LikelihoodSettings, judge, log_likelihood
from spf.filters.particles import normalise
from spf.filters.resampling import ResamplingSettings, resample_when_needed
from spf.filters.step import Clock, State, StepInfo
from spf.hand.model import Hand
from spf.kernels.cost import Spheres
from spf.observation import Observation
from spf.settings import setting

__all__ = ["CondensationSettings", "step"]

_FILTER = "Filter"


@dataclasses.dataclass(frozen=True)
class CondensationSettings(ResamplingSettings, DynamicsSettings, LikelihoodSettings):
    """All settings of the Condensation filter."""

    n: int = setting(500, "number of particles", group=_FILTER, low=1, high=100000, symbol="N")
    resample_below: float = setting(
        1.0,
        "effective sample size, as a share of N, below which the set is resampled; 1 is every frame",
        group=_FILTER,
        low=0.0,
        high=1.0,
    )


def step(
    rng: np.random.Generator,
    state: State,
    observation: Observation,
    hand: Hand,
    settings: CondensationSettings,
    *,
    spheres: Spheres | None = None,
    record: bool = False,
    effort: float = 1.0,
) -> tuple[State, StepInfo]:
    """Track one frame; arguments as of :func:`spf.filters.smart.step`.

    E is evaluated on the same ``points`` model points for all particles, as far as they are visible. There are no
    optimised samples and no trajectories, and a first frame takes no more effort than others.
    """
    clock = Clock()
    interval = max(observation.time - state.time, 1e-3)
    problem = make_problem(hand, observation, settings, state.reference, rng, spheres)
    order = rng.permutation(len(hand.skin.vertices)).astype(np.int32)
    ancestors, carried = resample_when_needed(
        state.particles.log_weights, settings.n, settings, settings.resample_below, rng
    )
    before = state.particles.poses[ancestors]
    expected = drift(hand, before, state.particles.velocities[ancestors], interval, settings)
    predicted = predict(hand, expected, interval, settings, rng)
    clock("predict")
    judged = judge(problem, predicted, order, render=settings.golden > 0.0)
    likelihood = log_likelihood(judged, settings, settings.sigma2)
    log_weights = normalise(carried + likelihood)
    clock("weigh")
    samples = Samples(
        ancestors, ("dynamics",) * settings.n, before, predicted, predicted[:0],
        judged, likelihood, np.zeros(settings.n), log_weights, float("nan"),
        resampled=carried is not state.particles.log_weights,
    )  # fmt: skip
    return conclude(problem, settings.sigma2, state, interval, samples, clock, evaluations=settings.n)
