"""The motions, by name: each a script of key postures with palm turns, as a person would move.

A script is written for a right hand held up with its palm towards the sensor, fingers up. Palm turns are, in degrees,
yaw (pronation, about the forearm), pitch (nodding, fingers towards the sensor) and roll (waving, in the image plane).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from spf.hand.model import FINGERS, Hand
from spf.synthetic.postures import CURLED, FIST, FLAT, GRASP, OPEN, POINT, RELAXED, count, touch

__all__ = ["MOTIONS", "Key", "Motion"]

Array = NDArray[np.float64]
Keys = Iterator["Key"]

_ARTICULATED = slice(6, 26)
_STILL = (0.0, 0.0, 0.0)


class Key(NamedTuple):
    """A posture that a motion goes through.

    Attributes:
        articulation: (20,) articulated entries of the pose, radians.
        turn: yaw, pitch and roll of the palm, degrees.
        shift: m that the palm has moved, camera frame.
        seconds: time that the move to this key takes at the script's own pace.
        dwell: seconds that the posture is held.
        thumb_delay: fraction of the move by which the thumb starts after the fingers (it closes over them last and
            opens first, when negative).
    """

    articulation: Array
    turn: tuple[float, float, float] = _STILL
    shift: tuple[float, float, float] = _STILL
    seconds: float = 0.6
    dwell: float = 0.08
    thumb_delay: float = 0.0


class Motion(NamedTuple):
    """A row of the table of motions.

    Attributes:
        script: yields keys without end, varied by the generator that it is given; the first is where the hand starts.
        pivot: m from the palm's centre down the forearm to the point that palm turns leave in place.
        meaning: one line.
    """

    script: Callable[[Hand, np.random.Generator], Keys]
    pivot: float
    meaning: str


def _towards(posture: Array, amount: float) -> Array:
    return OPEN + amount * (posture - OPEN)


def _jitter(rng: np.random.Generator, spread: float) -> tuple[float, float, float]:
    yaw, pitch, roll = rng.normal(0.0, spread, 3)
    return (float(yaw), float(pitch), float(roll))


def _open_close(hand: Hand, rng: np.random.Generator) -> Keys:
    while True:
        yield Key(OPEN, _jitter(rng, 6.0), seconds=0.6, thumb_delay=-0.3)
        closed = _towards(FIST if rng.random() < 0.6 else CURLED, rng.uniform(0.85, 1.0))
        yield Key(closed, _jitter(rng, 6.0), seconds=0.65, thumb_delay=0.3)


def _count(hand: Hand, rng: np.random.Generator) -> Keys:
    while True:
        yield Key(FIST, _jitter(rng, 4.0), seconds=0.5, dwell=0.15, thumb_delay=0.3)
        for number in (1, 2, 3, 4, 5):
            yield Key(count(number), _jitter(rng, 4.0), seconds=0.4, dwell=0.2)


def _pinch(hand: Hand, rng: np.random.Generator) -> Keys:
    resting = _towards(RELAXED, rng.uniform(0.4, 0.7))
    touches = [touch(hand, finger, resting) for finger in FINGERS[1:]]
    while True:
        for touching in touches:
            yield Key(resting, _jitter(rng, 5.0), seconds=0.4, dwell=0.05)
            yield Key(touching, _jitter(rng, 5.0), seconds=0.45, dwell=0.1)


def _point(hand: Hand, rng: np.random.Generator) -> Keys:
    while True:
        yield Key(_towards(RELAXED, 0.7), _jitter(rng, 6.0), seconds=0.5, thumb_delay=-0.2)
        yield Key(POINT, _jitter(rng, 6.0), seconds=0.5, dwell=0.2, thumb_delay=0.25)
        for _ in range(3):
            yaw, pitch, roll = rng.uniform(-1.0, 1.0, 3) * (25.0, 30.0, 25.0)
            x, y, z = rng.uniform(-1.0, 1.0, 3) * (0.05, 0.03, 0.03)
            yield Key(POINT, (yaw, pitch, roll), (x, y, z), seconds=0.5, dwell=0.15)


def _opposition(hand: Hand, rng: np.random.Generator) -> Keys:
    resting = _towards(RELAXED, rng.uniform(0.2, 0.5))
    touches = [touch(hand, finger, resting) for finger in FINGERS[1:]]
    while True:
        yield Key(OPEN, _jitter(rng, 4.0), seconds=0.4)
        for touching in touches if rng.random() < 0.5 else touches[::-1]:  # without going back to rest
            yield Key(touching, _jitter(rng, 4.0), seconds=0.4, dwell=0.12)
        yield Key(FLAT, _jitter(rng, 4.0), seconds=0.6, dwell=0.1)


def _turn_and_bend(hand: Hand, rng: np.random.Generator) -> Keys:
    sense = 1.0 if rng.random() < 0.5 else -1.0
    while True:
        for yaw, amount in ((0.0, 0.1), (55.0, 0.9), (0.0, 0.3), (-60.0, 0.85)):
            turn = (sense * yaw + float(rng.normal(0, 8)), float(rng.normal(0, 10)), float(rng.normal(0, 8)))
            yield Key(_towards(CURLED, amount * rng.uniform(0.85, 1.1)), turn, seconds=0.8)


def _wave(hand: Hand, rng: np.random.Generator) -> Keys:
    side = 1.0
    while True:
        turn = (side * 10.0 + float(rng.normal(0, 4)), float(rng.normal(0, 5)), side * rng.uniform(22.0, 32.0))
        yield Key(_towards(RELAXED, rng.uniform(0.0, 0.9)), turn, seconds=0.4, dwell=0.0)
        side = -side


def _grasp(hand: Hand, rng: np.random.Generator) -> Keys:
    wide = hand.constrain(np.concatenate([np.zeros(6), 1.15 * GRASP - 0.3 * CURLED]))[_ARTICULATED]
    while True:
        yield Key(OPEN, _jitter(rng, 6.0), seconds=0.6)
        reach = (float(rng.uniform(-0.05, 0.05)), float(rng.uniform(-0.03, 0.03)), float(rng.uniform(-0.05, 0.0)))
        yield Key(wide, (float(rng.uniform(-30, 10)), 10.0, 0.0), reach, seconds=0.7)
        yield Key(GRASP, (float(rng.uniform(-30, 10)), 12.0, 0.0), reach, seconds=0.5, dwell=0.25)
        yield Key(GRASP, (float(rng.uniform(-35, 35)), float(rng.uniform(-15, 15)), 15.0), seconds=0.8)


def _random(hand: Hand, rng: np.random.Generator) -> Keys:
    """Independent curls and spreads of the fingers, the thumb anywhere in front of the palm."""
    low, high = hand.limits[_ARTICULATED].T
    while True:
        curl = rng.beta(0.7, 0.7, size=4)
        articulation = rng.uniform(0.15, 0.85, 20) * (high - low) + low
        for finger in range(4):
            mp, pip = 4 + 4 * finger + 1, 4 + 4 * finger + 3
            articulation[mp] = np.radians(85.0) * np.clip(curl[finger] + rng.normal(0, 0.12), 0.0, 1.0)
            articulation[pip] = np.radians(100.0) * np.clip(curl[finger] + rng.normal(0, 0.12), 0.0, 1.0)
            articulation[mp - 1] *= 0.5 * (1.0 - curl[finger])  # bent fingers hardly spread
        x, y, z = rng.normal(0, 0.02, 3)
        yield Key(articulation, _jitter(rng, 20.0), (x, y, z), seconds=0.6)


#: All motions by name.
MOTIONS: dict[str, Motion] = {
    "open_close": Motion(_open_close, 0.07, "the hand opens and closes to a fist or a curl"),
    "count": Motion(_count, 0.07, "counting from one to five fingers"),
    "pinch": Motion(_pinch, 0.07, "the thumb pinches each finger in turn"),
    "point": Motion(_point, 0.10, "the index finger points here and there"),
    "opposition": Motion(_opposition, 0.07, "the thumb goes from fingertip to fingertip"),
    "turn_and_bend": Motion(_turn_and_bend, 0.05, "the palm turns while the fingers bend (the paper's Fig. 12)"),
    "wave": Motion(_wave, 0.18, "the hand waves from the forearm"),
    "grasp": Motion(_grasp, 0.08, "the hand reaches, grasps, turns and lets go"),
    "random": Motion(_random, 0.07, "smooth moves between random postures"),
}
