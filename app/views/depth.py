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
from spf.frame import Frame
from spf.render import Skeleton, depth_picture
from spf.render.palette import PREDICTED

__all__ = ["Depth", "depth_jpeg"]

Colour = tuple[int, ...]  # RGB, 0 to 255
_WIDTH = 736  # pixels, twice what it takes in the page
_ESTIMATE = (255, 255, 255)  # RGB
_TRUTH = tuple(round(255 * part) for part in PREDICTED)


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
        skeletons = [Skeleton(frame.truth.joints, _TRUTH)] if state.with_truth and frame.truth is not None else []
        for lane in state.active:
            summary = lane.summary(state.frame)
            if summary is not None and not summary.lost:
                colour = _ESTIMATE if self._mode == "one" else _rgb(lane.colour)
                skeletons.append(Skeleton(summary.joints, colour))
        self.pane.image = depth_jpeg(frame, seen, skeletons)


def depth_jpeg(frame: Frame, seen: Seen | None = None, skeletons: Sequence[Skeleton] = ()) -> bytes:
    """Return a JPEG file of a frame.

    Args:
        frame: the depth image.
        seen: what the tracker took for the hand: in colour, all else in grey; None colours everything.
        skeletons: the later over the earlier.
    """
    picture = depth_picture(frame, None if seen is None else _region(frame, seen), skeletons, width=_WIDTH)
    _, encoded = cv2.imencode(".jpg", picture[:, :, ::-1], [cv2.IMWRITE_JPEG_QUALITY, 90])
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
