"""Tracked frame → the scenes of the pictures (Fig. 6, Fig. 9), and where they are seen from."""

from __future__ import annotations

from collections.abc import Callable, Iterable

import numpy as np
from numpy.typing import NDArray

from app.results import Entry
from app.state import State
from spf.filters.step import StepInfo
from spf.hand.kinematics import joints_of, joints_of_each, pose_hand
from spf.render import Colour, Scene, ViewCamera, particles_scene, reconstruction_scene, trajectories_scene
from spf.render.palette import HAND

__all__ = [
    "PICTURES",
    "SCENES",
    "drawn_of",
    "hand_view",
    "particles_of",
    "reconstruction_of",
    "trajectories_of",
    "view_of",
]

#: Name → heading of each picture of one tracker.
PICTURES = {
    "particles": "Particles before and after optimisation",
    "trajectories": "Trajectories of optimisation",
    "reconstruction": "Reconstructed hand",
}

_MOST_HANDS = 8  # particles drawn as hands, the heaviest
_MOST_PATHS = 16  # particles whose paths are drawn
_PATH_POSES = 26  # poses that a path is drawn through, evenly spread over its iterations
_PATH_JOINTS = np.array([0, 4, 8, 12, 16, 20])  # wrist and fingertips


def reconstruction_of(entry: Entry, colour: Colour = HAND) -> Scene | None:
    """Return the estimated hand among the observed points; None while it is lost."""
    info, hand = entry.result.info, entry.hand
    if info is None or entry.seen is None:
        return None
    vertices = pose_hand(hand, info.estimate, info.reference).vertices
    return reconstruction_scene(vertices, hand.faces, points=entry.seen.points, colour=colour)


def drawn_of(info: StepInfo, selected: tuple[int, ...], most: int) -> NDArray[np.intp]:
    """Return the particles that a picture draws: those picked out, else the heaviest."""
    picked = [index for index in selected if index < len(info.predicted)]
    if picked:
        return np.array(picked[:most], dtype=np.intp)
    before, after = info.predicted_weights, info.optimised_weights
    heaviest = np.maximum(before, after) if len(after) else before
    return np.argsort(-heaviest, kind="stable")[:most]


def particles_of(entry: Entry, selected: tuple[int, ...] = ()) -> Scene | None:
    """Return particles before and after optimisation, as hands; None while the hand is lost."""
    info, seen, hand = entry.result.info, entry.seen, entry.hand
    if info is None or seen is None:
        return None
    before, after = info.predicted_weights, info.optimised_weights
    drawn = drawn_of(info, selected, _MOST_HANDS)

    def vertices(poses: NDArray[np.float64]) -> NDArray[np.float64]:
        return np.stack([pose_hand(hand, pose, info.reference).vertices for pose in poses[drawn]])

    points = seen.points
    if not len(after):  # a filter that optimises nothing
        return particles_scene(
            vertices(info.predicted), None, hand.faces,
            predicted_weights=before[drawn], points=points, at_most=_MOST_HANDS,
        )  # fmt: skip
    return particles_scene(
        vertices(info.predicted), vertices(info.optimised), hand.faces,
        predicted_weights=before[drawn], optimised_weights=after[drawn], points=points, at_most=_MOST_HANDS,
    )  # fmt: skip


def trajectories_of(entry: Entry, selected: tuple[int, ...] = ()) -> Scene | None:
    """Return the paths of wrist and fingertips during optimisation; None when none were recorded."""
    info, seen, hand = entry.result.info, entry.seen, entry.hand
    if info is None or seen is None or not info.trajectories:
        return None
    after = info.optimised_weights
    drawn = drawn_of(info, selected, _MOST_PATHS)
    traces = [info.trajectories[index] for index in drawn]
    paths = np.empty((len(traces), _PATH_POSES, len(_PATH_JOINTS), 3))
    for path, trace in zip(paths, traces, strict=True):
        at = np.linspace(0, len(trace.poses) - 1, _PATH_POSES).round().astype(np.intp)
        path[:] = joints_of_each(hand, trace.poses[at], info.reference)[:, _PATH_JOINTS]
    return trajectories_scene(paths, weights=after[drawn], points=seen.points)


#: Name → scene of each picture of one tracker.
SCENES: dict[str, Callable[[Entry, tuple[int, ...]], Scene | None]] = {
    "particles": particles_of,
    "trajectories": trajectories_of,
    "reconstruction": lambda entry, _selected: reconstruction_of(entry),
}


def view_of(entries: Iterable[Entry], state: State) -> ViewCamera:
    """Return where a page looks from: at the hand that explains the depth best, or where the eye was left."""
    best = min(entries, key=lambda entry: np.nan_to_num(entry.result.golden, nan=np.inf))
    base = state.look.anchor or hand_view(best)
    return base._replace(azimuth=state.azimuth, elevation=state.elevation, zoom=state.zoom, pan=state.look.pan)


def hand_view(entry: Entry) -> ViewCamera:
    """Return the sensor's view of the estimated hand."""
    view = ViewCamera.from_sensor(joints_of(entry.hand, entry.result.pose, entry.result.reference))
    # The skin reaches beyond the joints, and the particles beyond the estimate.
    return view._replace(extent=1.25 * view.extent)
