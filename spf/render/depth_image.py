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
_LEVELS = np.arange(256, dtype=np.uint8)[:, None]
#: RGB by brightness, (256, 1, 3): one that every colour vision orders alike, and a quiet grey.
_CIVIDIS: NDArray[np.uint8] = np.ascontiguousarray(cv2.applyColorMap(_LEVELS, cv2.COLORMAP_CIVIDIS)[..., ::-1]).astype(
    np.uint8
)
_GREY = ((70 + 60 * np.linspace(0, 1, 256))[:, None, None] * (0.94, 1.0, 1.08)).astype(np.uint8)


class Skeleton(NamedTuple):
    """A hand's skeleton.

    Attributes:
        joints: (21, 3) m, NaN where unknown.
        colour: RGB, 0 to 255, that it is drawn in.
        around: (21, 3, 3) m², of each joint A with ``eᵀ A⁻¹ e = 1`` drawn around it, in the picture; None for none.
    """

    joints: NDArray[np.float64]
    colour: Colour
    around: NDArray[np.float64] | None = None


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
    scale = width / part.width
    every = max(1, round(1 / scale))  # pixels that the picture has no room for need no colour
    rows, columns = (
        slice(first, first + length, every) for first, length in ((part.top, part.height), (part.left, part.width))
    )
    rgb = _coloured(frame.depth[rows, columns], None if region is None else region[rows, columns])
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
    picture = np.empty((*depth.shape, 3), np.uint8)
    picture[:] = _BACKGROUND
    if not seen.any():
        return picture
    if region is None or not region.any():
        return _painted(picture, seen, depth, seen, _CIVIDIS)
    picture = _painted(picture, seen, depth, seen, _GREY, least=1e-3)
    hand = region & seen
    return _painted(picture, hand, depth, hand, _CIVIDIS) if hand.any() else picture


def _painted(
    picture: NDArray[np.uint8],
    where: NDArray[np.bool_],
    depth: NDArray[np.float32],
    span: NDArray[np.bool_],
    palette: NDArray[np.uint8],
    least: float = 0.02,
) -> NDArray[np.uint8]:
    """Paint what is in a mask by its depth; the palette goes over the range of depth in it, at least ``least`` metres."""
    near, far = np.percentile(depth[span], [1, 99])
    reach = max(float(far - near), least)
    level = cv2.convertScaleAbs(np.clip(near + reach - depth, 0, reach), alpha=255 / reach)
    coloured = cv2.applyColorMap(level, palette)
    return np.asarray(cv2.copyTo(coloured, where.astype(np.uint8), picture), dtype=np.uint8)


def _draw(canvas: NDArray[np.uint8], camera: Camera, skeleton: Skeleton, box: Box, scale: float) -> None:
    """Draw bones and joints over a picture enlarged by ``scale``, with an outline that stands out from any colour."""
    joints = skeleton.joints
    known = np.isfinite(joints).all(axis=1) & (joints[:, 2] > 0)
    pixels = np.zeros((len(joints), 2))
    pixels[known] = (camera.project(joints[known]) - [box.left, box.top] + 0.5) * scale - 0.5
    at = np.rint(pixels.clip(-1e4, 1e4) * 2**_FRACTION).astype(int)
    if skeleton.around is not None:
        for joint in np.flatnonzero(known):
            _draw_around(canvas, camera, joints[joint], skeleton.around[joint], at[joint], scale, skeleton.colour)
    for paint, width, radius in ((_OUTLINE, 5, 6), (skeleton.colour, 2, 4)):
        for first, last in _BONES:
            if known[first] and known[last]:
                ends = (tuple(map(int, at[first])), tuple(map(int, at[last])))
                cv2.line(canvas, *ends, paint, width, cv2.LINE_AA, _FRACTION)
        for joint in np.flatnonzero(known):
            cv2.circle(canvas, tuple(map(int, at[joint])), radius << _FRACTION, paint, -1, cv2.LINE_AA, _FRACTION)


def _draw_around(
    canvas: NDArray[np.uint8], camera: Camera, joint: NDArray[np.float64], around: NDArray[np.float64],
    at: NDArray[np.int_], scale: float, colour: Colour,
) -> None:  # fmt: skip
    """Draw the ellipse of a joint's matrix around its place ``at`` in the picture, which is in fractions of a pixel."""
    steps = 1e-4 * np.eye(3)
    slopes = (camera.project(joint + steps) - camera.project(joint - steps)).T / 2e-4  # (2, 3) pixels a metre
    variances, axes = np.linalg.eigh(slopes @ around @ slopes.T)
    half = tuple(int(length * scale * 2**_FRACTION) for length in np.sqrt(variances[::-1].clip(0.0, 1e8)))
    angle = float(np.degrees(np.arctan2(axes[1, 1], axes[0, 1])))
    for paint, width in ((_OUTLINE, 3), (colour, 1)):
        cv2.ellipse(canvas, tuple(map(int, at)), half, angle, 0.0, 360.0, paint, width, cv2.LINE_AA, _FRACTION)
