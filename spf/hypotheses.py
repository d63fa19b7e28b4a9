"""Hypotheses of hands in one frame, of either side and any size: what the first pose is chosen from."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from spf.frame import Frame
from spf.hand.kinematics import joints_of
from spf.hand.model import Hand, Side, load_hand
from spf.hand.shape import HandShape
from spf.learned.network import Network
from spf.locate import Seeds, locate, reach_of, strangeness, suggested, unfamiliarity
from spf.observation import Observation, observe
from spf.search import SearchSettings
from spf.segmentation import Region, find_regions

__all__ = ["Hypothesis", "hypotheses_of"]

Array = NDArray[np.float64]
_SUGGESTION_ENOUGH = 0.35  # energy under which the network's suggestions need no search beside them
_GOOD_PLACE = 0.4  # energy under which no farther place is looked at
_PER_SIDE = 4
_SEEN, _UNSEEN = 0.5, 0.2  # presence of a hand in a region, over which regions under the other are left out
_APART = 0.025  # m of mean joint distance between two hypotheses worth following


class Hypothesis(NamedTuple):
    """A hand that may be in a frame.

    Attributes:
        shape: its side and size.
        pose: (D,) relative to the camera's axes.
        energy: golden energy, and what it is charged for being strange to the network.
        unfamiliar: what it is charged for where it is: less of a hand, to the network, than another place of the frame.
    """

    shape: HandShape
    pose: Array
    energy: float
    unfamiliar: float = 0.0

    @property
    def charged(self) -> float:
        """Energy with every charge."""
        return self.energy + self.unfamiliar


def hypotheses_of(
    frame: Frame,
    sides: Sequence[Side],
    shape: HandShape | None,
    network: Network | None,
    rng: np.random.Generator,
    *,
    thorough: bool,
) -> list[Hypothesis]:
    """Return the best different hypotheses of each side, over the places where a hand may be.

    Args:
        frame: the depth image.
        sides: which hands to look for.
        shape: of the hand when it is known.
        network: its suggestions are polished; without it only a thorough look finds anything.
        rng: randomness.
        thorough: whether to search whole regions besides, where no suggestion convinces.
    """
    regions = find_regions(frame)
    size = None if shape is None else shape.hand().length / load_hand(shape.side).length
    looks = [] if network is None else [suggested(network, frame, region, sides, size) for region in regions]
    regions, looks = _promising(regions, looks)
    result: list[Hypothesis] = []
    for side in sides:
        hand = shape.hand() if shape else load_hand(side)
        settings = SearchSettings(scale_spread=0.0) if shape else SearchSettings()
        found: list[Hypothesis] = []
        for number, region in enumerate(regions):
            for seeds in [*(looks[number][side] if looks else []), *([None] if thorough else [])]:
                if seeds is None and _least(found) < _SUGGESTION_ENOUGH:
                    break
                observation = _around(frame, hand, region, seeds)
                if observation.is_empty:
                    continue
                for scale, pose, energy in locate(hand, observation, region.points, settings, rng, seeds):
                    sized = shape or HandShape(side, scale=scale)
                    posed = sized.hand()
                    charge = strangeness(network, frame, posed, pose, np.eye(3))
                    unfamiliar = unfamiliarity(network, frame, posed, pose, told=len(sides) == 1)
                    found.append(Hypothesis(sized, pose, energy + charge, unfamiliar))
            if _least(found) < _GOOD_PLACE:
                break
        result += _different(sorted(found, key=lambda h: h.charged), _PER_SIDE)
    familiar = min((h.unfamiliar for h in result), default=0.0)
    result = [h._replace(unfamiliar=h.unfamiliar - familiar) for h in result]
    return [h for h in result if h.charged < 1.5 * _least(result) + 0.05]


def _least(hypotheses: list[Hypothesis]) -> float:
    return min((h.charged for h in hypotheses), default=1.0)


def _around(frame: Frame, hand: Hand, region: Region, seeds: Seeds | None) -> Observation:
    """Observe what a hand at the first of some seeds would reach, or a whole region.

    An arm is no worse a hand for the hand at its other end, which a hypothesis of it leaves uncovered, nor a hand for its arm.
    """
    if seeds is None:
        return observe(frame, region.centre, region.radius)
    return observe(frame, seeds.poses[0, :3], reach_of(hand.scaled(float(seeds.scales[0]))))


def _promising(
    regions: list[Region], looks: list[dict[Side, list[Seeds]]]
) -> tuple[list[Region], list[dict[Side, list[Seeds]]]]:
    """Keep two regions, those in which the network sees a hand first; where it does, leave out those in which it sees none."""
    if not looks:
        return regions[:2], looks
    presence = [max(seeds.presence for places in look.values() for seeds in places) for look in looks]
    order = sorted(range(len(regions)), key=lambda number: presence[number] < _SEEN)[:2]
    if max(presence) > _SEEN:
        order = [number for number in order if presence[number] > _UNSEEN]
    return [regions[number] for number in order], [looks[number] for number in order]


def _different(hypotheses: list[Hypothesis], most: int) -> list[Hypothesis]:
    kept: list[Hypothesis] = []
    places: list[Array] = []
    for hypothesis in hypotheses:
        joints = joints_of(load_hand(hypothesis.shape.side).scaled(hypothesis.shape.scale), hypothesis.pose)
        if all(np.linalg.norm(joints - other, axis=1).mean() > _APART for other in places):
            kept.append(hypothesis)
            places.append(joints)
        if len(kept) == most:
            break
    return kept
