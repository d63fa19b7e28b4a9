"""One tracker without a filter (spec 7; Fig. 9, left column; Fig. 10): each frame is optimised from the last estimate."""

from __future__ import annotations

import dataclasses

import numpy as np

from spf.cost.problem import make_problem
from spf.cost.settings import CostSettings
from spf.filters.estimate import Samples, conclude
from spf.filters.likelihood import SIGMA2, judge, log_likelihood
from spf.filters.step import Clock, State, StepInfo
from spf.hand.model import Hand
from spf.kernels.cost import Spheres
from spf.observation import Observation
from spf.optimisers.bfgs import BfgsSettings
from spf.optimisers.lm import LmSettings
from spf.optimisers.powell import PowellSettings
from spf.optimisers.smd import DescentSettings, SmdSettings
from spf.optimisers.trajectory import Optimise

__all__ = [
    "SingleBfgsSettings",
    "SingleGdSettings",
    "SingleLmSettings",
    "SinglePowellSettings",
    "SingleSmdSettings",
    "step",
]


@dataclasses.dataclass(frozen=True)
class SingleSmdSettings(SmdSettings, CostSettings):
    """Settings of one SMD tracker."""


@dataclasses.dataclass(frozen=True)
class SingleGdSettings(DescentSettings, CostSettings):
    """Settings of a tracker by gradient descent."""


@dataclasses.dataclass(frozen=True)
class SingleBfgsSettings(BfgsSettings, CostSettings):
    """Settings of a tracker by L-BFGS-B."""


@dataclasses.dataclass(frozen=True)
class SinglePowellSettings(PowellSettings, CostSettings):
    """Settings of a tracker by Powell's method."""


@dataclasses.dataclass(frozen=True)
class SingleLmSettings(LmSettings, CostSettings):
    """Settings of a tracker by Levenberg-Marquardt."""


def step(
    optimise: Optimise,
    rng: np.random.Generator,
    state: State,
    observation: Observation,
    hand: Hand,
    settings: CostSettings,
    *,
    spheres: Spheres | None = None,
    record: bool = False,
    effort: float = 1.0,
) -> tuple[State, StepInfo]:
    """Track one frame: what the optimiser finds from the last estimate is the estimate.

    Args:
        optimise: the optimiser.
        rng, state, observation, hand, spheres, record, effort: as of :func:`spf.filters.smart.step`.
        settings: of the cost and of that optimiser.

    Returns:
        (state, info): one predicted sample, without weight, and one optimised sample, with all of it.
    """
    clock = Clock()
    interval = max(observation.time - state.time, 1e-3)
    problem = make_problem(hand, observation, settings, state.reference, rng, spheres)
    before = state.estimate
    found, trajectory, evaluations = optimise(problem, settings, rng, before, effort=effort, record=record)
    clock("optimise")
    judged = judge(problem, np.stack([before, found]))
    likelihood, log_weights = log_likelihood(judged, settings, SIGMA2), np.array([-np.inf, 0.0])
    clock("weigh")
    samples = Samples(
        np.zeros(1, np.intp), ("estimate",), before[None], before[None], found[None],
        judged, likelihood, np.zeros(2), log_weights, float("nan"), resampled=False,
    )  # fmt: skip
    return conclude(
        problem, SIGMA2, state, interval, samples, clock,
        evaluations=evaluations + 2, trajectories=() if trajectory is None else (trajectory,),
    )  # fmt: skip
