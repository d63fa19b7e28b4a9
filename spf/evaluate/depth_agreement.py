"""Agreement of a posed hand with the depth, where no truth is needed: silhouette overlap and distance to the model."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from spf.frame import Frame
from spf.hand.kinematics import PosedHand, pose_hand
from spf.hand.model import Hand
from spf.kernels.golden import compare_depth
from spf.kernels.render import project_vertices, rasterise
from spf.locate import reach_of
from spf.observation import Observation, camera_numbers, observe

__all__ = ["Agreement", "agreement_with_depth", "beyond_wrist", "surface_distances"]

Array = NDArray[np.float64]
_TRUNCATION = 0.04  # m; only the overlap is used of what it enters
_POINTS = 1000  # observed points a frame that distances are measured from
_CANDIDATES = 8  # nearest triangles, by their centres, that a point is measured to


class Agreement(NamedTuple):
    """How a posed hand agrees with a frame's depth.

    Attributes:
        silhouette_iou: intersection over union of the rendered and the observed silhouette, at the frame's own
            resolution; the forearm and what is hidden by nearer things count nothing.
        data_to_model: mean distance of the observed hand's points to the model's surface, m; NaN if nothing is seen.
    """

    silhouette_iou: float
    data_to_model: float


def agreement_with_depth(hand: Hand, pose: Array, reference: Array, frame: Frame) -> Agreement:
    """Compare a posed hand with a frame.

    Args:
        hand: the calibrated hand.
        pose: (D,) relative to ``reference``.
        reference: (3, 3) R_ref.
        frame: the depth image.
    """
    posed, faces = pose_hand(hand, pose, reference), _without_arm(hand)
    observation = observe(frame, pose[:3], reach_of(hand))
    if observation.is_empty:
        return Agreement(0.0, float("nan"))
    wrist, axis = np.ascontiguousarray(posed.frames[0, :, 3]), np.ascontiguousarray(posed.frames[0, :, 2])
    overlap = _overlap(posed, faces, frame, observation, wrist, axis)
    points = observation.hand_points
    points = points[~beyond_wrist(points - wrist, axis)]
    if not len(points):
        return Agreement(overlap, float("nan"))
    chosen = points[:: -(-len(points) // _POINTS)]
    return Agreement(overlap, float(surface_distances(chosen, posed.vertices, faces).mean()))


def _overlap(
    posed: PosedHand, faces: NDArray[np.int32], frame: Frame, observation: Observation, wrist: Array, axis: Array
) -> float:
    shape = frame.depth.shape
    rows = slice(observation.top, observation.top + observation.depth.shape[0])
    columns = slice(observation.left, observation.left + observation.depth.shape[1])
    labels, depth = np.zeros(shape, np.uint8), np.zeros(shape, np.float32)
    labels[rows, columns], depth[rows, columns] = observation.arrays.labels, observation.depth
    projected, rendered = np.empty((len(posed.vertices), 3), np.float32), np.empty(shape, np.float32)
    camera = camera_numbers(frame.camera)
    project_vertices(posed.vertices, camera, projected)
    rasterise(projected, faces, rendered)
    beside = np.ones(shape, np.float32)
    _, overlap = compare_depth(rendered, depth, labels, beside, camera, wrist, axis, 1.0, _TRUNCATION)
    return float(overlap)


def _without_arm(hand: Hand) -> NDArray[np.int32]:
    """Faces of the skin that are not wholly beyond the wrist, as those of the proxy."""
    wrist = hand.skeleton.bind[0, 2, 3]
    return np.ascontiguousarray(hand.faces[(hand.skin.vertices[hand.faces, 2] < wrist).any(axis=1)])


def beyond_wrist(offsets: Array, axis: Array) -> NDArray[np.bool_]:
    """Which points, at (M, 3) from the wrist, are forearm; as :func:`spf.kernels.golden.beyond_wrist` for one."""
    along = offsets @ axis
    across = np.sqrt(np.maximum((offsets**2).sum(axis=1) - along**2, 0.0))
    return np.asarray((along >= 0.01) & (across < 0.045 + 1.2 * along))


def surface_distances(points: Array, vertices: Array, faces: NDArray[np.int32]) -> Array:
    """Return the distances (M,) of points (M, 3) to a mesh, m; exact but for the choice of the triangles looked at."""
    corners = vertices[faces]
    count = min(_CANDIDATES, len(faces))
    _, nearest = cKDTree(corners.mean(axis=1)).query(points, k=count)
    a, b, c = np.moveaxis(corners[np.reshape(nearest, (len(points), count))], 2, 0)
    x = points[:, None]
    normal = np.cross(b - a, c - a)
    normal = normal / np.maximum(np.linalg.norm(normal, axis=2, keepdims=True), 1e-12)
    height = np.abs(((x - a) * normal).sum(axis=2))
    turns = [(np.cross(q - p, x - p) * normal).sum(axis=2) for p, q in ((a, b), (b, c), (c, a))]
    inside = np.all(np.stack(turns) >= 0.0, axis=0)
    edges = np.min(np.stack([_to_segment(x, p, q) for p, q in ((a, b), (b, c), (c, a))]), axis=0)
    return np.asarray(np.where(inside, height, edges).min(axis=1))


def _to_segment(x: Array, p: Array, q: Array) -> Array:
    along = q - p
    share = ((x - p) * along).sum(axis=2) / np.maximum((along**2).sum(axis=2), 1e-18)
    return np.asarray(np.linalg.norm(x - p - np.clip(share, 0.0, 1.0)[:, :, None] * along, axis=2))
