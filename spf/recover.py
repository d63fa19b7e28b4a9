"""Find a lost hand of known shape again: near where it was lost first, then anywhere in the frame."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from spf.frame import Frame
from spf.hand.kinematics import joints_of, rotation_about
from spf.hand.model import Hand, load_hand
from spf.learned.network import Network
from spf.locate import FAMILIAR, Seeds, around, locate, polished, reach_of, seen_at, strangeness_to, suggested
from spf.observation import Observation, observe
from spf.search import SearchSettings
from spf.segmentation import find_regions

__all__ = ["glance", "recover", "unlikely"]

Array = NDArray[np.float64]
_FORGOTTEN = 30.0  # frames after which how a lost hand was held counts half
_SEARCHED = 16  # lost frames, at least one of which is searched
_REGIONS = 2  # of the frame, the nearest, that are looked at
_SEEN = 0.3  # presence of a hand, in the network's eyes, from which it is looked for in a place
_JUMP, _TURN = 0.1, 0.2  # golden energy that a jump as far as can be, and a turn by 180°, weigh against a pose …
_BENT = 0.1  # … and digits that are bent otherwise by a radian on the average


def recover(
    frame: Frame,
    hand: Hand,
    limit: float,
    better: float,
    last: Array,
    within: float,
    missing: int,
    network: Network | None,
    rng: np.random.Generator,
) -> Array | None:
    """Look for a lost hand of known shape in a frame.

    Args:
        frame: the depth image.
        hand: the calibrated hand.
        limit: golden energy under which a pose is believed; one that is held otherwise than it was needs a lower one.
        better: the same of a pose that is what the network sees there, for which it is enough to be better than the last.
        last: (D,) the pose that it was lost in, relative to the camera's axes.
        within: m that its palm can have moved since.
        missing: frames since it was lost: the longer, the less counts how it was held. A search takes many frames' time: the
            first frame is searched, the second, the fourth, …, and in the others only what the network sees is fitted.
        network: says where in the frame hands are; without it, all that is there is searched, which takes longer.
        rng: randomness.

    Returns:
        Its pose (D,) relative to the camera's axes, or None when nothing explains the depth well enough.
    """
    settings = SearchSettings(islands=10, kept=4, generations=25, scale_spread=0.0)
    remembered = 1.0 / (1.0 + missing / _FORGOTTEN)

    def believed(found: list[tuple[float, Array, float]]) -> Array | None:
        near = [(energy, pose) for _, pose, energy in found if np.linalg.norm(pose[:3] - last[:3]) < within]
        rated = []
        for energy, pose in near:
            charge = _strange(network, frame, hand, pose)
            believable = max(limit, better) if network is not None and charge < FAMILIAR else limit
            charged = energy + remembered * unlikely(pose, last, within) + charge
            if charged < believable:
                rated.append((charged, pose))
        return min(rated, key=lambda item: item[0])[1] if rated else None

    thorough = network is None or missing & (missing - 1) == 0 or missing % _SEARCHED == 0
    if thorough:
        near = observe(frame, last[:3], reach_of(hand))
        if not near.is_empty:
            pose = believed(locate(hand, near, near.hand_points, settings, rng, around(hand, last, rng)))
            if pose is not None:
                return pose
    for place in _places(network, frame, hand, last):
        if thorough:
            found = locate(hand, place.observation, place.points, settings, rng, place.seeds)
        else:
            assert place.seeds is not None
            found = polished(hand, place.observation, place.seeds.poses, rng)
        pose = believed(found)
        if pose is not None:
            return pose
    return None


def glance(
    frame: Frame, hand: Hand, last: Array, within: float, network: Network, rng: np.random.Generator
) -> tuple[float, Array] | None:
    """Look where the network sees a hand, without a search: for a tracker that may be on something else.

    Args:
        frame, hand, network, rng: as of :func:`recover`.
        last: (D,) where the hand was, relative to the camera's axes.
        within: m that its palm can be away from there.

    Returns:
        (golden energy with what strangeness, a jump and a turn are charged, pose (D,) relative to the camera's axes) of the
        best, or None when there is none.
    """
    best: tuple[float, Array] | None = None
    for place in _places(network, frame, hand, last):
        assert place.seeds is not None
        for _, pose, energy in polished(hand, place.observation, place.seeds.poses, rng):
            if np.linalg.norm(pose[:3] - last[:3]) > within:
                continue
            charged = energy + unlikely(pose, last, within) + _strange(network, frame, hand, pose)
            if best is None or charged < best[0]:
                best = charged, pose
    return best


def unlikely(pose: Array, last: Array, within: float) -> float:
    """What a pose is charged for being elsewhere, and held otherwise, than the last one (D,); both by the camera's axes."""
    turn = Rotation.from_matrix(rotation_about(pose[3:6]) @ rotation_about(last[3:6]).T).magnitude()
    bent = np.abs(pose[6:] - last[6:]).mean()
    return float(_JUMP * np.linalg.norm(pose[:3] - last[:3]) / within + _TURN * turn / np.pi + _BENT * bent)


def _strange(network: Network | None, frame: Frame, hand: Hand, pose: Array) -> float:
    """What a pose relative to the camera's axes is charged for not being what the network sees: a hand so held, of this side."""
    if network is None:
        return 0.0
    seen = seen_at(network, frame, hand, pose, np.eye(3), ("right", "left"))
    return strangeness_to([guess for guess in seen if guess.side == hand.side], hand, joints_of(hand, pose))


class _Place(NamedTuple):
    """Where a hand may be: what is seen around it, points of it, and where a search begins (None: anywhere)."""

    observation: Observation
    points: Array
    seeds: Seeds | None


def _places(network: Network | None, frame: Frame, hand: Hand, last: Array) -> Iterator[_Place]:
    """Go over the places where the network sees a hand, the nearest to the last one first; without it, over whole regions.

    What is seen is cut out around the place, as it is for the tracker: so golden energies compare with the tracker's.
    """
    regions = find_regions(frame)
    size = hand.length / load_hand(hand.side).length
    for region in regions[:_REGIONS]:
        if network is None:
            looked = observe(frame, region.centre, region.radius)
            if not looked.is_empty:
                yield _Place(looked, region.points, None)
            continue
        seen = [s for s in suggested(network, frame, region, (hand.side,), size)[hand.side] if s.presence > _SEEN]
        for seeds in sorted(seen, key=lambda seeds: float(np.linalg.norm(seeds.poses[0, :3] - last[:3]))):
            looked = observe(frame, seeds.poses[0, :3], reach_of(hand))
            if not looked.is_empty:
                yield _Place(looked, region.points, _with_memory(seeds, last))


def _with_memory(seeds: Seeds, last: Array) -> Seeds:
    """Seeds, and the same palms with the digits of the last pose: of what is hidden, only memory tells."""
    remembered = seeds.poses.copy()
    remembered[:, 6:] = last[6:]
    return Seeds(np.concatenate([seeds.poses, remembered]), np.tile(seeds.scales, 2), seeds.presence)
