"""From a network's numbers to hands in the camera frame."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from spf.frame import Camera
from spf.hand.kinematics import joints_of
from spf.hand.model import DOF_NAMES, Hand, Side, load_hand
from spf.learned import layout
from spf.learned.crops import make_crops
from spf.learned.network import Network

__all__ = ["EXTENTS", "Guess", "decode", "extent_of", "guesses", "search_hand"]

Array = NDArray[np.float64]

#: Sides of the cubes, m, that show hands of 0.6 to 1.7 times the bundled mesh well enough for a first look.
EXTENTS: tuple[float, ...] = (0.16, 0.22, 0.30, 0.41)

_SCALES = (0.5, 2.0)  # of people's hands and what data sets make of them
_SURENESS = 10.0  # nats by which joints that are sure to a fraction 1/e of the distance outweigh others
_MIRROR = np.array([-1.0, 1.0, 1.0])
_SIDES: tuple[Side, Side] = ("right", "left")


class Guess(NamedTuple):
    """A hand that the network proposes.

    Attributes:
        side: which hand.
        scale: size relative to the bundled mesh.
        pose: (26,) with zero palm angles; the palm's rotation is all in ``reference``.
        reference: (3, 3) orientation R_ref that the pose is relative to.
        joints: (21, 3) m, camera frame, as predicted: not from the pose.
        joint_sigma: (21,) m, standard deviation of each along any direction.
        log_weight: logarithm of how probable the network holds it among the guesses of the same cube.
        presence: 0-1, probability that the cube shows a hand at all.
    """

    side: Side
    scale: float
    pose: Array
    reference: Array
    joints: Array
    joint_sigma: Array
    log_weight: float
    presence: float


def extent_of(scale: float) -> float:
    """Return the side of the cube, m, that the network likes best for a hand of this scale of the bundled mesh."""
    return layout.EXTENT_PER_LENGTH * load_hand("right").length * scale


def guesses(
    network: Network,
    depth: NDArray[np.float32],
    camera: Camera,
    centre: ArrayLike,
    extents: float | Sequence[float],
    sides: Sequence[Side] = _SIDES,
) -> list[Guess]:
    """Propose hands in cubes around a point.

    The network knows right hands; a left hand is a right one in the mirrored crop.

    Args:
        network: from :func:`~spf.learned.network.load_network`.
        depth: (H, W) m, 0 where there is no reading.
        camera: of the depth map.
        centre: (3,) m, camera frame; best the mean of the joints.
        extents: side of the cube, m, or several, see :func:`extent_of` and :data:`EXTENTS`.
        sides: which hands to look for.

    Returns:
        HYPOTHESES guesses for each side and cube, the best first.
    """
    sizes = np.atleast_1d(np.asarray(extents, dtype=np.float64))
    centres = np.tile(np.asarray(centre, dtype=np.float64), (len(sizes), 1))
    found = _look(network, depth, camera, centres, sizes, sides)
    return sorted((guess for group in found for guess in group), key=lambda guess: -guess.log_weight)


def _look(
    network: Network, depth: NDArray[np.float32], camera: Camera, centres: Array, extents: Array, sides: Sequence[Side]
) -> list[list[Guess]]:
    """Return the guesses of each cube, the best first."""
    crops, turns = make_crops(depth, camera, centres, extents)
    views = [crops if side == "right" else crops[:, :, ::-1] for side in sides]
    outputs = network.outputs(np.concatenate(views)).reshape(len(sides), len(crops), layout.OUTPUTS)
    # log odds of a right hand in either view: half their difference is the evidence, and what is usual cancels
    evidence = 0.5 * outputs[:, :, layout.RIGHT]
    log_sides = evidence - np.logaddexp.reduce(evidence, axis=0) if len(sides) > 1 else np.zeros_like(evidence)
    found = []
    for n, (centre, extent, turn) in enumerate(zip(centres, extents, turns, strict=True)):
        group: list[Guess] = []
        for side, numbers, log_side in zip(sides, outputs[:, n], log_sides[:, n], strict=True):
            group += decode(numbers, side, centre, float(extent), turn, float(log_side))
        found.append(sorted(group, key=lambda guess: -guess.log_weight))
    return found


def decode(numbers: Array, side: Side, centre: Array, extent: float, turn: Array, log_side: float) -> list[Guess]:
    """Return the hypotheses of one crop as hands in the camera frame.

    Args:
        numbers: (OUTPUTS,) of the crop, for a left hand of the mirrored crop.
        side: which hand they are taken for.
        centre: (3,) m, of the cube, camera frame.
        extent: m, side of the cube.
        turn: (3, 3) R_camera_crop.
        log_side: logarithm of the probability that it is this side.
    """
    raw = numbers[: layout.PRESENT].reshape(layout.HYPOTHESES, layout.NUMBERS)
    log_shares = raw[:, layout.LOGIT] - np.logaddexp.reduce(raw[:, layout.LOGIT])
    presence = 1.0 / (1.0 + np.exp(-numbers[layout.PRESENT]))
    length = load_hand("right").length
    mirror = _MIRROR if side == "left" else np.ones(3)
    found = []
    for row, log_share in zip(raw, log_shares, strict=True):
        points = (row[layout.POINTS].reshape(-1, 3) * mirror * extent) @ turn.T + centre
        sigma = 2.0 * np.exp(row[layout.LOG_SPREADS]) * extent
        scale = float(np.exp(row[layout.LOG_SIZE]) * extent / length)
        pose = np.zeros(len(DOF_NAMES))
        pose[list(layout.ARTICULATED)] = row[layout.ANGLES]
        pose = load_hand(side).constrain(pose)
        pose[:3], reference = _placed(load_hand(side), scale, pose, points, sigma)
        found.append(
            Guess(
                side=side,
                scale=scale,
                pose=pose,
                reference=reference,
                joints=points[:21],
                joint_sigma=sigma[:21],
                log_weight=float(log_share + log_side + np.log(max(presence, 1e-9))),
                presence=float(presence),
            )
        )
    return found


def _placed(hand: Hand, scale: float, pose: Array, points: Array, sigma: Array) -> tuple[Array, Array]:
    """Place a hand with bent fingers where the predicted points are (Kabsch 1976).

    The rotation R and translation t that minimise Σ w ‖R a + t − x‖² with w = 1/σ², over the 21 joints and the palm's
    centre a of the hand in its own frame. On recordings this is closer than the network's own rotation and palm, which
    are therefore only taught, because they help it to see.

    Args:
        hand: the bundled hand.
        scale: its predicted size.
        pose: (26,) with its fingers; the palm's entries are not used.
        points: (22, 3) m, predicted joints and palm's centre.
        sigma: (22,) m, of them.

    Returns:
        t (3,), m, and R (3, 3).
    """
    own = np.zeros((len(points), 3))
    own[:-1] = scale * joints_of(hand, np.concatenate([np.zeros(6), pose[6:]]))
    weights = sigma**-2.0 / np.sum(sigma**-2.0)
    middle, target = weights @ own, weights @ points
    spread = (points - target).T @ ((own - middle) * weights[:, None])
    left, _, right = np.linalg.svd(spread)
    proper = np.diag([1.0, 1.0, np.sign(np.linalg.det(left @ right))])
    rotation = left @ proper @ right
    return target - rotation @ middle, rotation


def search_hand(
    network: Network,
    depth: NDArray[np.float32],
    camera: Camera,
    centre: ArrayLike,
    scale: float | None = None,
    sides: Sequence[Side] = _SIDES,
    rounds: int = 3,
) -> list[Guess]:
    """Propose hands near a point that may be some way off, at an unknown size: look, centre on the best guess, look again.

    Args:
        network: from :func:`~spf.learned.network.load_network`.
        depth: (H, W) m, 0 where there is no reading.
        camera: of the depth map.
        centre: (3,) m, camera frame, within about 10 cm of the hand; of a region of the depth map.
        scale: of the hand relative to the bundled mesh; None when unknown.
        sides: which hands to look for.
        rounds: number of looks.

    Returns:
        the guesses of the last look at each of the first look's cubes, the best first.
    """
    extents = np.array(EXTENTS if scale is None else [extent_of(scale)])
    centres = np.tile(np.asarray(centre, dtype=np.float64), (len(extents), 1))
    found: list[list[Guess]] = []
    for _ in range(rounds):
        found = _look(network, depth, camera, centres, extents, sides)
        bests = [group[0] for group in found]
        centres = np.array([best.joints.mean(axis=0) for best in bests])
        extents = np.array([extent_of(scale or float(np.clip(best.scale, *_SCALES))) for best in bests])
    return sorted((guess for group in found for guess in group), key=_believability, reverse=True)


def _believability(guess: Guess) -> float:
    """How much to believe a guess among those of several cubes: weight, and joints that are sure for a hand's size."""
    return guess.log_weight - _SURENESS * float(np.log(guess.joint_sigma / guess.scale).mean())
