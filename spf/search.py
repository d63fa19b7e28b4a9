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
from spf.parallel import map_threads

__all__ = ["Hypotheses", "SearchSettings", "refine", "search", "size_penalty"]

Array = NDArray[np.float64]
_SIZE_WEIGHT = 0.02
_SPREAD = (0.3, 0.05, -0.2, -0.45)  # rad of abduction of index … little in a hand spread wide


class SearchSettings(NamedTuple):
    """Effort of a search.

    Attributes:
        islands: independent populations, searched in parallel: what one misses another finds.
        kept: how many of them, the best after some generations, are evolved to the end.
        population: hypotheses in an island's first generation.
        survivors: how many are kept from generation to generation.
        scouting, generations: generations of all islands, and then of those that are kept.
        scale_mean, scale_spread: prior of the hand's scale, mean and standard deviation of its logarithm; 0 fixes it.
    """

    islands: int = 24
    kept: int = 8
    population: int = 800
    survivors: int = 24
    scouting: int = 14
    generations: int = 45
    scale_mean: float = 1.0
    scale_spread: float = 0.25


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

    Returns:
        The survivors of all islands.
    """

    def scout(stream: np.random.Generator) -> tuple[_Genes, Array]:
        genes = _random_genes(problem.hand, places, settings, stream)
        return _evolve(problem, genes, settings, stream, (1.0, 0.5), settings.scouting)

    def settle(item: tuple[_Genes, np.random.Generator]) -> tuple[_Genes, Array]:
        genes, stream = item
        return _evolve(problem, genes, settings, stream, (0.5, 0.03), settings.generations)

    scouted = map_threads(scout, rng.spawn(settings.islands))
    scouted.sort(key=lambda island: float(island[1][0]))
    kept = [genes for genes, _ in scouted[: settings.kept]]
    return _merge(map_threads(settle, zip(kept, rng.spawn(len(kept)), strict=True)))


def refine(
    problem: Problem, poses: Array, scales: Array, settings: SearchSettings, rng: np.random.Generator
) -> Hypotheses:
    """Search on from poses (N, D) with scales (N,) that are nearly right: small perturbations, digits recombined."""
    genes = _Genes(poses[:, :3], Rotation.from_euler("XYZ", poses[:, 3:6]).as_quat(), poses[:, 6:], scales)

    def island(stream: np.random.Generator) -> tuple[_Genes, Array]:
        return _evolve(problem, genes, settings, stream, (0.35, 0.03), settings.scouting)

    return _merge(map_threads(island, rng.spawn(2)))


def _evolve(
    problem: Problem,
    genes: _Genes,
    settings: SearchSettings,
    rng: np.random.Generator,
    spread: tuple[float, float],
    generations: int,
) -> tuple[_Genes, Array]:
    """Evolve a population, perturbations shrinking between two sizes; returns the survivors, best first."""
    energies = _judge(problem, genes, settings)
    for generation in range(generations):
        best = np.argsort(energies)[: settings.survivors]
        parents, parent_energies = _take(genes, best), energies[best]
        shrink = spread[0] * (spread[1] / spread[0]) ** (generation / generations)
        children = _offspring(problem.hand, parents, 4 * settings.survivors, shrink, settings, rng)
        genes = _Genes(*(np.concatenate(pair) for pair in zip(parents, children, strict=True)))
        energies = np.concatenate([parent_energies, _judge(problem, children, settings)])
    best = np.argsort(energies)[: settings.survivors]
    return _take(genes, best), energies[best]


def _merge(islands: list[tuple[_Genes, Array]]) -> Hypotheses:
    energies = np.concatenate([energy for _, energy in islands])
    genes = _Genes(*(np.concatenate(parts) for parts in zip(*(genes for genes, _ in islands), strict=True)))
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
        energies = energies + size_penalty(genes.scales, settings)
    return energies


def size_penalty(scale: Array | float, settings: SearchSettings) -> Array | float:
    """What an unusual size of the hand adds to the golden energy."""
    return _SIZE_WEIGHT * (np.log(scale / settings.scale_mean) / settings.scale_spread) ** 2


def _random_genes(hand: Hand, places: Array, settings: SearchSettings, rng: np.random.Generator) -> _Genes:
    count = settings.population
    at = places[rng.integers(len(places), size=count)] + np.array([0.0, 0.0, 0.015])
    turns = rng.normal(size=(count, 4))
    turns /= np.linalg.norm(turns, axis=1, keepdims=True)
    scales = settings.scale_mean * np.exp(settings.scale_spread * rng.normal(size=count))
    return _Genes(at + rng.normal(scale=0.015, size=at.shape), turns, random_digits(hand, count, rng), scales)


def random_digits(hand: Hand, count: int, rng: np.random.Generator) -> Array:
    """Draw plausible angles of the digits (count, D - 6): each finger somewhere between straight and curled."""
    limits = hand.limits[6:]
    digits = np.empty((count, hand.dofs - 6))
    spread = rng.uniform(-0.2, 1.2, size=count)
    digits[:, :4] = rng.uniform(0.7 * limits[:4, 0], 0.7 * limits[:4, 1], size=(count, 4))
    together = rng.beta(0.5, 0.5, size=(count, 1)) * (rng.random((count, 1)) < 0.6)  # an open hand is the likeliest
    for finger in range(4):
        own = rng.beta(0.4, 0.5, size=(count, 1))
        curl = np.where(rng.random((count, 1)) < 0.7, together, own)[:, 0]
        first = 4 + 4 * finger
        digits[:, first] = _SPREAD[finger] * spread + rng.normal(scale=0.06, size=count)
        digits[:, first + 1] = 1.3 * curl + rng.normal(scale=0.2, size=count)
        digits[:, first + 2] = 0.0
        digits[:, first + 3] = 1.6 * curl + rng.normal(scale=0.2, size=count)
    if hand.free_dip:
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
        rows = np.flatnonzero(swap)[:, None]
        digits[rows, columns] = parents.digits[second[rows], columns]
    # each child changes in some of its parts only: a change of all at once is seldom for the better
    fan = np.where(rng.random(count) < 0.15, rng.normal(scale=0.3, size=count), 0.0)
    for finger in range(4):
        digits[:, 4 + 4 * finger] += _SPREAD[finger] * fan
    for columns in digit_columns(hand):
        rows = np.flatnonzero(rng.random(count) < 0.3)[:, None]
        digits[rows, columns] += rng.normal(scale=0.08 + 0.5 * shrink, size=(len(rows), len(columns)))
    turns = _shift_fingers(hand, digits, parents.turns[first], rng)
    turned = rng.random((count, 1)) < 0.5
    turn = Rotation.from_rotvec(turned * rng.normal(scale=0.03 + 0.4 * shrink, size=(count, 3)))
    turns = (turn * Rotation.from_quat(turns)).as_quat()
    moved = rng.random((count, 1)) < 0.5
    places = parents.places[first] + moved * rng.normal(scale=0.002 + 0.015 * shrink, size=(count, 3))
    scales = parents.scales[first]
    if settings.scale_spread > 0:
        resized = rng.random(count) < 0.4
        scales = scales * np.exp(resized * rng.normal(scale=0.01 + 0.06 * shrink, size=count))
        low = settings.scale_mean * np.exp(-2.5 * settings.scale_spread)
        scales = np.clip(scales, low, settings.scale_mean**2 / low)
    return _Genes(places, turns, np.clip(digits, hand.limits[6:, 0], hand.limits[6:, 1]), scales)


def _shift_fingers(hand: Hand, digits: Array, turns: Array, rng: np.random.Generator) -> Array:
    """Move the fingers of some hypotheses to their neighbours' places, and turn the palm to match; returns the turns.

    The way out of the commonest minimum, fingers fitted to their neighbours.
    """
    chosen = np.flatnonzero(rng.random(len(digits)) < 0.1)
    fingers = digits[:, 4:20].reshape(-1, 4, 4)
    direction = rng.choice([-1, 1], size=len(chosen))
    source = np.clip(np.arange(4) + direction[:, None], 0, 3)
    fingers[chosen] = fingers[chosen[:, None], source]
    digits[:, 4:20] = fingers.reshape(-1, 16)
    mirror = 1.0 if hand.side == "right" else -1.0
    about_normal = np.zeros((len(chosen), 3))
    about_normal[:, 1] = mirror * direction * rng.uniform(0.15, 0.35, size=len(chosen))
    turns = turns.copy()
    turns[chosen] = (Rotation.from_quat(turns[chosen]) * Rotation.from_rotvec(about_normal)).as_quat()
    return turns


def digit_columns(hand: Hand) -> list[list[int]]:
    """Columns of each digit among the digits' angles (the pose without its first six entries)."""
    columns = [[0, 1, 2, 3]] + [list(range(4 + 4 * f, 8 + 4 * f)) for f in range(4)]
    if hand.free_dip:
        for finger in range(4):
            columns[1 + finger].append(20 + finger)
    return columns
