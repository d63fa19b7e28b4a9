"""Faults that hit the hand itself, as in the paper's Fig. 2: a phalanx missing, a finger pushed into the scene."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from spf.frame import Camera
from spf.hand.kinematics import PosedHand
from spf.hand.model import BONES, Hand
from spf.kernels.render import FAR, project_vertices, rasterise
from spf.synthetic.solids import camera_numbers

__all__ = ["Fault", "apply_fault", "draw_fault"]

Image = NDArray[np.float32]

_LASTS = 8  # frames
_SAME_SURFACE = 1e-4  # m


class Fault(NamedTuple):
    """A fault of a stretch of frames.

    Attributes:
        missing: bone that gives no reading, or -1.
        pushed: digit (1 thumb … 5 little) that reads too far away, or -1.
        depth: m by which its tip is pushed; its root stays.
    """

    missing: int = -1
    pushed: int = -1
    depth: float = 0.0


def draw_fault(seed: int, frame: int, missing_phalanx: float, pushed_finger: float) -> Fault:
    """Draw the fault of a frame; it lasts for a stretch of eight frames.

    Args:
        seed: of the session.
        frame: which frame.
        missing_phalanx, pushed_finger: fraction of the stretches that have it.
    """
    rng = np.random.default_rng([seed, 3, frame // _LASTS])
    lots, bone, digit, depth = rng.random(2), int(rng.integers(1, len(BONES))), int(rng.integers(1, 6)), rng.random()
    return Fault(
        missing=bone if lots[0] < missing_phalanx else -1,
        pushed=digit if lots[1] < pushed_finger else -1,
        depth=0.02 + 0.04 * depth,
    )


def apply_fault(fault: Fault, depth: Image, hand: Hand, posed: PosedHand, camera: Camera) -> Image:
    """Apply a fault to a clean depth map (H, W)."""
    result = depth
    if fault.pushed >= 0:
        seen, root_to_tip = _visible_part(hand, posed, camera, depth, _digit_bones(fault.pushed))
        result = np.where(seen, result + np.float32(fault.depth) * root_to_tip, result)
    if fault.missing >= 0:
        seen, _ = _visible_part(hand, posed, camera, depth, [fault.missing])
        result = np.where(seen, np.float32(0.0), result)
    return result


def _digit_bones(digit: int) -> list[int]:
    return list(range(3 * digit - 2, 3 * digit + 1))


def _visible_part(
    hand: Hand, posed: PosedHand, camera: Camera, depth: Image, bones: list[int]
) -> tuple[NDArray[np.bool_], Image]:
    """Pixels that show the skin of some bones, and how far (0-1) each is from the part's root to its tip."""
    owner = hand.skin.influence_bone[:, 0]
    part = hand.faces[np.isin(owner[hand.faces], bones).sum(axis=1) >= 2]
    projected = np.empty((len(posed.vertices), 3), np.float32)
    project_vertices(posed.vertices, camera_numbers(camera), projected)
    drawn = np.empty_like(depth)
    rasterise(projected, np.ascontiguousarray(part), drawn)
    seen = (drawn < FAR) & (np.abs(drawn - depth) < _SAME_SURFACE)
    root = camera.project(posed.frames[bones[0], :, 3])
    tip = camera.project(posed.frames[bones[-1], :, 3])
    along = tip - root
    v, u = np.mgrid[: depth.shape[0], : depth.shape[1]].astype(np.float32)
    fraction = ((u - root[0]) * along[0] + (v - root[1]) * along[1]) / max(float(along @ along), 1.0)
    return seen, np.clip(fraction, 0.0, 1.0).astype(np.float32)
