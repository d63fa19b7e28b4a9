"""The depth image as a picture, with the hand brought out and skeletons over it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from spf.frame import Camera, Frame

__all__ = ["Box", "Skeleton", "box_around", "depth_picture"]

Colour = tuple[int, ...]  # RGB, 0 to 255
_BONES = tuple((0 if i % 4 == 1 else i - 1, i) for i in range(1, 21))
_OUTLINE, _BACKGROUND = (25, 25, 25), (42, 48, 56)
_FRACTION = 4  # bits of a pixel's fraction that OpenCV takes


class Skeleton(NamedTuple):
    """Joints (21, 3) in metres, NaN where unknown, and the colour (RGB, 0 to 255) that they are drawn in."""

    joints: NDArray[np.float64]
    colour: Colour


class Box(NamedTuple):
    """A part of an image, in pixels."""

    left: int
    top: int
    width: int
    height: int


def depth_picture(
    frame: Frame,
    region: NDArray[np.bool_] | None = None,
    skeletons: Sequence[Skeleton] = (),
    *,
    box: Box | None = None,
    width: int = 736,
) -> NDArray[np.uint8]:
    """Return a frame as (height, width, 3) RGB; near is bright.

    Args:
        frame: the depth image.
        region: (H, W) what is the hand: in colour over its own range of depth, all else in grey; None colours everything.
        skeletons: the later over the earlier.
        box: the part to show; None shows all.
        width: of the picture, in pixels; its height follows.
    """
    part = box or Box(0, 0, frame.depth.shape[1], frame.depth.shape[0])
    rows, columns = slice(part.top, part.top + part.height), slice(part.left, part.left + part.width)
    rgb = _coloured(frame.depth, region)[rows, columns]
    scale = width / part.width
    canvas = np.asarray(
        cv2.resize(rgb, (width, round(part.height * scale)), interpolation=cv2.INTER_NEAREST), dtype=np.uint8
    )
    for skeleton in skeletons:
        _draw(canvas, frame.camera, skeleton, part, scale)
    return canvas


def box_around(camera: Camera, points: NDArray[np.float64], *, ratio: float = 4 / 3, margin: float = 0.25) -> Box:
    """Return the part of a camera's image around some points, at most the whole image.

    Args:
        camera: that sees them.
        points: (..., 3) m; those that are NaN or behind the camera count nothing.
        ratio: of width and height.
        margin: around the points, as a share of what they take.
    """
    xyz = points.reshape(-1, 3)
    xyz = xyz[np.isfinite(xyz).all(axis=1) & (xyz[:, 2] > 0)]
    whole = Box(0, 0, camera.width, camera.height)
    if not len(xyz):
        return whole
    pixels = camera.project(xyz)
    low, high = pixels.min(axis=0), pixels.max(axis=0)
    height = max(float(high[1] - low[1]), float(high[0] - low[0]) / ratio) * (1 + 2 * margin)
    height = min(max(height, camera.height / 6), camera.height, camera.width / ratio)
    size = round(height * ratio), round(height)
    left, top = (round(float(middle - side / 2)) for middle, side in zip((low + high) / 2, size, strict=True))
    return Box(min(max(left, 0), camera.width - size[0]), min(max(top, 0), camera.height - size[1]), *size)


def _coloured(depth: NDArray[np.float32], region: NDArray[np.bool_] | None) -> NDArray[np.uint8]:
    seen = depth > 0
    picture = np.full((*depth.shape, 3), _BACKGROUND, np.uint8)
    if not seen.any():
        return picture
    if region is None or not region.any():
        picture[seen] = _cividis(depth, seen)[seen]
        return picture
    near, far = np.percentile(depth[seen], [1, 99])
    grey = 70 + 60 * (1 - np.clip((depth - near) / max(far - near, 1e-3), 0, 1))
    picture[seen] = (grey[..., None] * np.array([0.94, 1.0, 1.08]))[seen].astype(np.uint8)
    hand = region & seen
    if hand.any():
        picture[hand] = _cividis(depth, hand)[hand]
    return picture


def _cividis(depth: NDArray[np.float32], mask: NDArray[np.bool_]) -> NDArray[np.uint8]:
    """Colours that every colour vision orders alike, over the range of depth within a mask."""
    near, far = np.percentile(depth[mask], [1, 99])
    level = 255 * (1 - np.clip((depth - near) / max(far - near, 0.02), 0, 1))
    bgr = cv2.applyColorMap(level.astype(np.uint8), cv2.COLORMAP_CIVIDIS)
    return np.asarray(bgr[:, :, ::-1], dtype=np.uint8)


def _draw(canvas: NDArray[np.uint8], camera: Camera, skeleton: Skeleton, box: Box, scale: float) -> None:
    """Draw bones and joints over a picture enlarged by ``scale``, with an outline that stands out from any colour."""
    joints = skeleton.joints
    known = np.isfinite(joints).all(axis=1) & (joints[:, 2] > 0)
    pixels = np.zeros((len(joints), 2))
    pixels[known] = (camera.project(joints[known]) - [box.left, box.top] + 0.5) * scale - 0.5
    at = np.rint(pixels.clip(-1e4, 1e4) * 2**_FRACTION).astype(int)
    for paint, width, radius in ((_OUTLINE, 5, 6), (skeleton.colour, 2, 4)):
        for first, last in _BONES:
            if known[first] and known[last]:
                ends = (tuple(map(int, at[first])), tuple(map(int, at[last])))
                cv2.line(canvas, *ends, paint, width, cv2.LINE_AA, _FRACTION)
        for joint in np.flatnonzero(known):
            cv2.circle(canvas, tuple(map(int, at[joint])), radius << _FRACTION, paint, -1, cv2.LINE_AA, _FRACTION)
