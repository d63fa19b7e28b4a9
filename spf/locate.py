"""Find hands in one frame: a search by rendering, polished by SMD. What the first pose and the recovery stand on."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from spf.cost.problem import Problem, golden, make_problem
from spf.cost.spheres import scaled_spheres
from spf.filters import smart
from spf.filters.proposals import curl_digits
from spf.frame import Frame
from spf.hand.kinematics import angles_of, joints_of, rotation_about
from spf.hand.model import Hand, Side, load_hand
from spf.learned.guesses import Guess, believability, extent_of, guesses, search_hand
from spf.learned.network import Network
from spf.observation import Observation
from spf.optimisers.smd import optimise
from spf.parallel import map_threads
from spf.search import Hypotheses, SearchSettings, random_digits, refine, search
from spf.segmentation import Region

__all__ = [
    "FAMILIAR",
    "Seeds",
    "around",
    "locate",
    "polished",
    "reach_of",
    "seen_at",
    "strangeness",
    "strangeness_to",
    "suggested",
    "unfamiliarity",
]

Array = NDArray[np.float64]

#: Golden energy that a pose is charged at most for being strange which is just what the network sees.
FAMILIAR = 0.1

_POLISHED, _GLANCED = 10, 4  # hypotheses that SMD is run from, in a search and in a glance
_APART = 0.0125  # m of mean joint distance between two hypotheses worth following
_LOOKS, _AROUND = 7, 0.07  # places of a region that the network looks at, and m around each that it stands for
_PLACE, _PLACES = 0.08, 3  # m within which guesses are of one place, and the most places of a side
_STRANGE = 0.1  # golden energy of a nat per joint under the density …
_FAMILIAR = 8.0  # … of a hand that the network knows well
_ABSENT = 0.5  # golden energy of a place where the network sees no hand
_SURE = 12.0  # the same of a hand whose joints the network is sure of, wherever they are
_NEAR_SEEDS, _NEAR_MOVED, _NEAR_TURNED = 400, 0.03, 0.4  # poses tried around one, m and rad around it


class Seeds(NamedTuple):
    """Where a search begins.

    Attributes:
        poses: (N, D) relative to the camera's axes.
        scales: (N,) relative to the hand that is searched for.
        presence: 0-1, the most that the network believes of there being a hand; 1 when it was not asked.
    """

    poses: Array
    scales: Array
    presence: float = 1.0


def reach_of(hand: Hand) -> float:
    """Radius (m) around the palm's centre that holds the hand and some of the arm."""
    return 0.85 * hand.length + 0.02


def locate(
    hand: Hand,
    observation: Observation,
    places: Array,
    settings: SearchSettings,
    rng: np.random.Generator,
    seeds: Seeds | None = None,
) -> list[tuple[float, Array, float]]:
    """Search one observation: [(scale, pose (D,) relative to the camera's axes, golden energy)], best first.

    A search by rendering, over the whole observation or from seeds; its best polished by SMD at the size that the search
    gave each, a finer search from those, and SMD again.
    """
    cost = smart.SpfSettings()
    problem = make_problem(hand, observation, cost, np.eye(3), rng)
    found = search(problem, places, settings, rng) if seeds is None else refine(problem, *seeds[:2], settings, rng)
    polished = _polish(problem, cost, _spaced(hand, found, _POLISHED), rng)
    poses, scales = (np.array([item[part] for item in polished]) for part in (1, 0))
    found = refine(problem, poses, scales, settings, rng)
    return sorted(_polish(problem, cost, _spaced(hand, found, _POLISHED), rng), key=lambda item: item[2])


def polished(
    hand: Hand, observation: Observation, poses: Array, rng: np.random.Generator
) -> list[tuple[float, Array, float]]:
    """Run SMD from the best of some poses (N, D), bend the digits of what comes out, and run it again.

    The same as :func:`locate` gives, without any search. A hand is told from an arm by how well it can be fitted.
    """
    cost = smart.SpfSettings()
    problem = make_problem(hand, observation, cost, np.eye(3), rng)
    energies, _ = golden(problem, poses)
    order = np.argsort(energies)
    rough = _spaced(hand, Hypotheses(poses[order], np.ones(len(poses)), energies[order]), _GLANCED)
    first = _polish(problem, cost, rough, rng)
    bent = np.array([curl_digits(problem, pose, energy)[0] for _, pose, energy in first])
    second = Hypotheses(bent, rough.scales, np.array([energy for _, _, energy in first]))
    return sorted(_polish(problem, cost, second, rng), key=lambda item: item[2])


def _spaced(hand: Hand, found: Hypotheses, most: int) -> Hypotheses:
    """The best hypotheses that differ from each other."""
    kept: list[int] = []
    joints: list[Array] = []
    for index, pose in enumerate(found.poses):
        own = joints_of(hand, pose)
        if all(np.linalg.norm(own - other, axis=1).mean() > _APART for other in joints):
            kept.append(index)
            joints.append(own)
        if len(kept) == most:
            break
    return Hypotheses(*(part[kept] for part in found))


def _polish(
    problem: Problem, cost: smart.SpfSettings, rough: Hypotheses, rng: np.random.Generator
) -> list[tuple[float, Array, float]]:
    """SMD from each pose at its own scale; (scale, pose, golden energy), never worse than before."""

    def run(item: tuple[Array, float, np.random.Generator]) -> tuple[float, Array, float]:
        begun, scale, seed = item
        spheres = scaled_spheres(problem.spheres, scale)
        sized = make_problem(problem.hand.scaled(scale), problem.observation, cost, np.eye(3), seed, spheres)
        pose, _, _ = optimise(sized, cost, seed, begun)
        before, after = golden(sized, np.stack([begun, pose]))[0]
        return (scale, pose, float(after)) if after < before else (scale, begun, float(before))

    return map_threads(run, list(zip(rough.poses, rough.scales, rng.spawn(len(rough.scales)), strict=True)))


def around(hand: Hand, pose: Array, rng: np.random.Generator) -> Seeds:
    """Poses around one (D,): the palm moved and turned a little, the digits anywhere."""
    poses = np.repeat(pose[None], _NEAR_SEEDS, axis=0)
    poses[:, :3] += rng.normal(scale=_NEAR_MOVED, size=(_NEAR_SEEDS, 3))
    turns = Rotation.from_rotvec(rng.normal(scale=_NEAR_TURNED, size=(_NEAR_SEEDS, 3)))
    palm = rotation_about(pose[3:6])
    poses[:, 3:6] = [angles_of(turn @ palm) for turn in turns.as_matrix()]
    poses[:, 6:] = random_digits(hand, _NEAR_SEEDS, rng)
    poses[0] = pose
    return Seeds(poses, np.ones(_NEAR_SEEDS))


def suggested(
    network: Network, frame: Frame, region: Region, sides: Sequence[Side], size: float | None
) -> dict[Side, list[Seeds]]:
    """Let the network look all over a region for hands of each side, of a size relative to the bundled mesh or of any.

    Returns:
        What it suggests for each place where it sees a hand, as poses relative to the camera's axes; scales are relative
        to the bundled mesh, or 1 for a hand of known size.
    """
    found: dict[Side, list[Guess]] = {side: [] for side in sides}
    for place in _looks(region.points):
        for guess in search_hand(network, frame.depth, frame.camera, place, size, sides):
            found[guess.side].append(guess)
    return {side: [_seeds(those, size) for those in _places(every)] for side, every in found.items()}


def _looks(points: Array) -> Array:
    """Spread places over points (M, 3), the ends first, for a hand is at an end: (≤ _LOOKS, 3).

    Each next one is the farthest from those before (Gonzalez 1985), moved to the middle of what is around it.
    """
    places = [points.mean(axis=0)]
    apart = np.linalg.norm(points - places[0], axis=1)
    while len(places) < _LOOKS and apart.max() > _AROUND:
        end = points[int(np.argmax(apart))]
        places.append(points[np.linalg.norm(points - end, axis=1) < _AROUND].mean(axis=0))
        apart = np.minimum(apart, np.linalg.norm(points - end, axis=1))
    return np.array(places)


def _places(found: list[Guess]) -> list[list[Guess]]:
    """Divide guesses by where they are: a search that mixes a hand with an elbow keeps what explains more, not the hand."""
    groups: list[list[Guess]] = []
    for guess in sorted(found, key=believability, reverse=True):
        near = [group for group in groups if np.linalg.norm(guess.pose[:3] - group[0].pose[:3]) < _PLACE]
        if near:
            near[0].append(guess)
        elif len(groups) < _PLACES:
            groups.append([guess])
    return groups


def strangeness(network: Network | None, frame: Frame, hand: Hand, pose: Array, reference: Array) -> float:
    """Golden energy that a pose (D,) is charged for not being what the network sees where its hand is; 0 without it.

    By the network's density of the pose's joints, ``max Σ log p(x)/J`` over its hypotheses, lengths in the hand's, and by
    whether it sees a hand of that side there at all. A render that fits does not tell a fist from an elbow; what is around it
    does.
    """
    if network is None:
        return 0.0
    seen = seen_at(network, frame, hand, pose, reference)
    return strangeness_to(seen, hand, joints_of(hand, pose, reference))


def unfamiliarity(network: Network | None, frame: Frame, hand: Hand, pose: Array, *, told: bool = False) -> float:
    """Golden energy that a place is charged for not looking like a hand to the network, however one is held; 0 without it.

    By how sure it is of joints around the hand of a pose (D,) relative to the camera's axes, of either side. The end of an
    arm or an elbow is rendered as well as a hand; but where the fingers of what is no hand are, the network does not know.
    Where the side of the hand is ``told``, a place at which the network sees a hand of the other one is charged for that.
    """
    if network is None:
        return 0.0
    seen = seen_at(network, frame, hand, pose, np.eye(3), ("right", "left"))
    sureness = [
        -3.0 * float(np.log(_spread(guess) / (guess.scale * load_hand(guess.side).length)).mean()) for guess in seen
    ]
    unsure = _STRANGE * max(_SURE - max(sureness), 0.0)
    if not told:
        return unsure
    shares = np.exp([guess.log_weight for guess in seen])
    return unsure + _ABSENT * float(shares[[guess.side != hand.side for guess in seen]].sum() / shares.sum())


def seen_at(
    network: Network, frame: Frame, hand: Hand, pose: Array, reference: Array, sides: Sequence[Side] = ()
) -> list[Guess]:
    """What the network makes of a frame around a pose (D,) relative to ``reference``: hands of its side or of ``sides``, the
    best first."""
    middle = joints_of(hand, pose, reference).mean(axis=0)
    size = hand.length / load_hand(hand.side).length
    return guesses(network, frame.depth, frame.camera, middle, extent_of(size), sides or (hand.side,))


def strangeness_to(seen: Sequence[Guess], hand: Hand, joints: Array) -> float:
    """The same of joints (21, 3), m, for who has asked the network already; 0 where it was not asked."""
    if not seen:
        return 0.0

    def log_density(guess: Guess) -> float:
        spread = _spread(guess)
        apart = np.linalg.norm(guess.joints - joints, axis=1)
        per_joint = -apart / spread - 3.0 * np.log(spread / hand.length)
        return float(per_joint.mean()) + guess.log_weight / len(joints)

    absent = 1.0 - float(np.exp([guess.log_weight for guess in seen]).sum())
    return _STRANGE * max(_FAMILIAR - max(log_density(guess) for guess in seen), 0.0) + _ABSENT * absent


def _spread(guess: Guess) -> Array:
    """(21,) m, b of the Laplace density exp(-r/b)/(8 π b³) of each joint."""
    return 0.5 * guess.joint_sigma


def _seeds(found: list[Guess], size: float | None) -> Seeds:
    poses = np.array([guess.pose for guess in found])
    poses[:, 3:6] = [angles_of(guess.reference) for guess in found]
    scales = np.array([guess.scale if size is None else 1.0 for guess in found])
    return Seeds(poses, scales, max(guess.presence for guess in found))
