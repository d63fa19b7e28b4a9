"""What fingers do, at random: synergies, gestures of straight and bent fingers, pinches, and all angles for themselves.

Angles are those of :mod:`spf.synthetic.postures`: 20 entries, radians.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from spf.hand.model import FINGERS, load_hand
from spf.synthetic.postures import CURLED, FIST, FLAT, GRASP, OPEN, POINT, RELAXED, count, touch

__all__ = ["draw_articulations"]

Array = NDArray[np.float64]

_ABDUCTION, _MP, _TWIST, _PIP = slice(4, 20, 4), slice(5, 20, 4), slice(6, 20, 4), slice(7, 20, 4)
_THUMBS = np.radians(  # beside the palm, stretched out, spread, across the palm, relaxed, opposed
    [
        *([0, 0, 0, 0], [-15, 20, 0, 0]),
        *([-37, -8, 4, 14], [-37, 6, 0, 10], [-34, -22, -5, -5]),
        *([-20, -25, 10, 5], [-5, -28, -10, -15], [15, -20, 0, 0]),
        *([32, 44, 48, 45], [15, 20, 15, 20], [45, 20, 18, 25], [35, 45, 15, 15]),
    ]
)
_FAN = np.array([1.0, 0.3, -0.5, -1.2])  # of index to little: how spreading turns them
_SHARES = (0.31, 0.27, 0.2, 0.22)
_PINCHES_A_FINGER = 40


def draw_articulations(rng: np.random.Generator, n: int) -> Array:
    """Draw articulated entries (n, 20) inside the joint limits, radians."""
    kind = rng.choice(4, size=n, p=_SHARES)
    drawn = np.empty((n, 20))
    for which, draw in enumerate((_synergies, _gestures, _pinches, _independent)):
        chosen = np.flatnonzero(kind == which)
        drawn[chosen] = draw(rng, len(chosen))
    spread = np.radians(rng.normal(5.0, 10.0, (n, 1)))
    straight = np.clip(1.0 - drawn[:, _MP] / np.radians(90.0), 0.15, 1.0)
    drawn[:, _ABDUCTION] += (kind != 2)[:, None] * straight * (spread * _FAN + np.radians(rng.normal(0.0, 5.0, (n, 4))))
    drawn[:, _TWIST] = np.radians(rng.normal(0.0, 1.0, (n, 4)))
    limits = load_hand("right").limits[6:26]
    return np.clip(drawn, limits[:, 0], limits[:, 1])


def _synergies(rng: np.random.Generator, n: int) -> Array:
    """Part of the way from one posture to another, every digit a little ahead or behind."""
    bank = np.array([OPEN, FLAT, RELAXED, CURLED, FIST, POINT, GRASP, OPEN, RELAXED, *(count(k) for k in range(6))])
    start, end = bank[rng.integers(len(bank), size=n)], bank[rng.integers(len(bank), size=n)]
    phase = rng.uniform(-0.1, 1.1, (n, 1)) + rng.normal(0.0, 0.15, (n, 5))
    blend = start + np.repeat(phase, 4, axis=1) * (end - start)
    blend += np.radians(rng.normal(0.0, 6.0, (n, 20)))
    free = np.flatnonzero(rng.random(n) < 0.5)  # thumbs that do something else than the fingers
    blend[free, :4] = _thumbs(rng, len(free))
    return blend


def _gestures(rng: np.random.Generator, n: int) -> Array:
    """Every finger straight, bent or between."""
    drawn = np.zeros((n, 20))
    state = rng.choice(3, size=(n, 4), p=(0.47, 0.4, 0.13))
    alike = rng.random(n) < 0.35  # all straight, or a fist, whatever the thumb does
    state[alike] = rng.random((int(alike.sum()), 1)) < 0.55
    mp = np.where(state == 0, rng.normal(3.0, 9.0, (n, 4)), rng.normal(74.0, 16.0, (n, 4)))
    pip = np.where(state == 0, np.abs(rng.normal(3.0, 8.0, (n, 4))), rng.normal(95.0, 14.0, (n, 4)))
    drawn[:, _MP] = np.radians(np.where(state == 2, rng.uniform(0.0, 85.0, (n, 4)), mp))
    drawn[:, _PIP] = np.radians(np.where(state == 2, rng.uniform(0.0, 105.0, (n, 4)), pip))
    drawn[:, :4] = _thumbs(rng, n)
    return drawn


def _thumbs(rng: np.random.Generator, n: int) -> Array:
    start, end = _THUMBS[rng.integers(len(_THUMBS), size=n)], _THUMBS[rng.integers(len(_THUMBS), size=n)]
    return np.asarray(start + rng.uniform(0.0, 1.0, (n, 1)) * (end - start) + np.radians(rng.normal(0.0, 9.0, (n, 4))))


@lru_cache(maxsize=1)
def _pinch_bank() -> Array:
    """Thumb and one finger touching, the others anyhow: (4 · _PINCHES_A_FINGER, 20)."""
    hand, rng = load_hand("right"), np.random.default_rng(0)
    others = [_gestures(rng, _PINCHES_A_FINGER) for _ in FINGERS[1:]]
    return np.array(
        [touch(hand, finger, hand_of) for finger, group in zip(FINGERS[1:], others, strict=True) for hand_of in group]
    )


def _pinches(rng: np.random.Generator, n: int) -> Array:
    bank = _pinch_bank()
    return np.asarray(bank[rng.integers(len(bank), size=n)] + np.radians(rng.normal(0.0, 4.0, (n, 20))))


def _independent(rng: np.random.Generator, n: int) -> Array:
    """All angles for themselves, over the widest that hands do."""
    low = np.radians([-40, -35, -25, -30, *([-15, -18, 0, -8] * 4)])
    high = np.radians([60, 60, 65, 80, *([15, 90, 0, 108] * 4)])
    return np.asarray(rng.uniform(low, high, (n, 20)))
