"""One SMD tracker without a filter (spec 7; Fig. 9, left column; Fig. 10): each frame descends from the last estimate."""

from __future__ import annotations

import dataclasses

import numpy as np

from spf.cost.settings import CostSettings
from spf.cost.spheres import digit_spheres
from spf.filters import smart
from spf.filters.step import State, StepInfo
from spf.hand.model import Hand
from spf.kernels.cost import Spheres
from spf.observation import Observation
from spf.optimisers.smd import SmdSettings

__all__ = ["SingleSettings", "step"]


@dataclasses.dataclass(frozen=True)
class SingleSettings(SmdSettings, CostSettings):
    """Settings of the single tracker."""


def step(
    rng: np.random.Generator,
    state: State,
    observation: Observation,
    hand: Hand,
    settings: SingleSettings,
    *,
    spheres: Spheres | None = None,
    record: bool = False,
    effort: float = 1.0,
) -> tuple[State, StepInfo]:
    """Track one frame: the Smart Particle Filter's step with one particle, no noise and nothing but its optimum kept."""
    alone = smart.SpfSettings(
        **settings.to_dict(), n=1, noise_translation=1e-5, noise_rotation=1e-4, noise_digits=1e-4, velocity=0.0,
        structured=0.0, recombination=0.0, learned=False, correction=False, keep_predicted=False, prediction_pull=0.0,
    )  # fmt: skip
    return smart.step(
        rng, state, observation, hand, alone, spheres=spheres or digit_spheres(hand), record=record, effort=effort
    )
