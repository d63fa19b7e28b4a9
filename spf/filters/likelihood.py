"""The likelihood of poses (6): E on the same points for all particles of a frame, joined by the rendered comparison."""

from __future__ import annotations

import dataclasses
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from spf.cost.problem import Problem, costs, golden
from spf.cost.settings import CostSettings
from spf.parallel import map_threads
from spf.settings import setting

__all__ = ["SIGMA2", "Judged", "LikelihoodSettings", "judge", "log_likelihood"]

Array = NDArray[np.float64]
SIGMA2 = 4.5  # σ² that suits a sum over 45 points


@dataclasses.dataclass(frozen=True)
class LikelihoodSettings(CostSettings):
    """What is compared, and how sharply it tells poses apart."""

    sigma2: float = setting(
        SIGMA2,
        "variance of the likelihood, log p = -(E + golden)/σ²",
        group="Filter",
        low=1e-3,
        high=1e4,
        symbol="σ²",
    )


class Judged(NamedTuple):
    """How well poses explain a frame.

    Attributes:
        energy: (N,) E.
        golden: (N,) rendered comparison; nan when it was left out.
        overlap: (N,) silhouette overlap; nan when it was left out.
    """

    energy: Array
    golden: Array
    overlap: Array


def judge(problem: Problem, poses: Array, order: NDArray[np.int32] | None = None, *, render: bool = True) -> Judged:
    """Judge poses (N, D), in parallel.

    Args:
        problem: the frame's cost.
        poses: (N, D).
        order: of the vertices, whose first |S| visible ones E is summed over; None for all visible ones.
        render: whether to compare renders too.
    """

    def run(chunk: Array) -> Judged:
        left_out = np.full(len(chunk), np.nan)
        rendered = golden(problem, chunk) if render else (left_out, left_out)
        return Judged(costs(problem, chunk, order), *rendered)

    parts = map_threads(run, [chunk for chunk in np.array_split(poses, 2) if len(chunk)])
    return Judged(*(np.concatenate(arrays) for arrays in zip(*parts, strict=True)))


def log_likelihood(judged: Judged, settings: CostSettings, sigma2: float) -> Array:
    """log p(z|s) = -E/σ² (6), E joined by the rendered comparison where that has a weight; up to a constant."""
    if settings.golden == 0.0:
        return -judged.energy / sigma2
    return -(judged.energy + settings.golden * settings.points * judged.golden) / sigma2
