"""What the cost is made of, as flat arrays: the observation, the weights of the terms, the spheres, and scratch."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from spf.kernels.compiling import allocating
from spf.kernels.kinematics import Chain, make_chain

__all__ = [
    "EMPTY",
    "HAND",
    "LABEL",
    "NORMAL",
    "SURFACE_COLUMNS",
    "UNKNOWN",
    "CostWeights",
    "ObservationArrays",
    "Spheres",
    "Workspace",
    "allocate",
]

Array = NDArray[np.float64]
Image = NDArray[np.float32]

# Columns of an observation's surface: place, normal, label.
NORMAL, LABEL, SURFACE_COLUMNS = 3, 6, 8

#: Labels of the pixels of an observation.
EMPTY, HAND, UNKNOWN = 0, 1, 2


class ObservationArrays(NamedTuple):
    """An observation as flat arrays: a crop of H×W pixels and a coarse grid of h×w cells.

    Attributes:
        camera: (5,) fx, fy, cx, cy, perspective flag of the crop.
        surface: (H·W, SURFACE_COLUMNS) of a pixel its place (3), m, and unit normal (3), camera frame, meaningful where
            the label is HAND; its label; and one to fill half a cache line. A look-up costs one access to memory.
        labels: (H, W) uint8 EMPTY, HAND or UNKNOWN.
        nearest: (H, W) int32 flat index of the nearest HAND pixel.
        pixels: (M,) int32 flat indices of the HAND pixels.
        grid_camera: (5,) camera of the coarse grid.
        grid_depth: (h, w) float32 m.
        grid_labels: (h, w) uint8.
        grid_outside: (h, w) float32 cost of covering a cell beside the hand.
        grid_count: number of HAND cells.
    """

    camera: Array
    surface: Image
    labels: NDArray[np.uint8]
    nearest: NDArray[np.int32]
    pixels: NDArray[np.int32]
    grid_camera: Array
    grid_depth: Image
    grid_labels: NDArray[np.uint8]
    grid_outside: Image
    grid_count: int

    @property
    def points(self) -> Image:
        """Place of every pixel, (H·W, 3) m."""
        return self.surface[:, :NORMAL]

    @property
    def normals(self) -> Image:
        """Unit normal of every pixel, (H·W, 3)."""
        return self.surface[:, NORMAL:LABEL]


class CostWeights(NamedTuple):
    """Weights of the terms; lengths in metres.

    Attributes:
        points: nominal number of sample points |S|: sums are scaled to it whatever the sample.
        length: ℓ, which makes E dimensionless.
        normal: k.
        behind, front, pull: 1/s², 1/m², of the robust functions of a point behind, in front of, and beside the
            surface; 0 switches one off.
        background: b.
        coverage: c, relative to the depth term.
        collision: q.
    """

    points: float
    length: float
    normal: float
    behind: float
    front: float
    pull: float
    background: float
    coverage: float
    collision: float


class Spheres(NamedTuple):
    """Spheres inside the digits, for the collision term.

    Attributes:
        bone: (Q,) bone that carries the sphere.
        centre: (Q, 3) m, in that bone's frame.
        radius: (Q,) m.
        partners: (Q, 2) the spheres from … up to (not including) … that a sphere can meet, all of later digits.
    """

    bone: NDArray[np.int32]
    centre: Array
    radius: Array
    partners: NDArray[np.int32]


class Workspace(NamedTuple):
    """Scratch of one evaluation; one per thread.

    Attributes:
        chain: the posed bones.
        places: (3, Q) of the spheres.
        columns: (D, 6) velocities of one point and normal for every degree of freedom.
        turns: (B + 1,) first revolute of every bone.
    """

    chain: Chain
    places: Array
    columns: Array
    turns: NDArray[np.int32]


@allocating
def allocate(bones: int, revolutes: int, spheres: int, dofs: int) -> Workspace:
    """Allocate a Workspace."""
    return Workspace(
        make_chain(bones, revolutes), np.zeros((3, spheres)), np.zeros((dofs, 6)), np.zeros(bones + 1, np.int32)
    )
