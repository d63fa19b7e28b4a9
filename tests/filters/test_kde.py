"""Kernel density estimates and the correction factor, against SciPy and by their properties (eq. 27-32)."""

import numpy as np
import pytest
from scipy.stats import gaussian_kde

from spf.filters.kde import adaptive_window, log_correction, log_density, paper_window, silverman_window


def test_the_density_is_scipys(rng: np.random.Generator) -> None:
    samples, at = rng.normal(size=(40, 2)), rng.normal(size=(15, 2))
    h = 0.4
    theirs = gaussian_kde(samples.T)
    theirs.covariance = h**2 * np.eye(2)
    theirs.cho_cov = h * np.eye(2)
    theirs.log_det = 2 * np.log(2 * np.pi * h**2)
    np.testing.assert_allclose(log_density(at, samples, h), theirs.logpdf(at.T), rtol=1e-10)


def test_the_density_survives_26_dimensions(rng: np.random.Generator) -> None:
    far = log_density(np.full((1, 26), 50.0), rng.normal(size=(4, 26)), 1.0)
    assert np.isfinite(far).all()
    assert far[0] < -10_000


def test_equal_sets_need_no_correction(rng: np.random.Generator) -> None:
    samples = rng.normal(size=(6, 26))
    np.testing.assert_allclose(log_correction(samples, samples, 2.0), 0.0, atol=1e-12)


def test_a_small_window_throws_optimised_samples_away_and_a_large_one_corrects_nothing(
    rng: np.random.Generator,
) -> None:
    predicted = rng.normal(size=(4, 26))
    optimised = predicted + 1.5
    small, large = log_correction(predicted, optimised, 0.3), log_correction(predicted, optimised, 1e3)
    assert (small[4:] < -20).all()
    np.testing.assert_allclose(small[:4], np.log(2.0), atol=1e-6)
    np.testing.assert_allclose(large, 0.0, atol=1e-3)


def test_the_correction_is_two_f_over_f_plus_f_plus(rng: np.random.Generator) -> None:
    predicted, optimised = rng.normal(size=(5, 2)), rng.normal(size=(5, 2)) + 0.5
    at = np.concatenate([predicted, optimised])
    f, f_plus = (np.exp(log_density(at, part, 0.7)) for part in (predicted, optimised))
    np.testing.assert_allclose(np.exp(log_correction(predicted, optimised, 0.7)), 2 * f / (f + f_plus), rtol=1e-10)


@pytest.mark.parametrize("count", [10, 1000])
def test_window_rules(count: int, rng: np.random.Generator) -> None:
    samples = 3.0 * rng.normal(size=(count, 4))
    sigma = np.sqrt(np.trace(np.cov(samples.T)) / 4)
    assert paper_window(samples) == pytest.approx(1.06 * sigma * count**-0.2)
    assert silverman_window(samples) == pytest.approx((4 / 6) ** (1 / 8) * sigma * count ** (-1 / 8))


def test_the_adaptive_window_keeps_half_of_the_optimised_weight_however_far_the_optima_lie():
    predicted = np.random.default_rng(3).normal(size=(5, 26))
    windows = []
    for far in (0.5, 2.0, 8.0):
        optimised = predicted * 0.3 + far
        windows.append(adaptive_window(predicted, optimised))
        log_c = log_correction(predicted, optimised, windows[-1])[len(predicted) :]
        assert np.exp(log_c.mean()) == pytest.approx(0.5, abs=0.01)
    assert windows == sorted(windows)
    assert windows[2] > 3 * windows[0]
    assert adaptive_window(predicted, predicted) == 0.01  # nothing has moved: any window will do
    assert adaptive_window(predicted, predicted + 1e4) == 100.0
