"""Find a lost hand of known shape again: near where it was lost first, then anywhere in the frame."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from spf.frame import Frame
from spf.hand.kinematics import rotation_about
from spf.hand.model import Hand, load_hand
from spf.learned.network import Network
from spf.locate import Seeds, around, locate, reach_of, strangeness, suggested
from spf.observation import observe
from spf.search import SearchSettings
from spf.segmentation import Region, find_plane, find_regions

__all__ = ["recover"]

Array = NDArray[np.float64]
_FORGOTTEN = 30.0  # frames after which how a lost hand was held counts half
_SEEN = 0.3  # presence of a hand, in the network's eyes, from which it is looked for in a place
_JUMP, _TURN = 0.1, 0.2  # golden energy that a jump as far as can be, and a turn by 180°, weigh against a pose


def recover(
    frame: Frame,
    hand: Hand,
    limit: float,
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
        last: (D,) the pose that it was lost in, relative to the camera's axes.
        within: m that its palm can have moved since.
        missing: frames since it was lost: the longer, the less counts how it was held.
        network: says where in the frame hands are; without it, all that is there is searched, which takes longer.
        rng: randomness.

    Returns:
        Its pose (D,) relative to the camera's axes, or None when nothing explains the depth well enough.
    """
    settings = SearchSettings(islands=10, kept=4, generations=25, scale_spread=0.0)
    remembered = 1.0 / (1.0 + missing / _FORGOTTEN)

    def unlikely(pose: Array) -> float:
        turn = Rotation.from_matrix(rotation_about(pose[3:6]) @ rotation_about(last[3:6]).T).magnitude()
        return float(_JUMP * np.linalg.norm(pose[:3] - last[:3]) / within + _TURN * turn / np.pi) * remembered

    def believed(found: list[tuple[float, Array, float]]) -> Array | None:
        near = [(energy, pose) for _, pose, energy in found if np.linalg.norm(pose[:3] - last[:3]) < within]
        rated = [
            (energy + unlikely(pose) + strangeness(network, frame, hand, pose, np.eye(3)), pose)
            for energy, pose in near
        ]
        best = min(rated, key=lambda item: item[0], default=None)
        return best[1] if best is not None and best[0] < limit else None

    near = observe(frame, last[:3], reach_of(hand))
    if not near.is_empty:
        pose = believed(locate(hand, near, near.hand_points, settings, rng, around(hand, last, rng)))
        if pose is not None:
            return pose
    plane = find_plane(frame, rng)
    for region in find_regions(frame, plane)[:2]:
        observation = observe(frame, region.centre, region.radius, plane=plane)
        if observation.is_empty:
            continue
        for seeds in _places(network, frame, region, hand, last):
            pose = believed(locate(hand, observation, region.points, settings, rng, seeds))
            if pose is not None:
                return pose
    return None


def _places(network: Network | None, frame: Frame, region: Region, hand: Hand, last: Array) -> Sequence[Seeds | None]:
    """Where in a region to begin: places where the network sees a hand, the nearest first, or anywhere without it."""
    if network is None:
        return [None]
    size = hand.length / load_hand(hand.side).length
    places = suggested(network, frame, region, (hand.side,), size)[hand.side]
    seen = [seeds for seeds in places if seeds.presence > _SEEN]
    return sorted(seen, key=lambda seeds: float(np.linalg.norm(seeds.poses[0, :3] - last[:3])))
