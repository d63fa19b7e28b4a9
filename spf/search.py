"""Global search for a pose of unknown size and side: evolution of hypotheses, judged by the rendered comparison.

Rendering a hypothesis costs some ten microseconds, so that thousands of them can be judged. A generation keeps the best,
recombines their fingers, palms and sizes, and perturbs them with noise that shrinks. Used for the first pose and after a
loss.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from spf.cost.problem import Problem, golden
from spf.hand.model import Hand

__all__ = ["Hypotheses", "SearchSettings", "search"]

Array = NDArray[np.float64]


class SearchSettings(NamedTuple):
    """Effort of a search.

    Attributes:
        population: hypotheses in the first generation.
        survivors: how many are kept.
        generations: number of generations after the first.
        scale_mean, scale_spread: prior of the hand's scale, mean and standard deviation of its logarithm; 0 fixes it.
    """

    population: int = 3000
    survivors: int = 150
    generations: int = 16
    scale_mean: float = 1.0
    scale_spread: float = 0.15


class Hypotheses(NamedTuple):
    """Poses with sizes, best first.

    Attributes:
        poses: (N, D) relative to the problem's R_ref.
        scales: (N,) relative to the problem's hand.
        energies: (N,) golden energy plus the size prior.
    """

    poses: Array
    scales: Array
    energies: Array


class _Genes(NamedTuple):
    places: Array  # (N, 3) m
    turns: Array  # (N, 4) quaternions relative to R_ref
    digits: Array  # (N, D-6) rad
    scales: Array  # (N,)


def search(problem: Problem, places: Array, settings: SearchSettings, rng: np.random.Generator) -> Hypotheses:
    """Search poses whose render explains the observation.

    Args:
        problem: hand and observation.
        places: (M, 3) m, points of the surface where the palm may be.
        settings: effort and size prior.
        rng: randomness.
    """
    genes = _random_genes(problem.hand, places, settings.population, settings, rng)
    energies = _judge(problem, genes, settings)
    for generation in range(settings.generations):
        best = np.argsort(energies)[: settings.survivors]
        parents, parent_energies = _take(genes, best), energies[best]
        shrink = 0.8**generation
        children = _offspring(problem.hand, parents, 4 * settings.survivors, shrink, settings, rng)
        genes = _Genes(*(np.concatenate(pair) for pair in zip(parents, children, strict=True)))
        energies = np.concatenate([parent_energies, _judge(problem, children, settings)])
    order = np.argsort(energies)
    genes = _take(genes, order)
    return Hypotheses(_poses(genes), genes.scales, energies[order])


def _take(genes: _Genes, index: NDArray[np.intp]) -> _Genes:
    return _Genes(*(part[index] for part in genes))


def _poses(genes: _Genes) -> Array:
    angles = Rotation.from_quat(genes.turns).as_euler("XYZ")
    return np.concatenate([genes.places, angles, genes.digits], axis=1)


def _judge(problem: Problem, genes: _Genes, settings: SearchSettings) -> Array:
    energies = golden(problem, _poses(genes), genes.scales)[0]
    if settings.scale_spread > 0:
        off = np.log(genes.scales / settings.scale_mean) / settings.scale_spread
        energies = energies + 0.01 * off**2
    return energies


def _random_genes(hand: Hand, places: Array, count: int, settings: SearchSettings, rng: np.random.Generator) -> _Genes:
    at = places[rng.integers(len(places), size=count)] + np.array([0.0, 0.0, 0.015])
    turns = rng.normal(size=(count, 4))
    turns /= np.linalg.norm(turns, axis=1, keepdims=True)
    scales = settings.scale_mean * np.exp(settings.scale_spread * rng.normal(size=count))
    return _Genes(at + rng.normal(scale=0.015, size=at.shape), turns, random_digits(hand, count, rng), scales)


def random_digits(hand: Hand, count: int, rng: np.random.Generator) -> Array:
    """Draw plausible angles of the digits (count, D - 6): each finger somewhere between straight and curled."""
    limits = hand.limits[6:]
    digits = np.empty((count, hand.dofs - 6))
    digits[:, :4] = rng.uniform(0.7 * limits[:4, 0], 0.7 * limits[:4, 1], size=(count, 4))
    together = rng.beta(0.5, 0.5, size=(count, 1))
    for finger in range(4):
        own = rng.beta(0.4, 0.5, size=(count, 1))
        curl = np.where(rng.random((count, 1)) < 0.6, together, own)[:, 0]
        first = 4 + 4 * finger
        digits[:, first] = rng.normal(scale=0.1, size=count)
        digits[:, first + 1] = 1.3 * curl + rng.normal(scale=0.2, size=count)
        digits[:, first + 2] = 0.0
        digits[:, first + 3] = 1.6 * curl + rng.normal(scale=0.2, size=count)
    if hand.dofs > 26:
        digits[:, 20:] = digits[:, [7, 11, 15, 19]] * (2.0 / 3.0)
    return np.clip(digits, limits[:, 0], limits[:, 1])


def _offspring(
    hand: Hand, parents: _Genes, count: int, shrink: float, settings: SearchSettings, rng: np.random.Generator
) -> _Genes:
    """Children of random pairs: palm of one, each digit of either, all perturbed."""
    size = len(parents.scales)
    # the better a parent, the likelier it is chosen
    first = (size * rng.random(count) ** 1.7).astype(np.intp)
    second = (size * rng.random(count) ** 1.7).astype(np.intp)
    digits = parents.digits[first].copy()
    for columns in digit_columns(hand):
        swap = rng.random(count) < 0.25
        digits[np.ix_(swap, columns)] = parents.digits[np.ix_(second[swap], columns)]
    touched = rng.random(digits.shape) < 0.3
    digits += touched * rng.normal(scale=0.15 + 0.5 * shrink, size=digits.shape)
    turn = Rotation.from_rotvec(rng.normal(scale=0.03 + 0.4 * shrink, size=(count, 3)))
    turns = (turn * Rotation.from_quat(parents.turns[first])).as_quat()
    places = parents.places[first] + rng.normal(scale=0.002 + 0.015 * shrink, size=(count, 3))
    scales = parents.scales[first]
    if settings.scale_spread > 0:
        scales = scales * np.exp(rng.normal(scale=0.01 + 0.06 * shrink, size=count))
        low = settings.scale_mean * np.exp(-3 * settings.scale_spread)
        scales = np.clip(scales, low, settings.scale_mean**2 / low)
    return _Genes(places, turns, np.clip(digits, hand.limits[6:, 0], hand.limits[6:, 1]), scales)


def digit_columns(hand: Hand) -> list[list[int]]:
    """Columns of each digit among the digits' angles (the pose without its first six entries)."""
    columns = [[0, 1, 2, 3]] + [list(range(4 + 4 * f, 8 + 4 * f)) for f in range(4)]
    if hand.dofs > 26:
        for finger in range(4):
            columns[1 + finger].append(20 + finger)
    return columns
