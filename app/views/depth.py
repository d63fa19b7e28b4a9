"""The depth image with the hand brought out, and the skeleton of the estimate (and of the truth) over it."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Sequence
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from app.results import Entry, Seen, seen_again
from app.state import State
from app.views.picture import Picture
from app.views.three_d import ThreeD
from spf.errors import SessionError
from spf.filters.smart import SpfSettings
from spf.filters.uncertainty import reach_of_share, uncertainty_of
from spf.frame import Frame
from spf.lens import as_stated
from spf.render import Skeleton, depth_picture
from spf.render.palette import PREDICTED

__all__ = ["SHARE", "Depth", "around_joints", "depth_jpeg"]

SHARE = 0.9  # of the joints that are within what is drawn around them

Colour = tuple[int, ...]  # RGB, 0 to 255
_WIDTH, _QUICK_WIDTH = 736, 368  # pixels: twice what it takes in the page, and once while playing
_ESTIMATE = (255, 255, 255)  # RGB
_TRUTH = tuple(round(255 * part) for part in PREDICTED)


class Depth:
    """The pane, with the skeleton of every lane shown; drawn beside the event loop, the newest wins.

    Args:
        state: of the page.
        pictures: that are seen beside it, and come in the same message.
        mode: of the page that it is seen in.
    """

    def __init__(self, state: State, pictures: ThreeD, mode: str = "one") -> None:
        self._state, self._pictures, self._mode = state, pictures, mode
        self._wanted = False
        self._drawing: asyncio.Task[None] | None = None
        self.pane = Picture(
            hint="Choose a session to see its depth images.", alt="Depth image", sizing_mode="stretch_both", margin=0
        )
        state.param.watch(self.draw, ["session", "revision", "with_truth", "with_spread", "playing"])
        state.look.param.watch(self.draw, "tab")

    def draw(self, *_events: Any) -> None:
        """Have the frame shown drawn, if it is seen."""
        state = self._state
        if state.session is None or state.mode != self._mode or (self._mode == "one" and state.look.tab != "overview"):
            return
        self._wanted = True
        if self._drawing is None or self._drawing.done():
            self._drawing = asyncio.get_running_loop().create_task(self._draw())

    async def _draw(self) -> None:
        while self._wanted:
            self._wanted = False
            try:
                asked = self._pictures.asked
                self._pictures.bring(self.pane, await asyncio.to_thread(self._work()), asked)
            except SessionError as error:
                self._state.error = str(error)

    def _work(self) -> Callable[[], bytes]:
        """What there is to draw, fixed as it is now."""
        state = self._state
        session, index, with_truth, entry = state.session, state.frame, state.with_truth, state.entry
        assert session is not None
        width = _QUICK_WIDTH if state.playing else _WIDTH
        seen = entry.seen if entry is not None else None
        spread = entry if state.with_spread and self._mode == "one" else None
        shown = [(lane.colour, lane.summary(index)) for lane in state.active]
        estimates = [
            Skeleton(summary.joints, _rgb(colour) if self._mode == "compare" else _ESTIMATE)
            for colour, summary in shown
            if summary is not None and not summary.lost
        ]

        def work() -> bytes:
            frame = session[index]
            truth = [Skeleton(frame.truth.joints, _TRUTH)] if with_truth and frame.truth is not None else []
            around = None if spread is None else around_joints(spread, frame)
            return depth_jpeg(frame, seen, [*truth, *(one._replace(around=around) for one in estimates)], width)

        return work


def around_joints(entry: Entry, frame: Frame) -> NDArray[np.float64] | None:
    """Return the matrices (21, 3, 3), m², whose ellipses in the picture hold nine in ten of the joints.

    None where the hand is lost, and of a tracker whose uncertainty is not known.
    """
    info, tracking = entry.result.info, entry.shaped
    if info is None or not isinstance(tracking.settings, SpfSettings):
        return None
    said = uncertainty_of(tracking.hand, seen_again(entry, frame), info, tracking.settings)
    lens = tracking.start.shape.lens
    stated = np.diag(as_stated(np.ones(3), lens))
    return np.asarray(reach_of_share(SHARE, 2) ** 2 * (stated @ said.joints @ stated))


def depth_jpeg(
    frame: Frame, seen: Seen | None = None, skeletons: Sequence[Skeleton] = (), width: int = _WIDTH
) -> bytes:
    """Return a JPEG file of a frame.

    Args:
        frame: the depth image.
        seen: what the tracker took for the hand: in colour, all else in grey; None colours everything.
        skeletons: the later over the earlier.
        width: of the picture, pixels.
    """
    picture = depth_picture(frame, None if seen is None else _region(frame, seen), skeletons, width=width)
    _, encoded = cv2.imencode(".jpg", picture[:, :, ::-1], [cv2.IMWRITE_JPEG_QUALITY, 90])
    return bytes(encoded)


def _rgb(css: str) -> Colour:
    """A colour ``#rrggbb`` as numbers, lightened so that it stands out from the picture."""
    red, green, blue = (int(css[at : at + 2], 16) for at in (1, 3, 5))
    return tuple(round(0.75 * part + 0.25 * 255) for part in (red, green, blue))


def _region(frame: Frame, seen: Seen) -> NDArray[np.bool_]:
    region = np.zeros(frame.depth.shape, bool)
    mask = seen.mask
    height, width = mask.shape
    region[seen.top : seen.top + height, seen.left : seen.left + width] = mask
    return region
