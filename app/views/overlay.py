"""A posed hand over a depth image: its outline, its bones, and where it lies in front of the surface seen or behind it."""

from __future__ import annotations

from typing import Any, NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from spf.errors import SessionError
from spf.frame import Camera, Frame
from spf.hand.handles import Stance
from spf.hand.kinematics import pose_hand
from spf.hand.model import Hand
from spf.kernels.render import project_vertices, rasterise
from spf.observation import camera_numbers, observe
from spf.render import depth_picture
from spf.segmentation import find_regions
from spf.sessions import Session

__all__ = ["BEHIND", "BONES", "IN_FRONT", "Overlay", "focus_of", "lines_of", "overlay_of", "picture_of"]

#: Joints that are joined by a line, wrist first.
BONES = tuple((0 if joint % 4 == 1 else joint - 1, joint) for joint in range(1, 21))

#: RGB of the model where it lies in front of the surface seen, and behind it.
IN_FRONT, BEHIND = (255, 92, 168), (64, 208, 255)

_CLOSE = 0.010  # m within which the model lies on the surface
_WIDTH = 736  # pixels of the picture at least
_ROOM = 0.12  # around the hand, as a share of what it takes
_FAR = 1e8  # depth from which a rasterised pixel shows nothing


class Overlay(NamedTuple):
    """What is laid over the picture; see :class:`app.views.sheet.Sheet`."""

    lines: list[dict[str, Any]]
    tint: bytes
    box: list[float]


def picture_of(session: Session, index: int) -> bytes:
    """Return a frame as a JPEG file, what may be the hand in colour.

    Raises:
        SessionError: the frame cannot be read.
    """
    frame = session[index]
    regions, region = find_regions(frame, most=1), None
    if regions:
        seen = observe(frame, regions[0].centre, regions[0].radius)
        region = np.zeros(frame.depth.shape, bool)
        height, width = seen.depth.shape
        region[seen.top : seen.top + height, seen.left : seen.left + width] = seen.depth > 0
    factor = -(-_WIDTH // frame.camera.width)
    picture = depth_picture(frame, region, width=factor * frame.camera.width)
    done, encoded = cv2.imencode(".jpg", picture[:, :, ::-1], [cv2.IMWRITE_JPEG_QUALITY, 92])
    if not done:
        raise SessionError(f"Frame {index} of {session.name} is too large to be shown.")
    return bytes(encoded)


def focus_of(session: Session, index: int) -> list[float]:
    """Return left, top, width and height, pixels, of the part of a frame in which the hand may be; [] where none is seen.

    Raises:
        SessionError: the frame cannot be read.
    """
    frame = session[index]
    regions = find_regions(frame, most=1)
    if not regions:
        return []
    pixels = frame.camera.project(regions[0].points)
    low, high = pixels.min(axis=0), pixels.max(axis=0)
    margin = _ROOM * float((high - low).max())
    return [*(low - margin).tolist(), *(high - low + 2 * margin).tolist()]


def overlay_of(hand: Hand, stance: Stance, frame: Frame) -> Overlay:
    """Return outline, bones and tint of a posed hand.

    Args:
        hand, stance: the posed hand.
        frame: as the camera that the hand is posed for takes it.
    """
    posed = pose_hand(hand, *stance)
    rendered = _rendered(posed.vertices, hand, frame.camera)
    shown = rendered < _FAR
    lines = _outline(shown) + lines_of(posed.joints, frame.camera, "bone")
    rows, columns = np.flatnonzero(shown.any(axis=1)), np.flatnonzero(shown.any(axis=0))
    if not len(rows):
        return Overlay(lines, b"", [])
    part = slice(rows[0], rows[-1] + 1), slice(columns[0], columns[-1] + 1)
    tint = _tint(rendered[part], frame.depth[part])
    _, encoded = cv2.imencode(".png", cv2.cvtColor(tint, cv2.COLOR_RGBA2BGRA), [cv2.IMWRITE_PNG_COMPRESSION, 1])
    height, width = tint.shape[:2]
    return Overlay(lines, bytes(encoded), [float(columns[0]) - 0.5, float(rows[0]) - 0.5, float(width), float(height)])


def lines_of(joints: NDArray[np.float64], camera: Camera, kind: str) -> list[dict[str, Any]]:
    """Return the bones of joints (21, 3) that are known (not NaN) and in front of the camera, as lines of the picture."""
    known = np.isfinite(joints).all(axis=1) & (joints[:, 2] > 0)
    pixels = np.zeros((len(joints), 2))
    pixels[known] = camera.project(joints[known])
    return [
        {"points": pixels[[first, last]].round(2).tolist(), "kind": kind}
        for first, last in BONES
        if known[first] and known[last]
    ]


def _rendered(vertices: NDArray[np.float64], hand: Hand, camera: Camera) -> NDArray[np.float32]:
    projected = np.empty((len(vertices), 3), np.float32)
    depth = np.empty((camera.height, camera.width), np.float32)
    project_vertices(vertices, camera_numbers(camera), projected)
    rasterise(projected, hand.faces, depth)
    return depth


def _outline(shown: NDArray[np.bool_]) -> list[dict[str, Any]]:
    found, _ = cv2.findContours(shown.astype(np.uint8), cv2.RETR_CCOMP, cv2.CHAIN_APPROX_SIMPLE)
    loops = (contour.reshape(-1, 2).tolist() for contour in found if len(contour) > 2)
    return [{"points": [*loop, loop[0]], "kind": "outline"} for loop in loops]


def _tint(rendered: NDArray[np.float32], seen: NDArray[np.float32]) -> NDArray[np.uint8]:
    """(h, w, 4) RGBA: clear on the surface and beside the hand, coloured in front of the surface and behind it."""
    tint = np.zeros((*rendered.shape, 4), np.uint8)
    known = (rendered < _FAR) & (seen > 0)
    apart = np.where(known, seen - rendered, 0.0)
    tint[known & (apart > _CLOSE)] = (*IN_FRONT, 120)
    tint[known & (apart < -_CLOSE)] = (*BEHIND, 120)
    return tint
