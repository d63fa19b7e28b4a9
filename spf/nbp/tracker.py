"""The tracker by nonparametric belief propagation (Sudderth, Mandel, Freeman, Willsky, NIPS 2004; spec 8).

What is carried from frame to frame is N hands drawn from the beliefs; their bodies are the kernels of the temporal messages.
"""

from __future__ import annotations

import dataclasses

import numpy as np
from numpy.typing import NDArray

from spf.cost.problem import make_problem
from spf.filters.dynamics import DynamicsSettings, drift, predict
from spf.filters.estimate import Samples, conclude
from spf.filters.likelihood import LikelihoodSettings, judge, log_likelihood
from spf.filters.particles import normalise, weighted_mean
from spf.filters.resampling import ResamplingSettings, resample
from spf.filters.step import Clock, State, StepInfo
from spf.hand.model import Hand
from spf.kernels.cost import Spheres
from spf.nbp.beliefs import BeliefSettings, Messages, Model, propagate
from spf.nbp.bodies import QUATERNION, aligned, bodies_of, states_of
from spf.nbp.graph import graph_of
from spf.nbp.hands import draw_hands
from spf.nbp.mixture import Mixture
from spf.observation import Observation
from spf.settings import setting

__all__ = ["NbpSettings", "step"]

Array = NDArray[np.float64]
_LEAST_CHANGE = 1e-3  # m, and of a quaternion: standard deviation of a body's change that is not 0


@dataclasses.dataclass(frozen=True)
class NbpSettings(BeliefSettings, ResamplingSettings, DynamicsSettings, LikelihoodSettings):
    """All settings of the tracker by nonparametric belief propagation."""

    n: int = setting(
        100, "samples of a body's belief, and hands drawn from all", group="Filter", low=2, high=2000, symbol="N"
    )


def step(
    rng: np.random.Generator,
    state: State,
    observation: Observation,
    hand: Hand,
    settings: NbpSettings,
    *,
    spheres: Spheres | None = None,
    record: bool = False,
    effort: float = 1.0,
) -> tuple[State, StepInfo]:
    """Track one frame; arguments as of :func:`spf.filters.smart.step`.

    The samples are N hands drawn from the bodies' beliefs, weighed by the likelihood of the other trackers (6), so that all
    estimate in the same way; a large ``sigma2`` leaves them the weight that belief propagation gave them. There are no
    optimised samples and no trajectories.
    """
    clock = Clock()
    interval = max(observation.time - state.time, 1e-3)
    problem = make_problem(hand, observation, settings, state.reference, rng, spheres)
    order = rng.permutation(len(hand.skin.vertices)).astype(np.int32)
    ancestors = resample(state.particles.log_weights, settings.n, settings, rng)
    before = state.particles.poses[ancestors]
    expected = drift(hand, before, state.particles.velocities[ancestors], interval, settings)
    bodies = bodies_of(hand)
    anchors = states_of(hand, state.estimate[None], state.reference)[:, 0, QUATERNION]
    temporal = _temporal(hand, expected, predict(hand, expected, interval, settings, rng), state.reference, anchors)
    model = Model(bodies, graph_of(hand, bodies), observation, settings, temporal, anchors)
    clock("predict")
    beliefs = temporal
    messages: Messages = {}
    iterations = max(1, round(effort * settings.iterations))
    for _ in range(iterations):
        beliefs, messages = propagate(model, messages, beliefs, settings.n, rng)
    clock("propagate")
    hands = draw_hands(hand, model.graph, beliefs, state.reference, settings.n, rng)
    clock("draw")
    judged = judge(problem, hands, order, render=settings.golden > 0.0)
    likelihood = log_likelihood(judged, settings, settings.sigma2)
    log_weights = normalise(likelihood)
    clock("weigh")
    moved = weighted_mean(hands, log_weights) - state.estimate  # a hand made of many samples comes from no one hand
    samples = Samples(
        ancestors, ("beliefs",) * settings.n, hands - moved, hands, hands[:0],
        judged, likelihood, np.zeros(settings.n), log_weights, float("nan"),
    )  # fmt: skip
    return conclude(
        problem, settings.sigma2, state, interval, samples, clock, evaluations=settings.n * (iterations + 1)
    )


def _temporal(hand: Hand, expected: Array, predicted: Array, reference: Array, anchors: Array) -> list[Mixture]:
    """Messages (3) from the last frame: kernels on the bodies of expected poses (N, D), as wide as the dynamics moves each.

    The paper's Λ_i are the variances of the bodies' changes; here those that the noise of the 26 degrees of freedom makes.
    """
    count = len(expected)
    uniform = np.full(count, -np.log(count))
    messages = []
    for body, (own, moved) in enumerate(
        zip(states_of(hand, expected, reference), states_of(hand, predicted, reference), strict=True)
    ):
        means = aligned(own, anchors[body])
        change = np.sqrt(((aligned(moved, anchors[body]) - means) ** 2).mean(axis=0))
        messages.append(Mixture(means, uniform, np.maximum(change, _LEAST_CHANGE)))
    return messages
