"""Resampling of a weighted set (Fig. 6a)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

__all__ = ["systematic"]


def systematic(log_weights: NDArray[np.float64], count: int, rng: np.random.Generator) -> NDArray[np.intp]:
    """Draw ``count`` ancestors with one uniform number: particle i is drawn ⌊count·π_i⌋ or ⌈count·π_i⌉ times.

    Args:
        log_weights: (N,) normalised.
        count: number of ancestors.
        rng: randomness.

    Returns:
        (count,) indices, ascending.
    """
    positions = (rng.random() + np.arange(count)) / count
    cumulative = np.cumsum(np.exp(log_weights))
    cumulative /= cumulative[-1]
    return np.searchsorted(cumulative, positions, side="right").clip(max=len(log_weights) - 1)
