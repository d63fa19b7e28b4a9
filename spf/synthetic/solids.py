"""Simple closed meshes for what else the sensor sees: ellipsoids and tapered tubes, and their depth maps."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from spf.frame import Camera
from spf.kernels.render import FAR, project_vertices, rasterise

__all__ = ["Mesh", "camera_numbers", "draw", "ellipsoid", "plane_depth", "tube"]

_SIDES = 24


class Mesh(NamedTuple):
    """A closed triangle mesh in the camera frame.

    Attributes:
        vertices: (V, 3) m.
        faces: (F, 3) int32, outward by the right-hand rule.
    """

    vertices: NDArray[np.float64]
    faces: NDArray[np.int32]


def camera_numbers(camera: Camera) -> NDArray[np.float64]:
    """Return a camera as the render kernels read it: (fx, fy, cx, cy, perspective)."""
    return np.array([camera.fx, camera.fy, camera.cx, camera.cy, float(camera.model == "pinhole")])


def draw(meshes: Sequence[Mesh], camera: Camera) -> NDArray[np.float32]:
    """Draw meshes into one depth map (H, W), m; :data:`~spf.kernels.render.FAR` where there is nothing."""
    depth = np.full((camera.height, camera.width), FAR, np.float32)
    if not meshes:
        return depth
    first = np.cumsum([0, *(len(mesh.vertices) for mesh in meshes)])
    vertices = np.concatenate([mesh.vertices for mesh in meshes])
    faces = np.concatenate([mesh.faces + offset for mesh, offset in zip(meshes, first, strict=False)]).astype(np.int32)
    projected = np.empty((len(vertices), 3), np.float32)
    project_vertices(vertices, camera_numbers(camera), projected)
    rasterise(projected, faces, depth)
    return depth


def plane_depth(point: ArrayLike, normal: ArrayLike, camera: Camera) -> NDArray[np.float32]:
    """Return the depth map (H, W) of a plane through a point, m; FAR where it is behind the camera or beyond 10 m."""
    u, v = np.meshgrid(np.arange(camera.width), np.arange(camera.height))
    near = camera.back_project(u, v, np.zeros(u.shape))
    ray = camera.back_project(u, v, np.ones(u.shape)) - near
    n = np.asarray(normal, dtype=np.float64)
    slope = ray @ n
    distance = np.divide((np.asarray(point) - near) @ n, slope, out=np.full(u.shape, -1.0), where=np.abs(slope) > 1e-9)
    return np.where((distance > 0.0) & (distance < 10.0), distance, FAR).astype(np.float32)


def tube(centres: NDArray[np.float64], radii: NDArray[np.float64], across: NDArray[np.float64]) -> Mesh:
    """Build a tube with elliptic rings and flat ends.

    Args:
        centres: (K, 3) of the rings, m.
        radii: (K, 2) along the two directions of ``across``, m.
        across: (2, 3) or (K, 2, 3) unit directions of the ellipses' axes; their cross product points along the tube.
    """
    angles = np.linspace(0.0, 2.0 * np.pi, _SIDES, endpoint=False)
    circle = np.stack([np.cos(angles), np.sin(angles)], axis=1)
    rings = centres[:, None, :] + (radii[:, None, :] * circle[None]) @ across
    vertices = np.concatenate([rings.reshape(-1, 3), centres[[0, -1]]])
    return Mesh(vertices, _tube_faces(len(centres)))


def ellipsoid(centre: ArrayLike, radii: ArrayLike, rings: int = 15) -> Mesh:
    """Build an ellipsoid with axes along x, y and z of the camera frame; radii (3,) in m."""
    rx, ry, rz = np.asarray(radii, dtype=np.float64)
    latitude = np.linspace(-0.5 * np.pi, 0.5 * np.pi, rings)
    centres = np.zeros((rings, 3))
    centres[:, 1] = ry * np.sin(latitude)
    cross_section = np.maximum(np.cos(latitude), 1e-3)[:, None] * np.array([rz, rx])
    across = np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0]])  # z × x = y, the way from ring to ring
    return tube(centres + np.asarray(centre), cross_section, across)


def _tube_faces(rings: int) -> NDArray[np.int32]:
    ring, side = (a.reshape(-1) for a in np.meshgrid(np.arange(rings - 1), np.arange(_SIDES), indexing="ij"))
    following = (side + 1) % _SIDES
    a, b = ring * _SIDES + side, ring * _SIDES + following
    wall = np.concatenate([np.stack([a, b, a + _SIDES], 1), np.stack([b, b + _SIDES, a + _SIDES], 1)])
    turn = np.arange(_SIDES)
    after = (turn + 1) % _SIDES
    first, last = rings * _SIDES, (rings - 1) * _SIDES
    start = np.stack([np.full(_SIDES, first), after, turn], 1)
    end = np.stack([np.full(_SIDES, first + 1), last + turn, last + after], 1)
    return np.concatenate([wall, start, end]).astype(np.int32)
