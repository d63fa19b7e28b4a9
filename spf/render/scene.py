"""What a picture shows, as immutable values: meshes, points and lines in the camera frame, in metres."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

__all__ = ["Colour", "Lines", "Mesh", "Points", "Scene"]

#: Red, green and blue between 0 and 1.
Colour = tuple[float, float, float]

#: A slate that light and dark pages both stand, and on which every colour of the palette is seen.
BACKGROUND: Colour = (0.165, 0.190, 0.220)


@dataclass(frozen=True, eq=False)
class Mesh:
    """A closed triangle mesh.

    Attributes:
        vertices: (V, 3) metres.
        faces: (F, 3) vertex indices, counter-clockwise seen from outside; back faces are not drawn.
        colour: one colour, or (V, 3).
        opacity: 1 is solid; below it only a see-through shell with a stronger rim is drawn.

    Raises:
        ValueError: shapes do not fit, a number is not finite, or a face names no vertex.
    """

    vertices: NDArray[np.float32]
    faces: NDArray[np.int32]
    colour: Colour | NDArray[Any] = (0.7, 0.7, 0.7)
    opacity: float = 1.0

    def __post_init__(self) -> None:
        vertices = _floats(self.vertices, "vertices", (None, 3))
        faces = np.ascontiguousarray(self.faces, dtype=np.int32)
        if faces.ndim != 2 or faces.shape[1] != 3:
            raise ValueError(f"faces have shape {faces.shape}, expected (F, 3)")
        if faces.size and (faces.min() < 0 or faces.max() >= len(vertices)):
            raise ValueError(f"faces name vertices outside 0 to {len(vertices) - 1}")
        if not 0.0 <= self.opacity <= 1.0:
            raise ValueError(f"opacity is {self.opacity}, expected 0 to 1")
        object.__setattr__(self, "vertices", vertices)
        object.__setattr__(self, "faces", faces)
        object.__setattr__(self, "colour", _colours(self.colour, (len(vertices), 3)))


@dataclass(frozen=True, eq=False)
class Points:
    """A cloud of points.

    Attributes:
        xyz: (M, 3) metres.
        colour: one colour, or (M, 3).
        size: diameter in pixels of a picture 480 pixels high; it grows and shrinks with the picture.
        ball: draw shaded balls, not squares (slower; for a few).

    Raises:
        ValueError: shapes do not fit or a number is not finite.
    """

    xyz: NDArray[np.float32]
    colour: Colour | NDArray[Any] = (0.7, 0.7, 0.7)
    size: float = 2.0
    ball: bool = False

    def __post_init__(self) -> None:
        xyz = _floats(self.xyz, "xyz", (None, 3))
        object.__setattr__(self, "xyz", xyz)
        object.__setattr__(self, "colour", _colours(self.colour, xyz.shape))


@dataclass(frozen=True, eq=False)
class Lines:
    """Paths of equal length; one that ended early repeats its last point.

    Attributes:
        paths: (K, L, 3) metres.
        colour: one colour, or anything that broadcasts to (K, L, 3): (K, 1, 3) one a path, (L, 3) one a step.
        width: pixels of a picture 480 pixels high.

    Raises:
        ValueError: shapes do not fit or a number is not finite.
    """

    paths: NDArray[np.float32]
    colour: Colour | NDArray[Any] = (0.7, 0.7, 0.7)
    width: float = 1.5

    def __post_init__(self) -> None:
        paths = _floats(self.paths, "paths", (None, None, 3))
        object.__setattr__(self, "paths", paths)
        object.__setattr__(self, "colour", _colours(self.colour, paths.shape))


@dataclass(frozen=True)
class Scene:
    """Everything in a picture. Meshes below opacity 1 are blended from the farthest face to the nearest."""

    meshes: tuple[Mesh, ...] = ()
    points: tuple[Points, ...] = ()
    lines: tuple[Lines, ...] = ()
    background: Colour = BACKGROUND


def _floats(values: ArrayLike, name: str, shape: tuple[int | None, ...]) -> NDArray[np.float32]:
    array = np.array(values, dtype=np.float32, order="C")  # a copy: the scene is drawn later, in another process
    if array.ndim != len(shape) or any(want not in (None, have) for want, have in zip(shape, array.shape, strict=True)):
        wanted = ", ".join("n" if want is None else str(want) for want in shape)
        raise ValueError(f"{name} have shape {array.shape}, expected ({wanted})")
    if not np.isfinite(array).all():
        raise ValueError(f"{name} hold a number that is not finite")
    array.setflags(write=False)
    return array


def _colours(colour: ArrayLike, shape: tuple[int, ...]) -> NDArray[np.uint8]:
    """Return 8-bit colours; one colour stays one colour, so that little travels to the renderer."""
    values = np.asarray(colour)
    if values.dtype != np.uint8:
        if not (np.isfinite(values).all() and (values >= 0).all() and (values <= 1).all()):
            raise ValueError("colours are numbers from 0 to 1")
        values = np.round(values * 255.0).astype(np.uint8)
    np.broadcast_to(values, shape)
    return values
