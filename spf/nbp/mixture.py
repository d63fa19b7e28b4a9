"""Mixtures of Gaussians with one kernel a sample, and samples of their products: what messages and beliefs are made of.

A product of d mixtures of M kernels has M^d; it is sampled by drawing the d labels in turn, each given the others (Gibbs;
Sudderth, Ihler, Freeman, Willsky 2003).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.distance import cdist

from spf.filters.kde import silverman_factor
from spf.filters.particles import log_sum_exp, normalise

__all__ = ["Mixture", "draw_labels", "log_density", "mixture_of", "reweighed", "sample_product"]

Array = NDArray[np.float64]
_LEAST = 1e-4  # bandwidth of samples that all lie in one place: m, and of a quaternion


class Mixture(NamedTuple):
    """A weighted mixture of Gaussians with one diagonal covariance.

    Attributes:
        means: (M, d).
        log_weights: (M,) normalised.
        bandwidth: (d,) standard deviations.
    """

    means: Array
    log_weights: Array
    bandwidth: Array


def mixture_of(samples: Array, log_weights: Array) -> Mixture:
    """Place kernels on weighted samples (M, d), as wide as the rule of thumb says (Silverman 1986), in each entry."""
    weights = np.exp(log_weights)
    variance = weights @ (samples - weights @ samples) ** 2
    return Mixture(samples, log_weights, np.maximum(silverman_factor(*samples.shape) * np.sqrt(variance), _LEAST))


def log_density(at: Array, mixture: Mixture) -> Array:
    """Logarithm (N,) of a mixture's density at places (N, d)."""
    squared = cdist(at / mixture.bandwidth, mixture.means / mixture.bandwidth, "sqeuclidean")
    constant = np.log(mixture.bandwidth).sum() + 0.5 * at.shape[1] * math.log(2.0 * math.pi)
    return np.asarray(log_sum_exp(mixture.log_weights - 0.5 * squared) - constant)


def draw_labels(log_weights: Array, rng: np.random.Generator) -> NDArray[np.intp]:
    """Draw one index for each row (N,) of log-weights (N, M), which need not be normalised."""
    return np.asarray(np.argmax(log_weights + rng.gumbel(size=log_weights.shape), axis=1))


def sample_product(mixtures: Sequence[Mixture], count: int, sweeps: int, rng: np.random.Generator) -> Array:
    """Draw samples (count, d) of a product of mixtures, all chains side by side.

    Args:
        mixtures: at least one.
        count: how many samples.
        sweeps: how often each label is drawn anew; one mixture needs none.
        rng: randomness.
    """
    labels = [rng.choice(len(one.means), size=count, p=np.exp(one.log_weights)) for one in mixtures]
    precisions = [one.bandwidth**-2.0 for one in mixtures]
    for _ in range(sweeps if len(mixtures) > 1 else 0):
        for own, one in enumerate(mixtures):
            others = [other for other in range(len(mixtures)) if other != own]
            precision, mean = _product(mixtures, precisions, labels, others)
            width = np.sqrt(one.bandwidth**2 + 1.0 / precision)
            squared = cdist(mean / width, one.means / width, "sqeuclidean")
            labels[own] = draw_labels(one.log_weights - 0.5 * squared, rng)
    precision, mean = _product(mixtures, precisions, labels, list(range(len(mixtures))))
    return mean + rng.normal(size=mean.shape) / np.sqrt(precision)


def _product(
    mixtures: Sequence[Mixture], precisions: list[Array], labels: list[NDArray[np.intp]], which: list[int]
) -> tuple[Array, Array]:
    """Precision (d,) and means (N, d) of the products of the kernels that labels (N,) name."""
    precision = np.sum([precisions[one] for one in which], axis=0)
    total = np.sum([precisions[one] * mixtures[one].means[labels[one]] for one in which], axis=0)
    return precision, total / precision


def reweighed(mixture: Mixture, log_factors: Array) -> Mixture:
    """Return a mixture whose weights are multiplied by exp(log_factors) (M,)."""
    return mixture._replace(log_weights=normalise(mixture.log_weights + log_factors))
