"""A few hundred right hands of different people, as flat arrays for the generator's kernel."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from spf.hand.kinematics import joints_of, pose_hand
from spf.hand.model import MIRROR, Hand, load_hand
from spf.hand.shape import HandShape
from spf.kernels.samples import ShapeArrays
from spf.training.articulations import draw_articulations

__all__ = ["ShapeTable", "make_shapes", "size_of"]

Array = NDArray[np.float64]


class ShapeTable(NamedTuple):
    """K shapes.

    Attributes:
        arrays: for the kernel; its faces are those of the hand alone.
        sizes: (K,) of each, relative to the bundled mesh; see :func:`size_of`.
        lengths: (K,) m, wrist to middle tip.
        wrists: (K, 3) m, the wrist in the model's frame.
        wrist_radii: (K, 2) m, half width and half thickness of the wrist.
        wrist_middles: (K, 3) m, middle of the wrist's section in the model's frame.
        left: (K, V, 3) m, skins of left hands of these shapes, each posed in some way, in their palms' frames.
    """

    arrays: ShapeArrays
    sizes: Array
    lengths: Array
    wrists: Array
    wrist_radii: Array
    wrist_middles: Array
    left: Array


def size_of(hand: Hand) -> float:
    """Return the size of a hand relative to the bundled mesh: s that minimises Σ ‖J − s J_bundled‖² in the bind pose."""
    bundled = load_hand("right")
    standard = joints_of(bundled, bundled.neutral_pose())
    return float((joints_of(hand, hand.neutral_pose()) * standard).sum() / (standard * standard).sum())


def _random_shape(rng: np.random.Generator) -> HandShape:
    """A hand of anyone: the scale is drawn near 1, for a crop shows proportions only."""
    digits = rng.normal(1.0, 0.06) * rng.normal(1.0, 0.05, 5)
    lengths = np.repeat(digits, 3) * rng.normal(1.0, 0.03, 15)
    width, depth = rng.normal(1.0, 0.09, 2).clip(0.75, 1.3)
    thickness = np.clip(rng.normal(1.06, 0.14), 0.75, 1.5)
    return HandShape(
        "right",
        float(rng.uniform(0.85, 1.15)),
        tuple(float(x) for x in lengths.clip(0.75, 1.3)),
        palm_width=float(width),
        palm_thickness=float(depth),
        finger_thickness=float(thickness),
    )


def make_shapes(count: int, seed: int) -> ShapeTable:
    """Make a table of random shapes; the same count and seed give the same table."""
    rng = np.random.default_rng([seed, 1])
    hands = [_random_shape(rng).hand() for _ in range(count)]
    first = hands[0]
    arrays = ShapeArrays(
        skeleton=first.skeleton,
        skin=first.skin,
        rests=np.array([hand.skeleton.rest for hand in hands]),
        shares=np.array([hand.skin.shares for hand in hands]),
        joint_offsets=np.array([hand.joint_offset for hand in hands]),
        joint_bone=first.joint_bone,
        faces=first.faces,
    )
    sections = [_wrist_section(hand) for hand in hands]
    return ShapeTable(
        arrays,
        np.array([size_of(hand) for hand in hands]),
        np.array([hand.length for hand in hands]),
        np.array([hand.skeleton.bind[0, :, 3] for hand in hands]),
        np.array([radii for radii, _ in sections]),
        np.array([middle for _, middle in sections]),
        np.array(
            [_mirrored_skin(hand, angles) for hand, angles in zip(hands, draw_articulations(rng, count), strict=True)]
        ),
    )


def _mirrored_skin(hand: Hand, angles: Array) -> Array:
    """Skin (V, 3) of the left hand whose mirror image is a right one, m, in the palm's frame."""
    pose = hand.neutral_pose()
    pose[:3], pose[6:] = 0.0, angles
    return pose_hand(hand, pose, np.eye(3)).vertices * MIRROR


def _wrist_section(hand: Hand) -> tuple[Array, Array]:
    """Half width and half thickness (2,), and middle (3,), of the hand's section at the wrist, model frame, m."""
    wrist = hand.skeleton.bind[0, :, 3]
    near = np.abs(hand.skin.vertices[:, 2] - wrist[2]) < 0.05 * hand.length
    low, high = hand.skin.vertices[near].min(axis=0), hand.skin.vertices[near].max(axis=0)
    middle = 0.5 * (low + high)
    return 0.5 * (high - low)[:2], np.array([middle[0], middle[1], wrist[2]])
