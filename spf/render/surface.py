"""The geometry that drawing a mesh needs: vertex normals, and the order in which see-through faces are blended."""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

from spf.render.scene import Mesh

__all__ = ["Shell", "blend", "vertex_normals"]

#: The share of its opacity that a see-through shell keeps where it faces the eye; the rim keeps all of it.
FACING_SHARE = 0.2


class Shell(NamedTuple):
    """Several see-through meshes as one, ready for drawing in order.

    Attributes:
        vertices: (V, 3) float32.
        rgba: (V, 4) uint8.
        faces: (F, 3) int32, only those that face the eye, the farthest first.
    """

    vertices: NDArray[np.float32]
    rgba: NDArray[np.uint8]
    faces: NDArray[np.int32]


def vertex_normals(vertices: NDArray[np.float32], faces: NDArray[np.int32]) -> NDArray[np.float32]:
    """Return (V, 3) unit normals: the area-weighted mean of the faces around each vertex; 0 where there is none."""
    corners = vertices[faces]
    face_normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals = _incidence(faces.tobytes(), len(vertices)) @ face_normals
    lengths = np.linalg.norm(normals, axis=1, keepdims=True)
    return (normals / np.where(lengths > 0, lengths, 1)).astype(np.float32)


def blend(meshes: Sequence[Mesh], eye: NDArray[np.float64]) -> Shell:
    """Merge see-through meshes for painting from back to front.

    Each is drawn like blown glass: opaque at the rim, clear where it faces the eye, so that several that overlap stay
    legible.

    Args:
        meshes: at least one.
        eye: (3,) position of the camera, metres.
    """
    offsets = np.cumsum([0, *(len(mesh.vertices) for mesh in meshes[:-1])])
    vertices = np.concatenate([mesh.vertices for mesh in meshes])
    normals = np.concatenate([vertex_normals(mesh.vertices, mesh.faces) for mesh in meshes])
    faces = np.concatenate([mesh.faces + np.int32(offset) for mesh, offset in zip(meshes, offsets, strict=True)])
    to_eye = eye.astype(np.float32) - vertices
    distance = np.linalg.norm(to_eye, axis=1)
    facing = np.abs(np.einsum("ij,ij->i", normals, to_eye)) / np.maximum(distance, 1e-9)
    opacity = np.concatenate([np.full(len(mesh.vertices), mesh.opacity, np.float32) for mesh in meshes])
    rgba = np.empty((len(vertices), 4), np.uint8)
    rgba[:, :3] = np.concatenate([np.broadcast_to(np.asarray(mesh.colour), mesh.vertices.shape) for mesh in meshes])
    rgba[:, 3] = np.round(255 * opacity * (FACING_SHARE + (1 - FACING_SHARE) * (1 - facing) ** 2))
    return Shell(vertices, rgba, _back_to_front(vertices, faces, to_eye, distance))


def _back_to_front(
    vertices: NDArray[np.float32],
    faces: NDArray[np.int32],
    to_eye: NDArray[np.float32],
    distance: NDArray[np.float32],
) -> NDArray[np.int32]:
    a, b, c = vertices[faces[:, 0]], vertices[faces[:, 1]], vertices[faces[:, 2]]
    towards = np.einsum("ij,ij->i", np.cross(b - a, c - a), to_eye[faces[:, 0]]) > 0
    faces = faces[towards]
    return faces[np.argsort(-distance[faces].sum(axis=1))]


@lru_cache(maxsize=8)
def _incidence(faces: bytes, count: int) -> csr_array:
    """Return the (V, F) matrix that sums what belongs to the faces around each vertex."""
    corners = np.frombuffer(faces, dtype=np.int32).reshape(-1, 3)
    columns = np.repeat(np.arange(len(corners)), 3)
    ones = np.ones(corners.size, dtype=np.float32)
    return csr_array((ones, (corners.ravel(), columns)), shape=(count, len(corners)))
