"""Kernel density estimates of particle sets, and the correction factor between two of them (eq. 27-32)."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq
from scipy.spatial.distance import cdist

from spf.filters.particles import log_sum_exp
from spf.settings import Settings, setting

__all__ = [
    "WINDOW_RULES",
    "CorrectionSettings",
    "adaptive_window",
    "correct",
    "log_correction",
    "log_density",
    "marginal_density",
    "paper_window",
    "silverman_factor",
    "silverman_window",
]

Array = NDArray[np.float64]
_LEAST_WINDOW = 1e-6  # of samples that all lie in one place
_WINDOWS = 0.01, 100.0  # that the adaptive rule chooses from


@dataclasses.dataclass(frozen=True)
class CorrectionSettings(Settings):
    """How the weights of optimised samples are corrected."""

    h: float = setting(
        4.0,
        "window of the kernel density estimate, in units of the process noise",
        group="Filter",
        low=0.01,
        high=100.0,
        symbol="h",
    )
    window_rule: str = setting(
        "fixed",
        "how the window is chosen: h itself, the paper's (29), the d-dimensional rule, or as wide as each frame's optima need",
        group="Filter",
        choices=("fixed", "paper", "silverman", "adaptive"),
    )
    correction: bool = setting(True, "correct the weights of optimised samples (32)", group="Filter")
    weighting: str = setting(
        "window",
        "optimised samples as they are, corrected with the window h, or drawn around themselves and weighed by the true ratio",
        group="Filter",
        choices=("window", "laplace"),
    )


def correct(predicted: Array, optimised: Array, scale: Array, settings: CorrectionSettings) -> tuple[float, Array]:
    """Window h, and log c (32) of N predicted samples, then of N⁺ optimised ones; zeros when switched off.

    Args:
        predicted, optimised: (N, d), (N⁺, d).
        scale: (d,) by which entries are divided to be comparable: the process noise.
        settings: the window, and whether to correct.
    """
    white, white_optimised = predicted / scale, optimised / scale
    window = settings.h
    if settings.window_rule == "adaptive":
        window = adaptive_window(white, white_optimised)
    elif settings.window_rule != "fixed":
        window = max(WINDOW_RULES[settings.window_rule](white), _LEAST_WINDOW)
    if not settings.correction:
        return window, np.zeros(len(predicted) + len(optimised))
    return window, log_correction(white, white_optimised, window)


def log_density(at: Array, samples: Array, window: float) -> Array:
    """Logarithm of the Gaussian kernel density estimate (27, 28).

    Args:
        at: (M, d) where; both in units in which all entries are comparable.
        samples: (N, d).
        window: h > 0.

    Returns:
        (M,) log f.
    """
    count, dimensions = samples.shape
    squared = cdist(at, samples, "sqeuclidean") / window**2
    constant = math.log(count) + dimensions * math.log(window) + 0.5 * dimensions * math.log(2.0 * math.pi)
    return np.asarray(log_sum_exp(-0.5 * squared) - constant)


def marginal_density(x: Array, y: Array, samples: Array, bandwidth: Array) -> Array:
    """Kernel density estimate (27) of two entries alone: a Gaussian kernel's marginal is a Gaussian kernel.

    Args:
        x, y: (W,), (H,) values of the two entries.
        samples: (N, 2).
        bandwidth: (2,) window of each entry, in its own unit.

    Returns:
        (H, W) density, for y down and x across.
    """
    across, upwards = (
        np.exp(-0.5 * ((values[:, None] - column) / width) ** 2) / (width * math.sqrt(2.0 * math.pi))
        for values, column, width in zip((x, y), samples.T, bandwidth, strict=True)
    )
    return np.asarray(upwards @ across.T / len(samples))


def log_correction(predicted: Array, optimised: Array, window: float) -> Array:
    """Logarithm of c = f/g = 2f/(f + f⁺) (31, 32) at the predicted samples, then at the optimised ones.

    Args:
        predicted: (N, d) samples of f, whitened.
        optimised: (N⁺, d) samples of f⁺, whitened.
        window: h.

    Returns:
        (N + N⁺,) log c, at most log 2.
    """
    at = np.concatenate([predicted, optimised])
    log_f, log_f_plus = log_density(at, predicted, window), log_density(at, optimised, window)
    return np.asarray(math.log(2.0) + log_f - np.logaddexp(log_f, log_f_plus))


def _spread(samples: Array) -> float:
    """σ of (30): root of the mean of the covariance's diagonal."""
    return float(np.sqrt(np.mean(np.var(samples, axis=0, ddof=1)))) if len(samples) > 1 else 1.0


def paper_window(samples: Array) -> float:
    """``h_opt = 1.06 σ N^(−1/5)`` (29), the paper's choice (Silverman's rule for one dimension)."""
    return 1.06 * _spread(samples) * float(len(samples)) ** -0.2


def silverman_factor(count: int, dimensions: int) -> float:
    """``(4/((d+2) N))^(1/(d+4))``: windows by standard deviations of N samples in d dimensions (Silverman 1986)."""
    return float((4.0 / ((dimensions + 2) * count)) ** (1.0 / (dimensions + 4)))


def silverman_window(samples: Array) -> float:
    """Silverman's rule in d dimensions: :func:`silverman_factor` times σ of (30)."""
    count, dimensions = samples.shape
    return silverman_factor(count, dimensions) * _spread(samples)


def adaptive_window(predicted: Array, optimised: Array) -> float:
    """Return the smallest window that keeps half of the optimised samples' weight: the mean of their log c (32) is log ½.

    It grows with how far the optima lie from all that was predicted, so that a fast motion is not taken for an impossible
    one, and no wider than that, so that f still tells near samples from far ones. Not from the paper.

    Args:
        predicted, optimised: (N, d), (N⁺, d), whitened.

    Returns:
        h, between 0.01 and 100.
    """
    count = len(predicted)

    def excess(log_window: float) -> float:
        return float(log_correction(predicted, optimised, math.exp(log_window))[count:].mean()) - math.log(0.5)

    low, high = map(math.log, _WINDOWS)
    if excess(low) >= 0.0:
        return _WINDOWS[0]
    if excess(high) <= 0.0:
        return _WINDOWS[1]
    return math.exp(brentq(excess, low, high, xtol=1e-3))


#: Rules that find the window from the predicted samples.
WINDOW_RULES = {"paper": paper_window, "silverman": silverman_window}
