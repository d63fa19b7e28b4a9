"""Pictures of a frame of a run: the hand among the observed points from any side, and its skeleton over the depth."""

from __future__ import annotations

import math
from pathlib import Path
from typing import NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from spf.errors import RunError, SettingError
from spf.evaluate import beyond_wrist, surface_distances
from spf.export.writing import written_whole
from spf.frame import Frame
from spf.hand.kinematics import pose_hand
from spf.hand.model import Hand
from spf.lens import as_stated, seen_through
from spf.locate import reach_of
from spf.observation import observe
from spf.render import Points, Renderer, Scene, Skeleton, ViewCamera, reconstruction_scene
from spf.render.palette import OBSERVED, PREDICTED, RESIDUAL
from spf.runs import Run
from spf.sessions import Session
from spf.trackfile import Track

__all__ = [
    "VIEWS",
    "View",
    "encoded",
    "hand_scene",
    "hand_view",
    "row_of_frame",
    "row_skeletons",
    "view_around",
    "write_picture",
]

Array = NDArray[np.float64]
_POINTS_AT_MOST = 4000  # whose distance from the hand is measured
_ROOM = 1.25  # of the joints' extent: the skin reaches beyond them
_AROUND = 0.25  # m around the last place of a lost hand, of what is shown

#: Colours of skeletons, RGB: the estimate, the same while it is given up as lost, the truth.
ESTIMATE = (255, 255, 255)
GIVEN_UP, TRUTH = (tuple(round(255 * part) for part in colour) for colour in (RESIDUAL, PREDICTED))


class View(NamedTuple):
    """A side that a hand is seen from: angles in radians from the sensor's own view, and a magnification."""

    azimuth: float = 0.0
    elevation: float = 0.0
    zoom: float = 1.0


#: Sides by name.
VIEWS = {
    "sensor": View(),
    "side": View(azimuth=math.radians(75.0)),
    "other-side": View(azimuth=math.radians(-75.0)),
    "top": View(elevation=math.radians(80.0)),
    "oblique": View(azimuth=math.radians(40.0), elevation=math.radians(25.0)),
}


def row_of_frame(track: Track, frame: int) -> int:
    """Return the row of a frame in a track.

    Raises:
        RunError: the frame was not tracked.
    """
    found = np.flatnonzero(track.frame == frame)
    if not len(found):
        raise RunError(
            f"Frame {frame} was not tracked: choose one of {int(track.frame[0])} to {int(track.frame[-1])}."
            if len(track)
            else "The run has tracked no frame: track the session again."
        )
    return int(found[0])


def hand_scene(hand: Hand, track: Track, row: int, frame: Frame, lens: float = 1.0) -> Scene:
    """Show the hand of a frame among the observed points, the redder the farther from it; without hand while it is lost.

    Args:
        hand: the calibrated hand of the run.
        track: of the run.
        row: of the frame in the track.
        frame: its depth image.
        lens: that the hand was found through (:mod:`spf.lens`); all is shown where the stated camera puts it.
    """
    pose, reference = track.poses[row], track.references[row]
    if track.lost[row]:
        points = _points_around(frame, track.joints[row].mean(axis=0))
        return Scene(points=(Points(points.astype(np.float32), OBSERVED),))
    posed = pose_hand(hand, pose, reference)
    points = _thinned(observe(seen_through(frame, lens), pose[:3], reach_of(hand)).hand_points)
    vertices = as_stated(posed.vertices, lens)
    if not len(points):
        return reconstruction_scene(vertices, hand.faces)
    distances = surface_distances(points, np.asarray(posed.vertices, np.float64), hand.faces)
    distances[beyond_wrist(points - posed.frames[0, :, 3], posed.frames[0, :, 2])] = 0.0  # the model has no forearm
    return reconstruction_scene(vertices, hand.faces, points=as_stated(points, lens), residuals=distances)


def _points_around(frame: Frame, place: Array) -> Array:
    v, u = np.nonzero(frame.depth > 0)
    points = frame.camera.back_project(u, v, frame.depth[v, u])
    return _thinned(points[np.linalg.norm(points - place, axis=1) < _AROUND])


def _thinned(points: Array) -> Array:
    """At most so many of some points, chosen at random: every k-th of an image's pixels makes stripes."""
    if len(points) <= _POINTS_AT_MOST:
        return points
    return points[np.random.default_rng(0).choice(len(points), _POINTS_AT_MOST, replace=False)]


def view_around(joints: Array, view: View) -> ViewCamera:
    """Return a view of joints (…, 3) in metres, which just fit in."""
    camera = ViewCamera.from_sensor(joints)
    return camera._replace(extent=_ROOM * camera.extent, azimuth=view.azimuth, elevation=view.elevation, zoom=view.zoom)


def hand_view(track: Track, row: int, view: View) -> ViewCamera:
    """Return a view of the hand of a frame."""
    return view_around(track.joints[row], view)


def row_skeletons(track: Track, row: int, frame: Frame) -> list[Skeleton]:
    """Return the skeletons of a frame: the truth where there is one, and the estimate unless it is lost."""
    truth = [Skeleton(frame.truth.joints, TRUTH)] if frame.truth is not None else []
    return truth if track.lost[row] else [*truth, Skeleton(track.joints[row], ESTIMATE)]


def encoded(picture: NDArray[np.uint8], ending: str, quality: int = 88) -> bytes:
    """Return an RGB picture (H, W, 3) as the bytes of a file that ends in ``.png`` or ``.jpg``."""
    options = [cv2.IMWRITE_JPEG_QUALITY, quality] if ending == ".jpg" else []
    _, file = cv2.imencode(ending, picture[:, :, ::-1], options)
    return bytes(file)


def write_picture(
    run: Run,
    session: Session,
    frame: int,
    path: Path,
    renderer: Renderer,
    *,
    view: View = VIEWS["sensor"],
    size: tuple[int, int] = (1280, 960),
) -> None:
    """Write a picture of the hand of a frame among the observed points.

    Args:
        run: track and hand.
        session: that was tracked.
        frame: index in the session.
        path: that ends in ``.png`` or ``.jpg``.
        renderer: draws it.
        view: side that it is seen from.
        size: (width, height) in pixels.

    Raises:
        RunError: the frame was not tracked, or the file cannot be written.
        SettingError: the ending is another.
        SessionError: the frame cannot be read.
        RenderError: it could not be drawn.
    """
    if path.suffix not in (".png", ".jpg"):
        raise SettingError(f"A picture is written as .png or .jpg, not as '{path.suffix}': name {path} otherwise.")
    row = row_of_frame(run.track, frame)
    scene = hand_scene(run.hand_at(row), run.track, row, session[frame], run.plan.start.shape.lens)
    picture = renderer.picture(scene, hand_view(run.track, row, view), size, smooth=True)
    with written_whole(path) as part:
        part.write_bytes(encoded(picture, path.suffix))
