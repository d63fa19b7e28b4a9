"""What else is in the scene: forearm, body, table, a second hand, a face; by name, drawn with the same z-buffer."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from spf.frame import Camera
from spf.hand.kinematics import PosedHand, pose_hand
from spf.hand.model import MIRROR, Hand, load_hand
from spf.kernels.render import FAR
from spf.synthetic.motions import MOTIONS
from spf.synthetic.solids import Mesh, draw, ellipsoid, plane_depth, tube
from spf.synthetic.trajectory import Trajectory, View, make_trajectory, minimum_jerk, mirrored_trajectory

__all__ = ["CLUTTER", "Clutter", "Place", "moving_meshes"]

Array = NDArray[np.float64]

_FOREARM = 0.22  # m from wrist to elbow of the standard hand
_FOREARM_RINGS = 14
_STANDARD_LENGTH = 0.19  # m, wrist to middle tip


class Place(NamedTuple):
    """Where clutter is put.

    Attributes:
        camera: the sensor's camera.
        hand: the tracked hand.
        position: (3,) m, mean position of its palm.
        frames, fps: of the session.
        rng: draws sizes and places.
    """

    camera: Camera
    hand: Hand
    position: Array
    frames: int
    fps: float
    rng: np.random.Generator


class Clutter(NamedTuple):
    """The clutter of a session.

    Attributes:
        background: (H, W) depth of what stands still, m; FAR where there is nothing.
        arm: whether a forearm hangs on the hand.
        shoulder: (3,) m, where its upper arm ends, or None.
        second: another hand and how it moves, or None.
    """

    background: NDArray[np.float32]
    arm: bool = True
    shoulder: Array | None = None
    second: tuple[Hand, Trajectory] | None = None


def _empty(place: Place) -> NDArray[np.float32]:
    return np.full((place.camera.height, place.camera.width), FAR, np.float32)


def _none(place: Place) -> Clutter:
    return Clutter(_empty(place), arm=False)


def _forearm(place: Place) -> Clutter:
    return Clutter(_empty(place))


def _body(place: Place) -> Clutter:
    """The person behind the hand: head, neck and trunk, 35-50 cm further away."""
    outward = 1.0 if place.hand.side == "right" else -1.0  # of the image: a right palm's little finger is on the left
    x, y, z = place.position
    back = z + place.rng.uniform(0.35, 0.5)
    middle = x + outward * place.rng.uniform(0.12, 0.22)
    chin = y + place.rng.uniform(-0.12, -0.02)
    head = ellipsoid((middle, chin - 0.1, back), (0.075, 0.115, 0.1))
    neck = ellipsoid((middle, chin + 0.04, back + 0.03), (0.055, 0.1, 0.055))
    down = np.linspace(0.0, 0.55, 12)
    centres = np.stack([np.full(12, middle), chin + 0.13 + down, np.full(12, back + 0.05)], axis=1)
    widths = np.stack([0.09 + 0.02 * np.sqrt(down), 0.12 + 0.09 * np.minimum(down / 0.05, 1.0)], axis=1)
    trunk = tube(centres, widths, np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0]]))
    shoulders = ellipsoid((middle, chin + 0.17, back + 0.04), (0.24, 0.075, 0.08))
    shoulder = np.array([middle - outward * 0.19, chin + 0.17, back + 0.04])
    return Clutter(draw([head, neck, trunk, shoulders], place.camera), shoulder=shoulder)


def _face(place: Place) -> Clutter:
    """A face beside and behind the hand, 12-25 cm further away."""
    x, y, z = place.position + np.array([place.rng.uniform(-0.12, 0.12), place.rng.uniform(-0.08, 0.02), 0.0])
    back = z + place.rng.uniform(0.2, 0.33)
    head = ellipsoid((x, y, back), (0.075, 0.115, 0.095), rings=25)
    nose = ellipsoid((x, y + 0.01, back - 0.095), (0.016, 0.03, 0.022))
    chin = ellipsoid((x, y + 0.085, back - 0.05), (0.035, 0.03, 0.03))
    neck = ellipsoid((x, y + 0.17, back + 0.03), (0.055, 0.12, 0.055))
    return Clutter(draw([head, nose, chin, neck], place.camera))


def _table(place: Place) -> Clutter:
    """A table top behind the hand, seen from above: the sensor looks down at it at 35-60 degrees."""
    down = np.radians(place.rng.uniform(35.0, 60.0))
    normal = np.array([0.0, -np.cos(down), -np.sin(down)])
    point = place.position - normal * place.rng.uniform(0.14, 0.2)
    return Clutter(plane_depth(point, normal, place.camera))


def _second_hand(place: Place) -> Clutter:
    """The other hand, beside the tracked one and a little behind."""
    other = load_hand("left" if place.hand.side == "right" else "right")
    beside = 1.0 if place.hand.side == "left" else -1.0
    offset = np.array([beside * place.rng.uniform(0.19, 0.23), place.rng.uniform(-0.02, 0.05), 0.06])
    position = place.position + offset
    if other.side == "left":
        position = position * MIRROR  # written for a right hand, then mirrored
    view = View(position, *place.rng.normal(0.0, 0.2, 3))
    right = load_hand("right")
    moves = make_trajectory(right, MOTIONS["open_close"], view, place.frames, 3.0, place.fps, place.rng)
    return Clutter(_empty(place), second=(other, mirrored_trajectory(moves) if other.side == "left" else moves))


#: All clutter by name.
CLUTTER: dict[str, Callable[[Place], Clutter]] = {
    "none": _none,
    "forearm": _forearm,
    "body": _body,
    "table": _table,
    "second_hand": _second_hand,
    "face": _face,
}


def moving_meshes(clutter: Clutter, hand: Hand, posed: PosedHand | None, frame: int) -> list[Mesh]:
    """Return the meshes of a frame besides the hand: its arm, the second hand and its forearm.

    Args:
        clutter: of the session.
        hand: the tracked hand.
        posed: the tracked hand in this frame, None while it is away.
        frame: which frame.
    """
    meshes: list[Mesh] = []
    if posed is not None and clutter.arm:
        forearm, elbow = _forearm_mesh(hand, posed)
        meshes.append(forearm)
        if clutter.shoulder is not None:
            meshes += [_upper_arm(elbow, clutter.shoulder), ellipsoid(elbow, (0.048, 0.048, 0.048))]
    if clutter.second is not None:
        other, moves = clutter.second
        second = pose_hand(other, moves.poses[frame], moves.orientations[frame])
        meshes += [Mesh(second.vertices, other.faces), _forearm_mesh(other, second)[0]]
    return meshes


def _forearm_mesh(hand: Hand, posed: PosedHand) -> tuple[Mesh, Array]:
    """A tapered tube from inside the wrist down to the elbow, bent at the wrist towards "down and away"."""
    wrist = posed.frames[0]
    half, centre = _wrist_section(hand)
    size = hand.length / _STANDARD_LENGTH
    along = np.linspace(0.0, 1.0, _FOREARM_RINGS)
    bend = minimum_jerk(along / 0.35)[:, None]  # the arm leaves the wrist straight and then turns
    directions = wrist[:, 2] + bend * 0.6 * np.array([0.0, 0.9, 0.45])
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    first = wrist[:, 0] - directions * (directions @ wrist[:, 0])[:, None]
    first /= np.linalg.norm(first, axis=1, keepdims=True)
    start = wrist[:, 3] + wrist[:, :3] @ centre
    steps = np.diff(along, prepend=0.0)[:, None] * _FOREARM * size * directions
    bulge = 0.94 + 0.5 * np.sin(0.5 * np.pi * np.minimum(along * 1.4, 1.0))
    radii = bulge[:, None] * half + np.outer(along, [0.0, 0.006 * size])
    centres = start + np.cumsum(steps, axis=0)
    return tube(centres, radii, np.stack([first, np.cross(directions, first)], axis=1)), centres[-1]


def _wrist_section(hand: Hand) -> tuple[Array, Array]:
    """Half width and half thickness (2,) of the hand at the wrist joint, and the section's centre from it (3,); m."""
    wrist = hand.skeleton.bind[0, :, 3]
    near = np.abs(hand.skin.vertices[:, 2] - wrist[2]) < 0.05 * hand.length
    low, high = hand.skin.vertices[near].min(axis=0), hand.skin.vertices[near].max(axis=0)
    return 0.5 * (high - low)[:2], (0.5 * (low + high) - wrist) * (1.0, 1.0, 0.0)


def _upper_arm(elbow: Array, shoulder: Array) -> Mesh:
    direction = shoulder - elbow
    direction /= np.linalg.norm(direction)
    across = np.cross(direction, [0.0, 0.0, 1.0] if abs(direction[2]) < 0.9 else [1.0, 0.0, 0.0])
    across /= np.linalg.norm(across)
    along = np.linspace(0.0, 1.0, 10)
    radii = np.repeat(np.linspace(0.045, 0.06, 10)[:, None], 2, axis=1)
    return tube(elbow + np.outer(along, shoulder - elbow), radii, np.array([across, np.cross(direction, across)]))
