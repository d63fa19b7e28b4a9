"""A run as a film: the depth with the skeleton beside the hand among the observed points, frame by frame."""

from __future__ import annotations

from collections.abc import Iterator
from concurrent.futures import Future
from pathlib import Path
from typing import Any

import cv2
import imageio_ffmpeg
import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import uniform_filter1d

from spf.errors import RunError, SettingError
from spf.export.pictures import VIEWS, View, hand_scene, row_skeletons, view_around
from spf.export.writing import written_whole
from spf.frame import Frame
from spf.progress import Report
from spf.render import Renderer, ViewCamera, depth_picture
from spf.runs import Run
from spf.sessions import Session
from spf.trackfile import Track

__all__ = ["write_film"]

Array = NDArray[np.float64]
_BAR = 36  # pixels of the line of text
_DARK, _LIGHT, _LOST = (25, 29, 34), (222, 227, 232), (255, 150, 90)
_ROOM = 1.05  # of the joints: the skin reaches beyond them
_STEADY = 15  # frames over which the eye's movement is evened out
_MULTIPLE = 16  # sides of a film are multiples of it, so that every player takes them


def write_film(
    run: Run,
    session: Session,
    path: Path,
    renderer: Renderer,
    *,
    view: View = VIEWS["sensor"],
    height: int = 480,
    speed: float = 1.0,
    progress: Report | None = None,
) -> None:
    """Write a run as an MP4 file (H.264), at the session's own pace.

    Args:
        run: track and hand.
        session: that was tracked.
        path: that ends in ``.mp4``.
        renderer: draws the frames.
        view: side that the hand is seen from; the eye follows it evenly.
        height: of the pictures, in pixels; two of 4:3 stand beside each other.
        speed: times the session's own pace.
        progress: called with what is being done and the share done; an error that it raises ends the film, and no file
            is left.

    Raises:
        RunError: nothing was tracked, or the file cannot be written.
        SettingError: the ending or a number is out of range.
        SessionError: a frame cannot be read.
        RenderError: a frame could not be drawn.
    """
    if path.suffix != ".mp4":
        raise SettingError(f"A film is written as .mp4, not as '{path.suffix}': name {path} otherwise.")
    if not 96 <= height <= 1440 or not 0.05 <= speed <= 20:
        raise SettingError("A film is 96 to 1440 pixels high, and goes at 0.05 to 20 times the pace of its session.")
    if not len(run.track):
        raise RunError("The run has tracked no frame: track the session again.")
    renderer.opengl().result()  # says at once that this machine cannot draw
    size = (round(height * 4 / 3 / _MULTIPLE) * _MULTIPLE, height // _MULTIPLE * _MULTIPLE)
    whole = (2 * size[0], -(-(size[1] + _BAR) // _MULTIPLE) * _MULTIPLE)
    with written_whole(path) as part:
        writer = imageio_ffmpeg.write_frames(
            str(part), whole, fps=speed * pace_of(run.track), codec="libx264", quality=7,
            macro_block_size=_MULTIPLE, output_params=["-movflags", "+faststart"],
        )  # fmt: skip
        try:
            writer.send(None)
            for row, picture in enumerate(_pictures(run, session, renderer, view, size, whole)):
                writer.send(np.ascontiguousarray(picture))
                if progress is not None:
                    progress("Writing the film", (row + 1) / len(run.track))
        finally:
            writer.close()


def pace_of(track: Track) -> float:
    """Return the frames per second of a track: 30 where its times do not say."""
    steps = np.diff(track.time)
    return float(1.0 / np.median(steps)) if len(steps) and np.median(steps) > 0 else 30.0


def _pictures(
    run: Run, session: Session, renderer: Renderer, view: View, size: tuple[int, int], whole: tuple[int, int]
) -> Iterator[NDArray[np.uint8]]:
    """The frames of a film; one is drawn while the one before is being put together."""
    track, lens = run.track, run.plan.start.shape.lens
    cameras = _steady_views(track, view)
    ahead: tuple[int, Frame, Future[Any]] | None = None
    for row, index in enumerate(track.frame):
        frame = session[int(index)]
        drawn = renderer.submit(hand_scene(run.hand_at(row), track, row, frame, lens), cameras[row], size)
        if ahead is not None:
            yield _composed(run, *ahead[:2], ahead[2].result(), size, whole)
        ahead = row, frame, drawn
    if ahead is not None:
        yield _composed(run, *ahead[:2], ahead[2].result(), size, whole)


def _steady_views(track: Track, view: View) -> list[ViewCamera]:
    """One view a frame: of one size that the hand stays in, around a centre that moves evenly."""
    centres = uniform_filter1d(track.joints.mean(axis=1), _STEADY, axis=0, mode="nearest")
    reach = np.linalg.norm(track.joints - centres[:, None], axis=2).max(axis=1)
    base = view_around(track.joints[0], view)
    extent = max(2 * _ROOM * float(np.percentile(reach, 95)), base.extent)
    distance = float(np.median(np.linalg.norm(centres, axis=1)))
    return [
        base._replace(focal_point=(float(x), float(y), float(z)), extent=extent, distance=distance)
        for x, y, z in centres
    ]


def _composed(
    run: Run,
    row: int,
    frame: Frame,
    render: NDArray[np.uint8],
    size: tuple[int, int],
    whole: tuple[int, int],
) -> NDArray[np.uint8]:
    canvas = np.empty((whole[1], whole[0], 3), np.uint8)
    canvas[:] = _DARK
    depth = depth_picture(frame, skeletons=row_skeletons(run.track, row, frame), width=size[0])
    depth = _fitted(depth, size)
    canvas[: size[1], : size[0]], canvas[: size[1], size[0] :] = depth, render
    lost = bool(run.track.lost[row])
    text = f"{run.manifest['session']['name']}   {run.plan.tracker}   frame {frame.index}   {frame.time:.2f} s"
    text += "   hand lost" if lost else ""
    at = (12, size[1] + 24)
    cv2.putText(canvas, text, at, cv2.FONT_HERSHEY_SIMPLEX, 0.55, _LOST if lost else _LIGHT, 1, cv2.LINE_AA)
    return canvas


def _fitted(picture: NDArray[np.uint8], size: tuple[int, int]) -> NDArray[np.uint8]:
    """A picture as large as it fits into a size, in the middle of it."""
    height, width = picture.shape[:2]
    scale = min(size[0] / width, size[1] / height)
    inner = min(round(width * scale), size[0]), min(round(height * scale), size[1])
    canvas = np.empty((size[1], size[0], 3), np.uint8)
    canvas[:] = _DARK
    left, top = (size[0] - inner[0]) // 2, (size[1] - inner[1]) // 2
    canvas[top : top + inner[1], left : left + inner[0]] = cv2.resize(picture, inner, interpolation=cv2.INTER_AREA)
    return canvas
