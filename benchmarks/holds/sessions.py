"""The sessions that trackers are held against: synthetic ones by kind and number, and recordings.

Kind and number alone say what a session shows: the same number is the same session, whatever is asked for beside it, so that
numbers can be kept apart: those that something was chosen by, and those that it is then judged by.
"""

from __future__ import annotations

import itertools
import zlib
from pathlib import Path
from typing import NamedTuple, TypeVar

import numpy as np

from spf.sessions import Session, open_session
from spf.synthetic import MOTIONS, SyntheticSettings, synthesise
from spf.synthetic import SENSORS as ALL_SENSORS

__all__ = ["KINDS", "SENSORS", "SHAPES", "Kind", "Source", "open_source", "recordings", "session_settings", "synthetic"]

T = TypeVar("T")

SENSORS = ("kinect2", "senz3d", "realsense")
SHAPES = ("small", "large", "long_fingers", "thick", "slim")


class Kind(NamedTuple):
    """A kind of synthetic session.

    Attributes:
        speed_mm: mean motion of the joints, mm a frame.
        meaning: one line.
        yaw: rad, the palm turned away from the sensor.
        clutter: what else is in the scene.
        away: whether the hand leaves in the middle and comes back.
        turned: whether the palm is turned anyhow, and tipped and rolled far more than a hand held up is.
        every: whether the numbers go through all pairs of a motion and one of all sensors.
        told: whether the start is told the side, because nothing else says which of two hands is meant.
    """

    speed_mm: float
    meaning: str
    yaw: float = 0.0
    clutter: str = "forearm"
    away: bool = False
    turned: bool = False
    every: bool = False
    told: bool = False


KINDS: dict[str, Kind] = {
    "slow": Kind(4.0, "hand and forearm, 4 mm of joint motion a frame"),
    "medium": Kind(9.0, "hand and forearm, 9 mm a frame"),
    "fast": Kind(16.0, "hand and forearm, 16 mm a frame"),
    "back": Kind(9.0, "the back of the hand towards the sensor", yaw=np.pi),
    "any_view": Kind(9.0, "the hand turned anyhow", turned=True),
    "body": Kind(9.0, "a person behind the hand", clutter="body"),
    "table": Kind(9.0, "over a table, seen from above", clutter="table"),
    "face": Kind(9.0, "a face beside and behind the hand", clutter="face"),
    "second_hand": Kind(9.0, "another hand beside it", clutter="second_hand", told=True),
    "away": Kind(9.0, "the hand leaves the view and comes back", away=True),
    "every": Kind(9.0, "every motion with every sensor, 45 in a row", every=True),
}


class Source(NamedTuple):
    """A session to track, small enough to be sent to another process.

    Attributes:
        kind: row of the table: a kind of synthetic session, or a recording's name.
        number: of the synthetic session; -1 for a recording.
        seed: of the tracker.
        frames: to track, at most.
        path, camera: of a recording; "" and None for a synthetic session.
    """

    kind: str
    number: int
    seed: int
    frames: int
    path: str = ""
    camera: str | None = None

    @property
    def synthetic(self) -> bool:
        """Whether the session is made, not read."""
        return not self.path


def synthetic(kind: str, first: int, count: int, frames: int) -> list[Source]:
    """Return ``count`` sessions of a kind, of the numbers from ``first`` on."""
    return [Source(kind, number, number, frames) for number in range(first, first + count)]


def recordings(path: str, seeds: int, frames: int) -> list[Source]:
    """Return a recording, ``FOLDER`` or ``FOLDER,CAMERA.json``, once for every seed."""
    folder, _, camera = path.partition(",")
    name = Path(folder).resolve().name
    return [Source(name, -1, seed, frames, folder, camera or None) for seed in range(seeds)]


def session_settings(kind: str, number: int, frames: int) -> SyntheticSettings:
    """Say what session ``number`` of a kind shows.

    Nine in a row go through all motions, and fifteen through all pairs of sensor and shape, in an order drawn for them.
    """
    chosen, tag = KINDS[kind], zlib.crc32(kind.encode())
    motion = _dealt(list(MOTIONS), number, tag, 0)
    sensor, shape = _dealt(list(itertools.product(SENSORS, SHAPES)), number, tag, 1)
    if chosen.every:
        motion, sensor = list(itertools.product(MOTIONS, ALL_SENSORS))[number % (len(MOTIONS) * len(ALL_SENSORS))]
    rng = np.random.default_rng([tag, 2, number])
    settings = SyntheticSettings(
        motion=motion, sensor=sensor, shape=shape, clutter=chosen.clutter, frames=frames, speed_mm=chosen.speed_mm,
        yaw=chosen.yaw, side=str(rng.choice(["right", "left"])), seed=int(rng.integers(2**31)),
    )  # fmt: skip
    if chosen.turned:
        yaw, pitch, roll = rng.uniform(-1.0, 1.0, 3) * (np.pi, 0.7, 1.0)
        settings = settings.replace(yaw=float(yaw), pitch=float(pitch), roll=float(roll))
    if not chosen.away:
        return settings
    return settings.replace(absent_from=frames // 2, absent_frames=max(5, frames // 8))


def _dealt(cards: list[T], number: int, *tag: int) -> T:
    """Deal cards without end, every full hand of them in an order of its own."""
    block, place = divmod(number, len(cards))
    return cards[np.random.default_rng([*tag, block]).permutation(len(cards))[place]]


def open_source(source: Source) -> Session:
    """Make or open a session.

    Raises:
        SessionError: a recording cannot be read.
    """
    if source.synthetic:
        return synthesise(session_settings(source.kind, source.number, source.frames))
    return open_session(source.path, source.camera)
