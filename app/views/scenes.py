"""Tracked frame → the scenes of the three pictures (Fig. 6, Fig. 9)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from app.results import Entry
from spf.hand.kinematics import joints_of, pose_hand
from spf.hand.model import Hand
from spf.render import Scene, ViewCamera, particles_scene, reconstruction_scene, trajectories_scene

__all__ = ["PICTURES", "scenes_of", "view_of"]

#: Name → heading of each picture.
PICTURES = {
    "particles": "Particles before and after optimisation",
    "trajectories": "Trajectories of SMD",
    "reconstruction": "Reconstructed hand",
}

_MOST_HANDS = 8  # particles drawn as hands, the heaviest
_MOST_PATHS = 16  # particles whose paths are drawn
_PATH_JOINTS = np.array([0, 4, 8, 12, 16, 20])  # wrist and fingertips


def scenes_of(entry: Entry) -> dict[str, Scene]:
    """Return name → scene of a frame; empty while the hand is lost."""
    result, hand = entry.result, entry.tracking.hand
    if result.info is None or result.observation is None:
        return {}
    points = result.observation.hand_points
    estimate = pose_hand(hand, result.info.estimate, result.info.reference).vertices
    return {
        "particles": _particles(entry, hand, points),
        "trajectories": _trajectories(entry, hand, points),
        "reconstruction": reconstruction_scene(estimate, hand.faces, points=points),
    }


def _particles(entry: Entry, hand: Hand, points: NDArray[np.float64]) -> Scene:
    info = entry.result.info
    assert info is not None
    before, after = info.predicted_weights, info.optimised_weights
    heaviest = np.maximum(before, after) if len(after) else before
    drawn = np.argsort(-heaviest, kind="stable")[:_MOST_HANDS]

    def vertices(poses: NDArray[np.float64]) -> NDArray[np.float64]:
        return np.stack([pose_hand(hand, pose, info.reference).vertices for pose in poses[drawn]])

    if not len(after):  # a filter that optimises nothing
        return particles_scene(
            vertices(info.predicted), None, hand.faces,
            predicted_weights=before[drawn], points=points, at_most=_MOST_HANDS,
        )  # fmt: skip
    return particles_scene(
        vertices(info.predicted), vertices(info.optimised), hand.faces,
        predicted_weights=before[drawn], optimised_weights=after[drawn], points=points, at_most=_MOST_HANDS,
    )  # fmt: skip


def _trajectories(entry: Entry, hand: Hand, points: NDArray[np.float64]) -> Scene:
    info = entry.result.info
    assert info is not None
    after = info.optimised_weights
    drawn = np.argsort(-after, kind="stable")[:_MOST_PATHS]
    traces = [info.trajectories[index] for index in drawn]
    longest = max((len(trace.poses) for trace in traces), default=1)
    paths = np.empty((len(traces), longest, len(_PATH_JOINTS), 3))
    for path, trace in zip(paths, traces, strict=True):
        for i in range(longest):  # a particle that converged early stays where it is
            path[i] = joints_of(hand, trace.poses[min(i, len(trace.poses) - 1)], info.reference)[_PATH_JOINTS]
    return trajectories_scene(paths, weights=after[drawn], points=points)


def view_of(entry: Entry, azimuth: float, elevation: float, zoom: float) -> ViewCamera:
    """Return the sensor's view of the estimated hand, orbited by angles in radians and magnified."""
    view = ViewCamera.from_sensor(entry.result.joints)
    # The skin reaches beyond the joints, and the particles beyond the estimate.
    return view._replace(extent=1.25 * view.extent, azimuth=azimuth, elevation=elevation, zoom=zoom)
