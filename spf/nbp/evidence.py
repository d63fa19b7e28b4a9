"""The likelihood of one body, given what the others are believed to hide (5-8, 15, 16), on a depth image.

The paper compares colours: every pixel of a body's silhouette counts ``p_skin/p_bkgd``. A depth session has no colours; a
pixel counts how much likelier its depth is if the body's surface is there than if it is not. What is hidden counts nothing:
with ν, the probability that no other body is in front, a pixel's factor is ``ν·ratio + (1 − ν)`` (16).
"""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from typing import NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from spf.kernels.cost_inputs import EMPTY, UNKNOWN
from spf.nbp.bodies import PLACE, Bodies, rotations_of
from spf.nbp.mixture import Mixture
from spf.observation import Observation
from spf.settings import Settings, setting

__all__ = ["EvidenceSettings", "Hidden", "hidden_by", "log_evidence"]

Array = NDArray[np.float64]
Places = NDArray[np.intp]
_GROUP = "Evidence"
_RANGE = 0.2  # m in which the depth of another surface may lie, alike anywhere
_EMPTY = 0.03  # likelihood ratio of a pixel in which nothing is seen, where the body should be
_FRONT = 0.008  # m that a body is in front of another one's surface when it hides it
_FAR = 10_000  # cells beside the picture, where what is farther is drawn


@dataclasses.dataclass(frozen=True)
class EvidenceSettings(Settings):
    """How sharply depth tells where a body is."""

    accuracy: float = setting(
        0.004, "standard deviation of the depth around a body's surface", group=_GROUP, low=0.001, high=0.1, unit="m"
    )
    outliers: float = setting(0.1, "share of pixels that show something else", group=_GROUP, low=1e-3, high=0.9)
    evidence: float = setting(
        30.0, "pixels of a whole body that are as good as independent", group=_GROUP, low=0.1, high=1000.0
    )
    occlusion: bool = setting(True, "infer which pixels of a body the others hide (15, 16)", group=_GROUP)


class Hidden(NamedTuple):
    """What the bodies are believed to cover, on the observation's coarse grid.

    Attributes:
        shares: (B, h, w) probability that a body covers a cell.
        depths: (B, h, w) m, of the body there.
    """

    shares: Array
    depths: Array


class _Seen(NamedTuple):
    """Points of a body's skin, N states of it, as the camera sees them.

    Attributes:
        facing: (N, K) whether the skin faces the camera.
        depths: (N, K) m.
        x, y: (N, K) over z for a pinhole camera.
    """

    facing: NDArray[np.bool_]
    depths: Array
    x: Array
    y: Array

    def pixels(self, camera: Array, shape: tuple[int, ...]) -> tuple[Places, NDArray[np.bool_]]:
        """Flat indices (N, K) of the pixels that show the points, and whether they are in the picture."""
        u, v = self.x * camera[0] + camera[2], self.y * camera[1] + camera[3]
        column, row = np.rint(u).astype(np.intp), np.rint(v).astype(np.intp)
        inside = (column >= 0) & (column < shape[1]) & (row >= 0) & (row < shape[0])
        return np.where(inside, row * shape[1] + column, 0), inside


def _seen(bodies: Bodies, body: int, states: Array, camera: Array) -> _Seen:
    turned = rotations_of(states)
    points = np.einsum("nij,kj->nki", turned, bodies.points[body]) + states[:, None, PLACE]
    normals = np.einsum("nij,kj->nki", turned, bodies.normals[body])
    pinhole = camera[4] > 0.0
    facing = (normals * points).sum(axis=-1) < 0.0 if pinhole else normals[..., 2] < 0.0
    scale = 1.0 / np.maximum(points[..., 2], 1e-3) if pinhole else np.ones(points.shape[:2])
    return _Seen(facing, points[..., 2], points[..., 0] * scale, points[..., 1] * scale)


def hidden_by(observation: Observation, bodies: Bodies, beliefs: list[Mixture]) -> Hidden:
    """Return Pr[u ∈ Ω(x_j)] of (15) for every body and cell, and how deep the body lies there.

    Bodies are convex: the silhouette Ω of a sample is the convex hull of its projected skin.
    """
    grid, camera = observation.arrays.grid_depth.shape, observation.arrays.grid_camera
    shares, depths = np.zeros((len(beliefs), *grid)), np.empty((len(beliefs), *grid))
    for body, belief in enumerate(beliefs):
        seen = _seen(bodies, body, belief.means, camera)
        u, v = seen.x * camera[0] + camera[2], seen.y * camera[1] + camera[3]
        weights = np.exp(belief.log_weights)
        corners = np.rint(np.stack([u, v], axis=-1)).clip(-_FAR, _FAR).astype(np.int32)
        for weight, skin in zip(weights, corners, strict=True):
            silhouette = np.zeros(grid, np.uint8)
            cv2.fillConvexPoly(silhouette, cv2.convexHull(skin), 1)
            shares[body] += weight * silhouette
        depths[body] = _depth_plane(u, v, seen, weights, grid)
    return Hidden(np.minimum(shares, 1.0), depths)


def _depth_plane(u: Array, v: Array, seen: _Seen, weights: Array, grid: tuple[int, ...]) -> Array:
    """Depth (h, w) of the side of a body that faces the camera: the plane through its points in all samples."""
    facing = np.sqrt(weights[:, None] * seen.facing)
    middle = np.array([u.mean(), v.mean()])
    sides = np.stack([u - middle[0], v - middle[1], np.ones_like(u)], axis=-1)
    plane, *_ = np.linalg.lstsq((facing[..., None] * sides).reshape(-1, 3), (facing * seen.depths).ravel(), rcond=1e-6)
    rows, columns = np.mgrid[: grid[0], : grid[1]]
    return np.asarray(plane[0] * (columns - middle[0]) + plane[1] * (rows - middle[1]) + plane[2])


def log_evidence(
    observation: Observation,
    bodies: Bodies,
    body: int,
    states: Array,
    settings: EvidenceSettings,
    hidden: Hidden | None,
    hiding: Sequence[int],
) -> Array:
    """Logarithm (M,) of the likelihood (16) of states (M, 7) of a body.

    Args:
        observation: of the frame.
        bodies: of the hand.
        body: which.
        states: (M, 7).
        settings: of the likelihood.
        hidden: what is believed to be covered by whom; None to take all of it for visible.
        hiding: bodies that may hide this one.
    """
    arrays = observation.arrays
    seen = _seen(bodies, body, states, arrays.camera)
    pixels, inside = seen.pixels(arrays.camera, arrays.labels.shape)
    labels = np.where(inside, arrays.labels.ravel()[pixels], np.uint8(EMPTY))
    off = arrays.surface[pixels, 2] - seen.depths
    at = np.exp(-0.5 * (off / settings.accuracy) ** 2) / (settings.accuracy * np.sqrt(2.0 * np.pi))
    ratios = (1.0 - settings.outliers) * _RANGE * at + settings.outliers
    ratios = np.where(labels == EMPTY, _EMPTY, ratios)
    ratios = np.where(labels == UNKNOWN, 1.0, ratios)
    if hidden is not None:
        visible = _visible(observation, seen, hidden, list(hiding))
        ratios = visible * ratios + (1.0 - visible)
    share = settings.evidence / seen.facing.shape[1]
    return np.asarray(share * (np.log(ratios) * seen.facing).sum(axis=1))


def _visible(observation: Observation, seen: _Seen, hidden: Hidden, hiding: list[int]) -> Array:
    """ν (N, K): the probability that none of the other bodies hides a point."""
    grid = observation.arrays.grid_depth.shape
    cells, inside = seen.pixels(observation.arrays.grid_camera, grid)
    shares = hidden.shares[hiding].reshape(len(hiding), -1)[:, cells]
    depths = hidden.depths[hiding].reshape(len(hiding), -1)[:, cells]
    hides = shares * (depths < seen.depths - _FRONT)
    return np.where(inside, np.prod(1.0 - np.minimum(hides, 1.0), axis=0), 1.0)
