"""Read a skinned hand with the 25 WebXR joint names out of a binary glTF file."""

from __future__ import annotations

import json
import struct
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from spf.errors import HandError

__all__ = ["SkinnedMesh", "read_glb"]

_COMPONENTS = {5121: np.uint8, 5123: np.uint16, 5125: np.uint32, 5126: np.float32}
_WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT4": 16}
_WELD_DISTANCE = 1e-6  # metres: seam vertices are exact copies, up to float32


class SkinnedMesh(NamedTuple):
    """A welded skinned mesh in its bind pose.

    Attributes:
        vertices: (V, 3) m.
        faces: (F, 3) vertex indices, outward by the right-hand rule.
        weights: (V, J) skinning weights, rows sum to 1.
        joint_names: J names.
        bind: (J, 4, 4) bind matrices T_model_joint.
    """

    vertices: NDArray[np.float64]
    faces: NDArray[np.int32]
    weights: NDArray[np.float64]
    joint_names: tuple[str, ...]
    bind: NDArray[np.float64]


def read_glb(path: str | Path) -> SkinnedMesh:
    """Read the first skinned mesh of a ``.glb``, with the vertices along its UV seams welded.

    Raises:
        HandError: the file is missing, is not a binary glTF, or holds no skinned mesh.
    """
    gltf, blob = _read_chunks(Path(path))
    try:
        skin = gltf["skins"][0]
        primitive = gltf["meshes"][0]["primitives"][0]
        attributes = primitive["attributes"]
        positions = _accessor(gltf, blob, attributes["POSITION"]).astype(np.float64)
        joints = _accessor(gltf, blob, attributes["JOINTS_0"]).astype(np.intp)
        joint_weights = _accessor(gltf, blob, attributes["WEIGHTS_0"]).astype(np.float64)
        faces = _accessor(gltf, blob, primitive["indices"]).reshape(-1, 3).astype(np.int32)
        inverse_bind = _accessor(gltf, blob, skin["inverseBindMatrices"]).astype(np.float64)
        names = tuple(str(gltf["nodes"][node]["name"]) for node in skin["joints"])
    except (KeyError, IndexError, ValueError) as error:
        raise HandError(f"{path} holds no complete skinned mesh ({error}); export the hand with its skin.") from None
    weights = np.zeros((len(positions), len(names)))
    np.add.at(weights, (np.arange(len(positions))[:, None], joints), joint_weights)
    weights /= weights.sum(axis=1, keepdims=True)
    bind = np.linalg.inv(inverse_bind.reshape(-1, 4, 4).transpose(0, 2, 1)).astype(np.float64)
    return _weld(SkinnedMesh(positions, faces, weights, names, bind))


def _read_chunks(path: Path) -> tuple[dict[str, Any], bytes]:
    try:
        data = path.read_bytes()
    except OSError as error:
        raise HandError(f"The hand model {path} cannot be read: {error.strerror}.") from None
    if data[:4] != b"glTF" or len(data) < 28:
        raise HandError(f"{path} is not a binary glTF file (.glb).")
    (length,) = struct.unpack_from("<I", data, 12)
    try:
        return json.loads(data[20 : 20 + length]), data[28 + length :]
    except ValueError:
        raise HandError(f"{path} is torn: its glTF header cannot be read.") from None


def _accessor(gltf: dict[str, Any], blob: bytes, index: int) -> NDArray[Any]:
    accessor = gltf["accessors"][index]
    view = gltf["bufferViews"][accessor["bufferView"]]
    width = _WIDTHS[accessor["type"]]
    offset = view.get("byteOffset", 0) + accessor.get("byteOffset", 0)
    dtype = np.dtype(_COMPONENTS[accessor["componentType"]])
    stride = view.get("byteStride", width * dtype.itemsize)
    shape = (accessor["count"], width)
    return np.ndarray(shape, dtype, blob, offset, (stride, dtype.itemsize)).copy()


def _weld(mesh: SkinnedMesh) -> SkinnedMesh:
    """Merge vertices at the same place, and drop the triangles that vanish with it."""
    keys = np.round(mesh.vertices / _WELD_DISTANCE).astype(np.int64)
    _, first, inverse = np.unique(keys, axis=0, return_index=True, return_inverse=True)
    faces = inverse.reshape(-1)[mesh.faces].astype(np.int32)
    whole = (faces[:, 0] != faces[:, 1]) & (faces[:, 1] != faces[:, 2]) & (faces[:, 2] != faces[:, 0])
    return mesh._replace(vertices=mesh.vertices[first], faces=faces[whole], weights=mesh.weights[first])
