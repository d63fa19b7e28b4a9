"""From a network's numbers to hands in the camera frame."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from spf.frame import Camera
from spf.hand.kinematics import joints_of_each
from spf.hand.model import DOF_NAMES, MIRROR, Hand, Side, load_hand
from spf.learned import layout
from spf.learned.crops import make_crops
from spf.learned.network import Network

__all__ = [
    "EXTENTS",
    "Cubes",
    "Guess",
    "believability",
    "decode",
    "extent_of",
    "guesses",
    "search_hand",
    "side_evidence",
]

Array = NDArray[np.float64]

#: Sides of the cubes, m, that show hands of 0.6 to 1.7 times the bundled mesh well enough for a first look.
EXTENTS: tuple[float, ...] = (0.16, 0.22, 0.30, 0.41)

_SCALES = (0.5, 2.0)  # of people's hands and what data sets make of them
_SURENESS = 10.0  # nats by which joints that are sure to a fraction 1/e of the distance outweigh others
_UNSURE_SIDE = 5.0  # nats, for the side, by a factor e of the joints' spread
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


class Cubes(NamedTuple):
    """M cubes that a network looked at.

    Attributes:
        centres: (M, 3) m, camera frame.
        extents: (M,) m, sides.
        turns: (M, 3, 3) R_camera_crop.
        perspectives: (M,) side over the distance from the camera to the centre; 0 of an orthographic camera.
    """

    centres: Array
    extents: Array
    turns: Array
    perspectives: Array


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
    return sorted((guess for group in found for guess in group), key=_weight)


def _look(
    network: Network, depth: NDArray[np.float32], camera: Camera, centres: Array, extents: Array, sides: Sequence[Side]
) -> list[list[Guess]]:
    """Return the guesses of each cube, the best first."""
    crops, turns = make_crops(depth, camera, centres, extents)
    near = 0.0 if camera.model == "orthographic" else 1.0
    cubes = Cubes(centres, extents, turns, near * extents / np.linalg.norm(centres, axis=1))
    views = [crops if side == "right" else crops[:, :, ::-1] for side in sides]
    outputs = network.outputs(np.concatenate(views)).reshape(len(sides), len(crops), layout.OUTPUTS)
    log_sides = side_evidence(outputs) if len(sides) > 1 else np.zeros((1, len(crops)))
    decoded = [decode(*view, cubes) for view in zip(outputs, sides, log_sides, strict=True)]
    return [sorted((g for group in of_cube for g in group), key=_weight) for of_cube in zip(*decoded, strict=True)]


def side_evidence(outputs: Array) -> Array:
    """Return the logarithms (S, M) of how probable each of S views (S, M, OUTPUTS) of M crops is the one of a right hand.

    By the log odds that each view's output gives it, where half their difference is the evidence and what is usual
    cancels; and by how sure the joints are, for a hand is hardest to place in the view in which it is a left one.
    """
    raw = outputs[..., : layout.PRESENT].reshape(*outputs.shape[:2], layout.HYPOTHESES, layout.NUMBERS)
    shares = np.exp(raw[..., layout.LOGIT] - np.logaddexp.reduce(raw[..., layout.LOGIT], axis=-1, keepdims=True))
    unsure = (shares * raw[..., layout.LOG_SPREADS].mean(axis=-1)).sum(axis=-1)
    evidence = 0.5 * outputs[..., layout.RIGHT] - _UNSURE_SIDE * unsure
    return np.asarray(evidence - np.logaddexp.reduce(evidence, axis=0))


def _weight(guess: Guess) -> float:
    """What the best guess has least of."""
    return -guess.log_weight


def decode(numbers: Array, side: Side, log_sides: Array, cubes: Cubes) -> list[list[Guess]]:
    """Return the hypotheses of each crop as hands in the camera frame.

    Args:
        numbers: (M, OUTPUTS) of the crops, for a left hand of the mirrored crops.
        side: which hand they are taken for.
        log_sides: (M,) logarithm of the probability that it is this side.
        cubes: that the crops show.
    """
    raw = numbers[:, : layout.PRESENT].reshape(-1, layout.HYPOTHESES, layout.NUMBERS)
    hand, extents = load_hand(side), cubes.extents[:, None]
    presence = 1.0 / (1.0 + np.exp(-numbers[:, layout.PRESENT]))
    log_weights = raw[..., layout.LOGIT] - np.logaddexp.reduce(raw[..., layout.LOGIT], axis=1, keepdims=True)
    log_weights += (log_sides + np.log(np.maximum(presence, 1e-9)))[:, None]
    points = _points(raw[..., layout.POINTS], side, cubes)
    sigma = 2.0 * np.exp(raw[..., layout.LOG_SPREADS]) * extents[..., None]
    scales = np.exp(raw[..., layout.LOG_SIZE]) * extents / load_hand("right").length
    poses = np.zeros((*scales.shape, len(DOF_NAMES)))
    poses[..., layout.ARTICULATED] = raw[..., layout.ANGLES]
    poses = hand.constrain(poses)
    poses[..., :3], references = _placed(hand, scales, poses, points, sigma)
    return [
        [
            Guess(
                side, float(scales[m, h]), poses[m, h], references[m, h], points[m, h, :21], sigma[m, h, :21],
                float(log_weights[m, h]), float(presence[m]),
            )
            for h in range(layout.HYPOTHESES)
        ]
        for m in range(len(raw))
    ]  # fmt: skip


def _points(predicted: Array, side: Side, cubes: Cubes) -> Array:
    """Return predicted points (M, H, 66) in the camera frame (M, H, 22, 3), m: pixel (u, v) of depth z shows (1 + z p)(u, v)."""
    points = predicted.reshape(*predicted.shape[:2], 22, 3).copy()
    points[..., :2] *= 1.0 + points[..., 2:] * cubes.perspectives[:, None, None, None]
    points *= cubes.extents[:, None, None, None] * (MIRROR if side == "left" else 1.0)
    return np.asarray(points @ cubes.turns.transpose(0, 2, 1)[:, None] + cubes.centres[:, None, None])


def _placed(hand: Hand, scales: Array, poses: Array, points: Array, sigma: Array) -> tuple[Array, Array]:
    """Place hands with bent fingers where the predicted points are (Kabsch 1976).

    The rotation R and translation t that minimise Σ w ‖R a + t − x‖² with w = 1/σ², over the 21 joints and the palm's
    centre a of the hand in its own frame. On recordings this is closer than the network's own rotation and palm, which
    are therefore only taught, because they help it to see.

    Args:
        hand: the bundled hand.
        scales: (M, H) predicted sizes.
        poses: (M, H, 26) with their fingers; the palm's entries are zeros.
        points: (M, H, 22, 3) m, predicted joints and palm's centre.
        sigma: (M, H, 22) m, of them.

    Returns:
        t (M, H, 3), m, and R (M, H, 3, 3).
    """
    own = np.zeros(points.shape)
    joints = joints_of_each(hand, poses.reshape(-1, poses.shape[-1])).reshape(*scales.shape, 21, 3)
    own[..., :-1, :] = scales[..., None, None] * joints
    weights = sigma[..., None] ** -2.0
    weights /= weights.sum(axis=-2, keepdims=True)
    middle, target = (weights * own).sum(axis=-2), (weights * points).sum(axis=-2)
    spread = (points - target[..., None, :]).swapaxes(-1, -2) @ ((own - middle[..., None, :]) * weights)
    left, _, right = np.linalg.svd(spread)
    left[..., 2] *= np.sign(np.linalg.det(left @ right))[..., None]
    rotations = left @ right
    return target - (rotations @ middle[..., None])[..., 0], rotations


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
    return sorted((guess for group in found for guess in group), key=believability, reverse=True)


def believability(guess: Guess) -> float:
    """How much to believe a guess among those of several cubes: weight, and joints that are sure for a hand's size."""
    return guess.log_weight - _SURENESS * float(np.log(guess.joint_sigma / guess.scale).mean())
