"""The graph of a hand (Fig. 2): which bodies are joined, and which are kept apart."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from spf.hand.model import BONES, Hand
from spf.nbp.bodies import Bodies

__all__ = ["Apart", "Graph", "Joint", "graph_of"]

Array = NDArray[np.float64]
_SOFT = 0.8  # share of two bodies' radii that their middles are kept apart: skin is soft
_LEVELS, _DIGITS = 3, 5


class Joint(NamedTuple):
    """An edge of E_K, between a body and the one it hangs on.

    Attributes:
        parent, child: bodies.
        rest: (3, 4) the child's frame in its parent's in the bind pose.
        axes: (R,) 0-2, the axes that the child turns about, one after the other.
        gains: (R,) radians of each turn per radian of its entry of the pose.
        entries: (R,) those entries.
        limits: (R, 2) radians, of the entries.
    """

    parent: int
    child: int
    rest: Array
    axes: NDArray[np.intp]
    gains: Array
    entries: NDArray[np.intp]
    limits: Array


class Apart(NamedTuple):
    """An edge of E_S: two bodies whose middles stay ``distance`` m apart (2)."""

    one: int
    other: int
    distance: float


class Graph(NamedTuple):
    """The edges.

    Attributes:
        joints: E_K, parents first.
        apart: E_S.
        hiding: (B,) for each body the others that may hide it: all but those joined to it.
    """

    joints: tuple[Joint, ...]
    apart: tuple[Apart, ...]
    hiding: tuple[tuple[int, ...], ...]


def graph_of(hand: Hand, bodies: Bodies) -> Graph:
    """Return the edges of a hand: its joints, and the pairs of bodies of different digits that are most likely to meet.

    The last joint of a finger turns as the one before it does in the 26 degrees of freedom; here it is free, within the
    same limits, and both are asked for the angle when a pose is read.
    """
    skeleton = hand.skeleton
    joints = []
    for child in range(1, len(BONES)):
        own = np.flatnonzero(skeleton.revolute_bone == child)
        entries = skeleton.revolute_dof[own].astype(np.intp)
        axes, gains = skeleton.revolute_axis[own].astype(np.intp), skeleton.revolute_gain[own]
        parent = int(skeleton.parent[child])
        joints.append(Joint(parent, child, skeleton.rest[child], axes, gains, entries, hand.limits[entries]))
    apart = [Apart(one, other, _SOFT * float(bodies.radii[[one, other]].sum())) for one, other in _pairs()]
    return Graph(tuple(joints), tuple(apart), tuple(_hiding(joints, body) for body in range(len(BONES))))


def _hiding(joints: list[Joint], body: int) -> tuple[int, ...]:
    near = {end for joint in joints for end in (joint.parent, joint.child) if body in (joint.parent, joint.child)}
    return tuple(other for other in range(len(BONES)) if other not in near)


def _pairs() -> list[tuple[int, int]]:
    """Bodies of the same level of neighbouring fingers, and the thumb's last two with all phalanges of index and middle."""
    body = np.arange(1, len(BONES)).reshape(_DIGITS, _LEVELS)
    fingers = [(body[digit, level], body[digit + 1, level]) for digit in range(1, 4) for level in range(_LEVELS)]
    thumb = [(one, other) for one in body[0, 1:] for other in body[1:3].ravel()]
    return [(int(one), int(other)) for one, other in [*fingers, *thumb]]
