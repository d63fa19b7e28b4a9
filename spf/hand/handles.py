"""Pose a hand by dragging handles over its picture: the palm is moved and turned, a finger is bent to where its tip is drawn.

Every drag is computed from the pose that it began with, so that it leads to the same pose whatever way the mouse took.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation

from spf.frame import JOINT_NAMES, Camera
from spf.hand.kinematics import joints_of, rotation_about
from spf.hand.model import FINGERS, Hand

__all__ = ["HANDLES", "Stance", "dragged", "entries_of", "handle_points", "turned_home"]

Array = NDArray[np.float64]

#: Handles by name: ``palm`` moves the hand, ``wrist`` turns it in the picture, ``knuckle`` tilts it, a tip bends its finger.
HANDLES: tuple[str, ...] = ("palm", "wrist", "knuckle", *(f"{finger}_tip" for finger in FINGERS))

_KNUCKLE = JOINT_NAMES.index("middle_mcp")
_TILT_RADIUS = 0.5  # of the ball that tilts, in lengths of the hand
_NEAREST = 0.05  # m, how near to the camera a palm can be
_REST = 0.003  # m per radian: how strongly the entries of a finger stay where they were
_ON_SURFACE, _NEAR_SURFACE = 0.3, 0.04  # weight of the surface seen, and m within which it is taken for the fingertip's
_SKIN = 0.005  # m from the surface to the tip's joint


class Stance(NamedTuple):
    """A hand's pose (D,) relative to a reference (3, 3)."""

    pose: Array
    reference: Array


def entries_of(part: str) -> range:
    """Return the entries of a pose that belong to ``palm`` or to a finger; those of free DIP joints are left alone."""
    if part == "palm":
        return range(6)
    first = 6 + 4 * FINGERS.index(part)
    return range(first, first + 4)


def handle_points(hand: Hand, stance: Stance) -> dict[str, Array]:
    """Return where the handles of a posed hand are: name → (3,) m."""
    joints = joints_of(hand, *stance)
    points = {"palm": stance.pose[:3], "wrist": joints[0], "knuckle": joints[_KNUCKLE]}
    return points | {name: joints[JOINT_NAMES.index(name)] for name in HANDLES[3:]}


def turned_home(stance: Stance) -> Stance:
    """Return the same stance with the palm's rotation all in the reference: its angles are zero, far from gimbal lock."""
    pose = stance.pose.copy()
    pose[3:6] = 0.0
    u, _, vt = np.linalg.svd(rotation_about(stance.pose[3:6]) @ stance.reference)
    return Stance(pose, u @ vt)


def dragged(
    hand: Hand, camera: Camera, begun: Stance, handle: str, start: ArrayLike, end: ArrayLike, surface: float = 0.0
) -> Stance:
    """Return the stance to which a handle was dragged.

    Args:
        hand: the model.
        camera: of the picture.
        begun: the stance when the drag began.
        handle: one of :data:`HANDLES`.
        start, end: (2,) pixels where the drag began and where it is.
        surface: depth in metres of the surface seen at the end, 0 where there is none. A fingertip that is about as deep is
            laid onto it, for a picture alone does not tell how deep a tip is.

    Returns:
        The palm's rotation is in its reference.
    """
    grip, pixel = np.asarray(start, dtype=np.float64), np.asarray(end, dtype=np.float64)
    if handle == "palm":
        return _moved(camera, begun, pixel - grip)
    if handle == "wrist":
        return _turned(begun, _in_picture(camera, begun.pose[:3], grip, pixel))
    if handle == "knuckle":
        right, down = _metres(camera, begun.pose[2], pixel - grip) / (_TILT_RADIUS * hand.length)
        return _turned(begun, Rotation.from_rotvec([down, -right, 0.0]))
    tip = camera.project(handle_points(hand, begun)[handle])
    return _bent(hand, camera, begun, handle, tip + pixel - grip, surface)


def _metres(camera: Camera, depth: float, pixels: Array) -> Array:
    """Sizes (2,) in the picture as metres at a depth."""
    per_pixel = depth if camera.model == "pinhole" else 1.0
    return pixels * per_pixel / np.array([camera.fx, camera.fy])


def _moved(camera: Camera, begun: Stance, pixels: Array) -> Stance:
    pose = begun.pose.copy()
    u, v = camera.project(pose[:3]) + pixels
    pose[:3] = camera.back_project(u, v, max(pose[2], _NEAREST))
    return turned_home(Stance(pose, begun.reference))


def _turned(begun: Stance, turn: Rotation) -> Stance:
    palm = rotation_about(begun.pose[3:6]) @ begun.reference
    pose = begun.pose.copy()
    pose[3:6] = 0.0
    return turned_home(Stance(pose, turn.as_matrix() @ palm))


def _in_picture(camera: Camera, centre: Array, grip: Array, pixel: Array) -> Rotation:
    """The turn about the line of sight to the palm's centre that takes the direction of one pixel to another's."""
    middle = camera.project(centre)
    before, after = _metres(camera, 1.0, grip - middle), _metres(camera, 1.0, pixel - middle)
    angle = np.arctan2(after[1], after[0]) - np.arctan2(before[1], before[0])
    sight = centre / np.linalg.norm(centre) if camera.model == "pinhole" else np.array([0.0, 0.0, 1.0])
    return Rotation.from_rotvec(angle * sight)


def _bent(hand: Hand, camera: Camera, begun: Stance, handle: str, pixel: Array, surface: float) -> Stance:
    """Bend one finger by least squares until its tip is seen at a pixel, within the limits of its joints."""
    tip, entries = JOINT_NAMES.index(handle), list(entries_of(handle.removesuffix("_tip")))
    first = hand.constrain(begun.pose)[entries]
    at = joints_of(hand, *begun)[tip]
    depth = surface + _SKIN
    weight = _ON_SURFACE if surface > 0 and abs(depth - at[2]) < _NEAR_SURFACE else 0.0
    pose = begun.pose.copy()

    def residuals(angles: Array) -> Array:
        pose[entries] = angles
        joint = joints_of(hand, pose, begun.reference)[tip]
        apart = _metres(camera, at[2], camera.project(joint) - pixel)
        return np.concatenate([apart, [weight * (joint[2] - depth)], _REST * (angles - first)])

    low, high = hand.limits[entries].T
    found = least_squares(residuals, np.clip(first, low + 1e-6, high - 1e-6), bounds=(low, high), max_nfev=30)
    pose[entries] = found.x
    return turned_home(Stance(pose, begun.reference))
