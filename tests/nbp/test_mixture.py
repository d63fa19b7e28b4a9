"""Mixtures: their density, their bandwidth, and samples of products, against what can be computed exactly."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from scipy import stats

from spf.nbp.mixture import Mixture, draw_labels, log_density, mixture_of, sample_product


def test_the_density_is_that_of_a_sum_of_gaussians(rng):
    means, weights, widths = rng.normal(size=(5, 3)), rng.dirichlet(np.ones(5)), np.array([0.3, 1.0, 2.0])
    at = rng.normal(size=(7, 3))
    expected = sum(
        w * stats.multivariate_normal(m, np.diag(widths**2)).pdf(at) for w, m in zip(weights, means, strict=True)
    )
    np.testing.assert_allclose(np.exp(log_density(at, Mixture(means, np.log(weights), widths))), expected, rtol=1e-9)


def test_the_bandwidth_is_the_rule_of_thumb(rng):
    samples = rng.normal(size=(200, 4)) * [1.0, 2.0, 3.0, 0.0]
    mixture = mixture_of(samples, np.full(200, -np.log(200)))
    factor = stats.gaussian_kde(samples[:, :3].T, "silverman").factor * ((3 + 2) / (4 + 2)) ** (1 / 8)
    factor *= (200.0 * (3 + 2) / 4.0) ** (1 / 7) * (200.0 * (3 + 2) / 4.0) ** (-1 / 8)  # Silverman's power for d = 4
    np.testing.assert_allclose(mixture.bandwidth[:3], factor * samples[:, :3].std(axis=0), rtol=1e-9)
    assert 0.0 < mixture.bandwidth[3] < 1e-3


def test_labels_are_drawn_by_their_weights(rng):
    drawn = draw_labels(np.tile(np.log([0.1, 0.6, 0.3]) + 5.0, (20000, 1)), rng)
    np.testing.assert_allclose(np.bincount(drawn) / 20000, [0.1, 0.6, 0.3], atol=0.015)


def test_the_product_of_two_gaussians_is_their_gaussian(rng):
    one, other = (Mixture(np.array([[m]]), np.zeros(1), np.array([s])) for m, s in ((0.0, 1.0), (3.0, 0.5)))
    drawn = sample_product([one, other], 20000, 1, rng)
    assert drawn.mean() == pytest.approx((0.0 / 1.0 + 3.0 / 0.25) / (1.0 + 4.0), abs=0.02)
    assert drawn.std() == pytest.approx(np.sqrt(1.0 / 5.0), rel=0.03)


def test_samples_of_a_product_of_three_mixtures_are_spread_as_its_density(rng):
    """Against the density itself, all 4³ kernels of it."""
    mixtures = [
        Mixture(rng.uniform(-2.0, 2.0, (4, 1)), np.log(rng.dirichlet(np.ones(4))), np.array([width]))
        for width in (0.8, 1.0, 1.3)
    ]
    drawn = np.sort(sample_product(mixtures, 40000, 8, rng)[:, 0])
    grid = np.linspace(-6.0, 6.0, 4001)
    density = np.exp(sum(log_density(grid[:, None], one) for one in mixtures))
    assert len(list(itertools.product(*(one.means for one in mixtures)))) == 64
    cumulative = np.cumsum(density) / density.sum()
    assert np.abs(np.interp(drawn, grid, cumulative) - (np.arange(40000) + 0.5) / 40000).max() < 0.02
