"""Draw scenes at random: where the hand is and how it is turned, its forearm, the other hand, other things, and the sensor.

Every scene is laid out in the frame of its crop's camera, with the cube's centre at (0, 0, away).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from spf.hand.kinematics import rotations_about
from spf.hand.model import MIRROR
from spf.kernels.samples import LARGEST_PICTURE, SampleScenes
from spf.kernels.sensing import FAULTS
from spf.learned.layout import CROP_SIZE, EXTENT_PER_LENGTH
from spf.synthetic.solids import ellipsoid, tube
from spf.synthetic.trajectory import PALM_TO_SENSOR
from spf.training.articulations import draw_articulations
from spf.training.shapes import ShapeTable

__all__ = ["Scenes", "draw_scenes", "other_faces"]

Array = NDArray[np.float64]

_HAND_MIDDLE = np.array([-0.005, -0.005, -0.035])  # m, middle of the joints of the bundled hand, model frame
_RINGS, _BLOBS = 10, 3
_EMPTY_SHARE = 0.05
_ELBOW_SHARE = 0.1  # of the other scenes
_SECOND_SHARE = 0.2  # of those in which the hand is seen: the other one is near, or its arm
_POOL = 1 << 22
_ABSENT = -1.0  # coordinates of what is not drawn: behind the camera

_RING_ACROSS = np.array([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
_TUBE = tube(
    np.stack([np.zeros(_RINGS), np.zeros(_RINGS), np.linspace(0.0, 1.0, _RINGS)], 1), np.ones((_RINGS, 2)), _RING_ACROSS
)
_BALL = ellipsoid(np.zeros(3), np.ones(3), rings=9)


class Scenes(NamedTuple):
    """N scenes.

    Attributes:
        kernel: what the kernel draws.
        left: (N,) whether the crop is to be mirrored, so that it shows a left hand.
        present: (N,) whether a hand is in the cube: not in an empty scene, nor around an elbow.
    """

    kernel: SampleScenes
    left: NDArray[np.bool_]
    present: NDArray[np.bool_]


def other_faces(hand: NDArray[np.int32], first: int) -> NDArray[np.int32]:
    """Return the faces of all that is no hand to be found, whose vertices begin at a number: arms, blobs and the other hand.

    Args:
        hand: (F, 3) faces of a hand with ``first`` vertices.
        first: number of the first vertex.
    """
    parts = [(_TUBE.faces, len(_TUBE.vertices)), *[(_BALL.faces, len(_BALL.vertices))] * _BLOBS]
    parts += [(_TUBE.faces, len(_TUBE.vertices)), (hand, first)]
    starts = np.cumsum([first, *(count for _, count in parts)])
    return np.concatenate(
        [faces + start for (faces, _), start in zip(parts, starts, strict=False)], dtype=np.int32, casting="unsafe"
    )


def draw_scenes(rng: np.random.Generator, n: int, shapes: ShapeTable, left_share: float) -> Scenes:
    """Draw n scenes, of which a share are to be mirrored."""
    shape = rng.integers(len(shapes.sizes), size=n)
    size = shapes.sizes[shape]
    extents = EXTENT_PER_LENGTH * shapes.lengths[shape] * np.exp(_misfits(rng, n))
    away = extents / np.exp(rng.uniform(np.log(0.2), np.log(0.9), n))
    orientations = _orientations(rng, n)
    middles = _jitter(rng, n) * extents[:, None]
    middles[:, 2] += away
    empty = rng.random(n) < _EMPTY_SHARE
    elbow = ~empty & (rng.random(n) < _ELBOW_SHARE)
    poses = np.zeros((n, 26))
    poses[:, 6:] = draw_articulations(rng, n)
    poses[:, :3] = _palms(middles, orientations, size, _HAND_MIDDLE)
    others, moved = _others(rng, shapes, shape, poses, orientations, away, extents, empty, elbow)
    poses[:, :3] += moved
    second = ~(empty | elbow) & (rng.random(n) < _SECOND_SHARE)
    others = np.concatenate([others, _second_hands(rng, shapes, second, middles, away, extents)], axis=1)
    focal = np.exp(rng.uniform(np.log(0.75), np.log(2.1), n)) * CROP_SIZE * away / extents
    sizes = np.minimum(np.ceil(focal * extents / away * 1.03) + 4, LARGEST_PICTURE).astype(np.int64)
    kernel = SampleScenes(
        shape=shape,
        drawn=~empty,
        poses=poses,
        orientations=orientations,
        others=others,
        planes=_planes(rng, n, extents, np.where(empty, 0.35, 0.1)),
        away=away,
        extents=extents,
        focal=focal,
        sizes=sizes,
        faults=_faults(rng, n),
        starts=rng.integers(_POOL, size=n),
    )
    return Scenes(kernel, rng.random(n) < left_share, ~(empty | elbow))


def _centres(away: Array) -> Array:
    """Centres (n, 3) of the cubes."""
    return np.stack([np.zeros_like(away), np.zeros_like(away), away], axis=1)


def _palms(middles: Array, orientations: Array, sizes: Array, middle: Array) -> Array:
    """Palms (n, 3) of hands whose joints' middle, ``middle`` in the bundled hand's frame, is to be at ``middles``."""
    return np.asarray(middles - np.einsum("nij,nj->ni", orientations, sizes[:, None] * middle))


def _orientations(rng: np.random.Generator, n: int) -> Array:
    """All yaw; pitch and roll about "fingers up", or any; a few turned in any way."""
    yaw = rng.uniform(-np.pi, np.pi, n)
    pitch = np.radians(rng.normal(0.0, 35.0, n))
    roll = np.where(rng.random(n) < 0.75, np.radians(rng.normal(0.0, 40.0, n)), rng.uniform(-np.pi, np.pi, n))
    turned = rotations_about(2, roll) @ rotations_about(0, pitch) @ rotations_about(1, yaw) @ PALM_TO_SENSOR
    anyhow = rng.random(n) < 0.12
    turned[anyhow] = _any_rotations(rng, int(anyhow.sum()))
    return np.asarray(turned)


def _misfits(rng: np.random.Generator, n: int) -> Array:
    """Logarithms (n,) of cubes' sides over the usual one: nearly the usual when a hand is tracked, any in a first look."""
    return np.where(rng.random(n) < 0.6, rng.normal(0.0, 0.07, n), rng.uniform(-0.34, 0.36, n))


def _jitter(rng: np.random.Generator, n: int) -> Array:
    """Offsets (n, 3) of the hand from the cube's centre, in sides of the cube: mostly small, sometimes large."""
    near = rng.normal(0.0, 0.04, (n, 3))
    direction = rng.normal(size=(n, 3))
    direction /= np.linalg.norm(direction, axis=1, keepdims=True)
    far = direction * (0.3 * np.cbrt(rng.random((n, 1))))
    return np.where(rng.random((n, 1)) < 0.75, near, far)


def _others(
    rng: np.random.Generator, shapes: ShapeTable, shape: NDArray[np.int64], poses: Array, orientations: Array,
    away: Array, extents: Array, empty: NDArray[np.bool_], elbow: NDArray[np.bool_],
) -> tuple[Array, Array]:  # fmt: skip
    """Vertices (n, W, 3) of forearm and blobs, and how far (n, 3) all hands are moved so that some elbows are in the middle."""
    arm = _forearms(rng, shapes, shape, poses[:, :3], orientations, elbow)
    centres = _centres(away)
    ends = centres + rng.normal(0.0, 0.08, arm[:, -1].shape) * extents[:, None]
    moved = np.where(elbow[:, None], ends - arm[:, -1], 0.0)
    arm += moved[:, None]
    width = np.linalg.norm(arm[:, -3] - arm[:, -1], axis=1)  # a vertex of the last ring, and the middle of its cap
    arm[rng.random(len(shape)) < np.select([empty, elbow], [0.4, 0.0], 0.06)] = _ABSENT
    blobs = [_blobs(rng, centres, extents, np.where(empty, 0.4, 0.08)) for _ in range(_BLOBS)]
    for blob, part in zip(blobs, (_round_elbows, _upper_arms), strict=False):
        there = np.flatnonzero(elbow & (rng.random(len(shape)) < 0.65))
        blob[there] = part(rng, ends[there], width[there], extents[there])
    return np.concatenate([arm, *blobs], axis=1), moved


def _second_hands(
    rng: np.random.Generator, shapes: ShapeTable, there: NDArray[np.bool_], middles: Array, away: Array, extents: Array
) -> Array:
    """Vertices (n, W, 3) of left hands and their forearms, farther from the middle of the cube than the hand to be found."""
    n = len(there)
    shape = rng.integers(len(shapes.sizes), size=n)
    direction = _directions(rng, n, behind=0.7, along=0.6)
    seconds = middles + direction * (rng.uniform(0.28, 0.9, n) * extents)[:, None]
    centres = _centres(away)
    apart = np.linalg.norm(seconds - centres, axis=1) - np.linalg.norm(middles - centres, axis=1)
    orientations = MIRROR[:, None] * _orientations(rng, n) * MIRROR
    palms = _palms(seconds, orientations, shapes.sizes[shape], _HAND_MIDDLE * MIRROR)
    arms = _forearms(rng, shapes, shape, palms, orientations, np.ones(n, bool))
    shown = np.flatnonzero(there & (apart >= 0.1 * extents))
    skins = shapes.left[shape[shown]] @ orientations[shown].transpose(0, 2, 1) + palms[shown, None]
    placed = np.full((n, arms.shape[1] + skins.shape[1], 3), _ABSENT)
    placed[shown] = np.concatenate([arms[shown], skins], axis=1)
    return placed


def _round_elbows(rng: np.random.Generator, ends: Array, width: Array, _extents: Array) -> Array:
    """Balls (n, W, 3) at the ends of forearms."""
    radii = width[:, None] * rng.uniform(0.8, 1.25, ends.shape)
    return np.asarray(_BALL.vertices[None] * radii[:, None, :] + ends[:, None])


def _upper_arms(rng: np.random.Generator, ends: Array, width: Array, extents: Array) -> Array:
    """Long ellipsoids (n, W, 3) from the ends of forearms, mostly away from the sensor."""
    half = rng.uniform(0.3, 0.7, len(ends)) * extents
    radii = np.stack([width * rng.uniform(0.8, 1.4, len(ends)), width * rng.uniform(0.8, 1.4, len(ends)), half], axis=1)
    turn = _any_rotations(rng, len(ends))
    turn *= np.where((turn[:, 2, 2] < 0.0) & (rng.random(len(ends)) < 0.8), -1.0, 1.0)[:, None, None]
    middle = ends + turn[:, :, 2] * (0.9 * half)[:, None]
    return np.asarray((_BALL.vertices[None] * radii[:, None, :]) @ turn.transpose(0, 2, 1) + middle[:, None])


def _forearms(
    rng: np.random.Generator, shapes: ShapeTable, shape: NDArray[np.int64], palms: Array, orientations: Array,
    long: NDArray[np.bool_],
) -> Array:  # fmt: skip
    """Tapered tubes (n, W, 3) from inside the wrist, bent at it, short or long, with or without a sleeve."""
    n = len(shape)
    size = shapes.lengths[shape]
    bend = rotations_about(0, np.radians(rng.normal(0.0, 30.0, n))) @ rotations_about(
        1, np.radians(rng.normal(0.0, 13.0, n))
    )
    along = np.linspace(0.0, 1.0, _RINGS)
    length = np.where(long | (rng.random(n) < 0.85), rng.uniform(0.9, 1.6, n), rng.uniform(0.05, 0.9, n)) * size
    growth = rng.uniform(0.05, 0.75, n)[:, None] * np.minimum(along * length[:, None] / size[:, None], 1.0)
    sleeve = (along > rng.uniform(0.05, 1.0, (n, 1))) * np.where(rng.random(n) < 0.3, rng.uniform(0.0, 0.6, n), 0.0)[
        :, None
    ]
    radii = shapes.wrist_radii[shape][:, None, :] * (rng.uniform(0.85, 1.15, n)[:, None] + growth + sleeve)[..., None]
    sides = (len(_TUBE.vertices) - 2) // _RINGS
    ring = np.concatenate([np.repeat(np.arange(_RINGS), sides), [0, _RINGS - 1]])
    local = np.empty((n, len(ring), 3))
    local[..., :2] = _TUBE.vertices[None, :, :2] * radii[:, ring]
    local[..., 2] = along[ring] * length[:, None] - 0.02 * size[:, None]
    turn = orientations @ bend
    start = palms + np.einsum("nij,nj->ni", orientations, shapes.wrist_middles[shape])
    return np.asarray(local @ turn.transpose(0, 2, 1) + start[:, None, :])


def _blobs(rng: np.random.Generator, centres: Array, extents: Array, share: Array) -> Array:
    """Ellipsoids (n, W, 3) beside or behind the hand: limbs, faces, things."""
    placed = np.full((len(extents), len(_BALL.vertices), 3), _ABSENT)
    there = np.flatnonzero(rng.random(len(extents)) < share)
    n, extent = len(there), extents[there]
    direction = _directions(rng, n, behind=0.85)
    radii = np.exp(rng.uniform(np.log(0.06), np.log(0.5), (n, 3))) * extent[:, None]
    reach = (rng.uniform(0.3, 0.65, n) * extent)[:, None] + 0.6 * radii.mean(axis=1, keepdims=True)
    turn = _any_rotations(rng, n)
    middle = centres[there] + direction * reach
    placed[there] = (_BALL.vertices[None] * radii[:, None, :]) @ turn.transpose(0, 2, 1) + middle[:, None]
    return placed


def _directions(rng: np.random.Generator, n: int, behind: float, along: float = 1.0) -> Array:
    """Unit vectors (n, 3), a share of them away from the sensor, stretched by a factor along its line of sight."""
    direction = rng.normal(size=(n, 3)) * (1.0, 1.0, along)
    direction[:, 2] = np.abs(direction[:, 2]) * np.where(rng.random(n) < behind, 1.0, -1.0)
    return np.asarray(direction / np.linalg.norm(direction, axis=1, keepdims=True))


def _any_rotations(rng: np.random.Generator, n: int) -> Array:
    """Rotations (n, 3, 3), all orientations alike."""
    q, _ = np.linalg.qr(rng.normal(size=(n, 3, 3)))
    return np.asarray(q * np.sign(np.linalg.det(q))[:, None, None])


def _planes(rng: np.random.Generator, n: int, extents: Array, share: Array) -> Array:
    """Planes (n, 4) behind the hand: a table or a wall."""
    tilt, around = np.radians(np.abs(rng.normal(0.0, 35.0, n))).clip(0.0, 1.2), rng.uniform(0.0, 2.0 * np.pi, n)
    normal = np.stack([np.sin(tilt) * np.cos(around), np.sin(tilt) * np.sin(around), -np.cos(tilt)], axis=1)
    planes = np.concatenate([normal, (rng.uniform(0.03, 0.5, n) * extents)[:, None]], axis=1)
    planes[rng.random(n) >= share] = 0.0
    return planes


def _faults(rng: np.random.Generator, n: int) -> Array:
    """Sensors' faults (n, len(FAULTS)), from nearly none to more than real ones have; one in fourteen has none."""
    clean = rng.random(n) < 0.07
    drawn = {
        "ragged": 0.8 * rng.random(n) ** 1.5 * (rng.random(n) < 0.6),
        "flying": 0.5 * rng.random(n) ** 1.5 * (rng.random(n) < 0.5),
        "eroded": 0.8 * rng.random(n) ** 1.5 * (rng.random(n) < 0.4),
        "white": 0.003 * rng.random(n) ** 2,
        "grainy": 0.005 * rng.random(n) ** 2 * (rng.random(n) < 0.8),
        "grain": rng.uniform(2.0, 8.0, n),
        "holes": np.where(rng.random(n) < 0.3, rng.uniform(2.0, 4.0, n), 9.0),
        "hole_size": rng.uniform(2.0, 9.0, n),
        "steepest": np.where(rng.random(n) < 0.4, rng.uniform(2.5, 7.0, n), 1e6),
        "smooths": (rng.random(n) < 0.4).astype(float),
        "step": rng.choice([0.0001, 0.001, 0.002, 0.004], size=n),
        "bloom": rng.random(n) * (rng.random(n) < 0.6),
    }
    faults = np.stack([drawn[name] for name in FAULTS], axis=1)
    faults[clean] = [0.0, 0.0, 0.0, 0.0, 0.0, 4.0, 0.0, 4.0, 1e6, 0.0, 0.0001, 0.0]
    return faults
