"""The consistent alternative to the paper's window: optimised samples drawn from a Gaussian, weighed by the true ratio.

Under each optimum ŝ_i the posterior is nearly a Gaussian (Laplace), with the Gauss-Newton Hessian H of the cost (22) and the
process noise Q in its precision ``A_i = H/σ² + Q⁻¹``. A sample drawn from it has a known density, and so has a predicted
one, which comes from the dynamics around what was expected, e_i. Every sample s is weighed by the mixture that it may have
come from (importance sampling, multiple proposals):

    w(s) ∝ p(z|s) f(s)/q(s),   f(s) = Σ π_i N(s; e_i, Q),   q(s) = ½ Σ N(s; e_i, Q)/N + ½ Σ N(s; ŝ_i, A_i⁻¹)/N

No kernel and no window is left, and the posterior is what it would be without the optimiser, whatever N. Approximated are
structured and learned proposals, which are taken for predictions of the dynamics around themselves, and the joint limits.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.distance import cdist

from spf.cost.problem import Problem
from spf.cost.products import gauss_newton, see
from spf.filters.particles import log_sum_exp
from spf.parallel import map_threads

__all__ = ["draw", "log_ratio", "precisions_at"]

Array = NDArray[np.float64]


def precisions_at(problem: Problem, poses: Array, sigma2: float, noise: Array) -> Array:
    """Precisions A (N, D, D) of the posterior under poses (N, D).

    Args:
        problem: the frame's cost.
        poses: (N, D) optima.
        sigma2: σ² of the likelihood (6).
        noise: (D,) standard deviation of the process noise.
    """

    def under(pose: Array) -> Array:
        return gauss_newton(problem, pose, see(problem, pose)) / sigma2 + np.diag(noise**-2.0)

    return np.array(map_threads(under, list(poses)))


def draw(means: Array, precisions: Array, rng: np.random.Generator) -> Array:
    """Draw one sample (N, D) from each Gaussian of means (N, D) and precisions (N, D, D)."""
    lower = np.linalg.cholesky(precisions)
    away = np.linalg.solve(lower.transpose(0, 2, 1), rng.normal(size=means.shape)[..., None])
    return np.asarray(means + away[..., 0])


def log_ratio(
    samples: Array,
    expected: Array,
    log_prior: Array,
    noise: Array,
    optima: Array,
    precisions: Array,
    *,
    kept: bool = True,
) -> Array:
    """Logarithm of f/q (M,) of samples (M, D), up to a constant.

    Args:
        samples: predicted and drawn ones.
        expected: (N, D) e, what the dynamics expected without noise.
        log_prior: (N,) log π of each.
        noise: (D,) standard deviation of the process noise.
        optima, precisions: (N, D) ŝ and (N, D, D) A.
        kept: whether the predicted samples take part; q is that of the drawn ones alone otherwise.
    """
    dynamics = -0.5 * cdist(samples / noise, expected / noise, "sqeuclidean") - np.log(noise).sum()
    apart = samples[:, None] - optima
    log_volumes = 0.5 * np.linalg.slogdet(precisions)[1]
    drawn = log_sum_exp(log_volumes - 0.5 * np.einsum("mni,nij,mnj->mn", apart, precisions, apart))
    log_q = np.logaddexp(log_sum_exp(dynamics), drawn) if kept else drawn
    return np.asarray(log_sum_exp(dynamics + log_prior) - log_q)
