"""The weighted set of particles: log-weights, effective sample size, weighted mean."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

__all__ = ["ParticleSet", "ess", "log_sum_exp", "normalise", "weighted_mean"]

Array = NDArray[np.float64]


class ParticleSet(NamedTuple):
    """N weighted samples of the state s = (p, ṗ).

    Attributes:
        poses: (N, D) relative to the reference orientation that the set's owner keeps.
        velocities: (N, D) per second.
        log_weights: (N,) normalised: their exponentials sum to 1.
    """

    poses: Array
    velocities: Array
    log_weights: Array


def log_sum_exp(values: Array) -> Array:
    """``ln Σ exp`` over the last axis (…, N), without overflow; -inf where all values are.

    SciPy's takes a tenth of a millisecond a call whatever the size, and a frame needs several.
    """
    most = values.max(axis=-1, keepdims=True)
    most[~np.isfinite(most)] = 0.0
    with np.errstate(divide="ignore"):  # the logarithm of 0 is -inf, as it should be
        return np.asarray(np.log(np.exp(values - most).sum(axis=-1)) + most[..., 0])


def normalise(log_weights: Array) -> Array:
    """Return log-weights (N,) whose exponentials sum to 1; uniform ones if all are -inf."""
    total = log_sum_exp(log_weights)
    if not np.isfinite(total):
        return np.full(len(log_weights), -np.log(len(log_weights)))
    return np.asarray(log_weights - total)


def ess(log_weights: Array) -> float:
    """Effective sample size ``1/Σπ²`` of normalised log-weights, between 1 and N."""
    return float(np.exp(-log_sum_exp(2.0 * log_weights)))


def weighted_mean(values: Array, log_weights: Array) -> Array:
    """``Σ π s`` over the first axis."""
    return np.asarray(np.tensordot(np.exp(log_weights), values, axes=1))
