"""Resampling of a weighted set (Fig. 6a): the usual schemes (Douc, Cappé 2005), one function each."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from spf.filters.particles import ess
from spf.settings import Settings, setting

__all__ = [
    "SCHEMES",
    "ResamplingSettings",
    "multinomial",
    "resample",
    "resample_when_needed",
    "residual",
    "stratified",
    "systematic",
]

Array = NDArray[np.float64]
Indices = NDArray[np.intp]


def systematic(log_weights: Array, count: int, rng: np.random.Generator) -> Indices:
    """Draw ``count`` ancestors with one uniform number: particle i is drawn ⌊count·π_i⌋ or ⌈count·π_i⌉ times.

    Args:
        log_weights: (N,) normalised.
        count: number of ancestors.
        rng: randomness.

    Returns:
        (count,) indices, ascending.
    """
    return _drawn_at((rng.random() + np.arange(count)) / count, np.exp(log_weights))


def stratified(log_weights: Array, count: int, rng: np.random.Generator) -> Indices:
    """Draw one ancestor from each of ``count`` equal strata of the weights; arguments as of :func:`systematic`."""
    return _drawn_at((rng.random(count) + np.arange(count)) / count, np.exp(log_weights))


def multinomial(log_weights: Array, count: int, rng: np.random.Generator) -> Indices:
    """Draw ``count`` ancestors independently; arguments as of :func:`systematic`."""
    return _drawn_at(np.sort(rng.random(count)), np.exp(log_weights))


def residual(log_weights: Array, count: int, rng: np.random.Generator) -> Indices:
    """Take particle i ⌊count·π_i⌋ times, and draw the rest from what is left of the weights; as :func:`systematic`."""
    weights = np.exp(log_weights)
    expected = count * weights / weights.sum()
    copies = np.floor(expected + 1e-9).astype(np.intp)
    sure = np.repeat(np.arange(len(weights), dtype=np.intp), copies)
    left = np.maximum(expected - copies, 0.0)
    if len(sure) >= count or not left.any():
        return sure[:count]
    return np.sort(np.concatenate([sure, _drawn_at(np.sort(rng.random(count - len(sure))), left)]))


def _drawn_at(positions: Array, weights: Array) -> Indices:
    """Particles (count,) at ascending positions in [0, 1) along the cumulative weights."""
    cumulative = np.cumsum(weights)
    cumulative /= cumulative[-1]
    return np.searchsorted(cumulative, positions, side="right").clip(max=len(weights) - 1)


SCHEMES: dict[str, Callable[[Array, int, np.random.Generator], Indices]] = {
    "systematic": systematic,
    "stratified": stratified,
    "residual": residual,
    "multinomial": multinomial,
}


@dataclasses.dataclass(frozen=True)
class ResamplingSettings(Settings):
    """How ancestors are drawn."""

    resampling: str = setting(
        "systematic", "scheme by which ancestors are drawn", group="Filter", choices=tuple(SCHEMES)
    )


def resample(log_weights: Array, count: int, settings: ResamplingSettings, rng: np.random.Generator) -> Indices:
    """Draw ``count`` ancestors of a weighted set by the scheme that the settings name."""
    return SCHEMES[settings.resampling](log_weights, count, rng)


def resample_when_needed(
    log_weights: Array, count: int, settings: ResamplingSettings, below: float, rng: np.random.Generator
) -> tuple[Indices, Array]:
    """Resample a weighted set (N,) to ``count`` only when its effective sample size is below a share of N, or N ≠ count.

    Returns:
        (ancestors (count,), the log-weights (count,) that they carry on: normalised, equal after resampling).
    """
    if len(log_weights) == count and ess(log_weights) >= below * count and below < 1.0:
        return np.arange(count), log_weights
    return resample(log_weights, count, settings, rng), np.full(count, -np.log(count))
