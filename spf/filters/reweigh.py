"""What other settings would have made of a frame's samples: weighed anew where they are, without optimising them again.

The samples of a step stay; their costs, likelihoods (6), window, correction (32), weights and the estimate are those of the
new settings. What a setting does before the weighing (N, μ, the dynamics) is not seen: that takes the frame once more.
"""

from __future__ import annotations

import dataclasses

import numpy as np
from numpy.typing import NDArray

from spf.cost.problem import Problem, costs, make_problem
from spf.cost.settings import CostSettings
from spf.errors import SettingError
from spf.filters.dynamics import noise_scale
from spf.filters.kde import correct
from spf.filters.likelihood import SIGMA2, Judged, judge, log_likelihood
from spf.filters.particles import ess, normalise, weighted_mean
from spf.filters.smart import SpfSettings, log_prior
from spf.filters.step import StepInfo
from spf.hand.model import Hand
from spf.kernels.cost import Spheres
from spf.observation import Observation
from spf.parallel import map_threads
from spf.settings import Settings

__all__ = ["SEEN_AT_ONCE", "landscape", "reweigh"]

Array = NDArray[np.float64]

#: Settings whose effect on the samples of a frame is seen without optimising them again.
SEEN_AT_ONCE = frozenset(
    {field.name for field in dataclasses.fields(CostSettings)}
    | {"sigma2", "h", "window_rule", "correction", "keep_predicted", "learned_prior"}
) - {"points", "data_points"}


def reweigh(
    rng: np.random.Generator,
    hand: Hand,
    observation: Observation,
    info: StepInfo,
    was: CostSettings,
    settings: CostSettings,
    interval: float,
    spheres: Spheres | None = None,
) -> StepInfo:
    """Weigh the samples of a frame with other settings.

    Args:
        rng: in the state that the step was called with: the same pixels are compared.
        hand: the calibrated hand.
        observation: of the frame.
        info: what happened in it.
        was: settings that it was tracked with.
        settings: of the same tracker, to weigh with. N and the sizes of the cost's samples stay those of ``was``.
        interval: s between the frame and the one before.
        spheres: of the collision term; made from the hand otherwise.

    Returns:
        The info with costs, likelihoods, corrections, weights, ESS, window and estimate as the settings make them; with
        ``settings`` equal to ``was``, the info's own, as far as the observation and the randomness are the same (the
        annealed filter's costs are on other vertices, its weights are the same).

    Raises:
        SettingError: the optimised samples were drawn, or would be (``weighting=laplace``): where they are depends on the
            settings.
    """
    if "laplace" in (getattr(was, "weighting", ""), getattr(settings, "weighting", "")):
        raise SettingError(
            "What a setting does to drawn samples (weighting=laplace) is seen when the frame is tracked again."
        )
    settings = settings.replace(points=was.points, data_points=was.data_points)
    problem = make_problem(hand, observation, settings, info.reference, rng, spheres)
    poses = np.concatenate([info.predicted, info.optimised])
    order = None
    if (
        len(info.optimised) == 0 or info.layers
    ):  # Condensation and the annealed filter compare the same vertices everywhere
        order = rng.permutation(len(hand.skin.vertices)).astype(np.int32)
    sigma2 = float(getattr(settings, "sigma2", SIGMA2))
    judged = judge(problem, poses, order, render=settings.golden > 0.0 or bool(np.isfinite(info.golden).all()))
    likelihood = log_likelihood(judged, settings, sigma2)
    exponent = info.layers[-1].exponent if info.layers else 1.0
    before = info.log_likelihood
    if info.layers:  # which vertices its layers compared is not kept: both settings are asked about the same others
        asked = make_problem(hand, observation, was, info.reference, rng, spheres)._replace(data_pool=problem.data_pool)
        before = log_likelihood(judge(asked, poses, order, render=was.golden > 0.0), was, sigma2)
    log_weights = info.log_weights + exponent * (likelihood - before)
    window, log_c = info.window, info.log_correction
    if isinstance(settings, SpfSettings) and isinstance(was, SpfSettings):
        window, log_c = correct(info.predicted, info.optimised, noise_scale(hand, settings, interval), settings)
        log_weights = log_c + likelihood + log_prior(info.origins, settings.replace(n=was.n))
    return _concluded(problem, info, judged, likelihood, log_c, normalise(log_weights), window, sigma2)


def _concluded(
    problem: Problem, info: StepInfo, judged: Judged, likelihood: Array, log_c: Array, log_weights: Array, window: float,
    sigma2: float,
) -> StepInfo:  # fmt: skip
    count = len(info.predicted)
    estimate = weighted_mean(np.concatenate([info.predicted, info.optimised]), log_weights)
    of_estimate = judge(problem, estimate[None])
    return info._replace(
        cost_before=judged.energy[:count],
        cost_after=judged.energy[count:],
        golden=judged.golden,
        overlap=judged.overlap,
        log_likelihood=likelihood,
        log_correction=log_c,
        log_weights=log_weights,
        ess=ess(log_weights),
        optimised_share=float(np.exp(log_weights[count:]).sum()),
        window=window,
        estimate=estimate,
        estimate_golden=float(of_estimate.golden[0]),
        estimate_overlap=float(of_estimate.overlap[0]),
        estimate_cost=float(of_estimate.energy[0]),
        estimate_log_likelihood=float(log_likelihood(of_estimate, problem.settings, sigma2)[0]),
    )


def landscape(
    rng: np.random.Generator,
    hand: Hand,
    observation: Observation,
    info: StepInfo,
    settings: Settings,
    entries: tuple[int, int],
    across: tuple[Array, Array],
    spheres: Spheres | None = None,
) -> Array:
    """Return E (3) over two entries of the pose, all others as in the estimate: (len(across[1]), len(across[0])).

    Args:
        rng, hand, observation, info, settings, spheres: as of :func:`reweigh`.
        entries: indices of the two entries.
        across: values of each, m or rad.
    """
    assert isinstance(settings, CostSettings)
    problem = make_problem(hand, observation, settings, info.reference, rng, spheres)
    grid = np.stack(np.meshgrid(*across), axis=-1)
    poses = np.tile(info.estimate, (grid[..., 0].size, 1))
    poses[:, list(entries)] = grid.reshape(-1, 2)
    chunks = np.array_split(poses, 8)
    return np.concatenate(map_threads(lambda chunk: costs(problem, chunk), chunks)).reshape(grid.shape[:2])
