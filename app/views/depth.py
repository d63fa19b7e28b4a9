"""The depth image with the hand brought out, and the skeleton of the estimate (and of the truth) over it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from app.results import Seen
from app.state import State
from app.views.picture import Picture
from spf.errors import SessionError
from spf.frame import Camera, Frame
from spf.render.palette import PREDICTED

__all__ = ["Depth", "depth_picture"]

Colour = tuple[int, ...]  # RGB, 0 to 255
_WIDTH = 736  # pixels, twice what it takes in the page
_BONES = tuple((0 if i % 4 == 1 else i - 1, i) for i in range(1, 21))
_ESTIMATE, _OUTLINE = (255, 255, 255), (25, 25, 25)  # RGB
_TRUTH = tuple(round(255 * part) for part in PREDICTED)
_BACKGROUND = (42, 48, 56)


class Depth:
    """The pane, with the skeleton of every lane shown."""

    def __init__(self, state: State, mode: str = "one") -> None:
        self._state, self._mode = state, mode
        self.pane = Picture(
            hint="Choose a session to see its depth images.", alt="Depth image", sizing_mode="stretch_both", margin=0
        )
        state.param.watch(self.draw, ["session", "revision", "with_truth"])

    def draw(self, *_events: Any) -> None:
        """Draw the frame shown."""
        state = self._state
        if state.session is None or state.mode != self._mode:
            return
        try:
            frame = state.session[state.frame]
        except SessionError as error:
            state.error = str(error)
            return
        seen = state.entry.seen if state.entry is not None else None
        skeletons = [(frame.truth.joints, _TRUTH)] if state.with_truth and frame.truth is not None else []
        for lane in state.active:
            summary = lane.summary(state.frame)
            if summary is not None and not summary.lost:
                skeletons.append((summary.joints, _ESTIMATE if self._mode == "one" else _rgb(lane.colour)))
        self.pane.image = depth_picture(frame, seen, skeletons)


def depth_picture(
    frame: Frame,
    seen: Seen | None = None,
    skeletons: Sequence[tuple[NDArray[np.float64], Colour]] = (),
) -> bytes:
    """Return a JPEG file of a frame.

    Args:
        frame: the depth image.
        seen: what the tracker took for the hand: in colour, all else in grey; None colours everything.
        skeletons: (joints (21, 3) m, NaN where unknown; colour) of each, the later over the earlier.
    """
    scale = _WIDTH / frame.depth.shape[1]
    rgb = _coloured(frame.depth, None if seen is None else _region(frame, seen))
    size = (_WIDTH, round(frame.depth.shape[0] * scale))
    canvas = np.asarray(cv2.resize(rgb, size, interpolation=cv2.INTER_NEAREST), dtype=np.uint8)
    for joints, colour in skeletons:
        _skeleton(canvas, frame.camera, joints, scale, colour)
    _, encoded = cv2.imencode(".jpg", canvas[:, :, ::-1], [cv2.IMWRITE_JPEG_QUALITY, 90])
    return bytes(encoded)


def _rgb(css: str) -> Colour:
    """A colour ``#rrggbb`` as numbers, lightened so that it stands out from the picture."""
    red, green, blue = (int(css[at : at + 2], 16) for at in (1, 3, 5))
    return tuple(round(0.75 * part + 0.25 * 255) for part in (red, green, blue))


def _region(frame: Frame, seen: Seen) -> NDArray[np.bool_]:
    region = np.zeros(frame.depth.shape, bool)
    height, width = seen.mask.shape
    region[seen.top : seen.top + height, seen.left : seen.left + width] = seen.mask
    return region


def _coloured(depth: NDArray[np.float32], region: NDArray[np.bool_] | None) -> NDArray[np.uint8]:
    """(H, W, 3) RGB: near is bright; the region in colour over its own range of depth, the rest in dim grey."""
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


def _skeleton(
    canvas: NDArray[np.uint8], camera: Camera, joints: NDArray[np.float64], scale: float, colour: Colour
) -> None:
    """Draw bones and joints over a picture enlarged by ``scale``, with an outline that stands out from any colour."""
    fraction = 4  # bits of a pixel's fraction that OpenCV takes
    known = np.isfinite(joints).all(axis=1) & (joints[:, 2] > 0)
    pixels = np.zeros((len(joints), 2))
    pixels[known] = (camera.project(joints[known]) + 0.5) * scale - 0.5
    at = np.rint(pixels.clip(-1e4, 1e4) * 2**fraction).astype(int)
    for paint, width, radius in ((_OUTLINE, 5, 6), (colour, 2, 4)):
        for first, last in _BONES:
            if known[first] and known[last]:
                ends = (tuple(map(int, at[first])), tuple(map(int, at[last])))
                cv2.line(canvas, *ends, paint, width, cv2.LINE_AA, fraction)
        for joint in np.flatnonzero(known):
            cv2.circle(canvas, tuple(map(int, at[joint])), radius << fraction, paint, -1, cv2.LINE_AA, fraction)
