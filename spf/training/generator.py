"""Make training samples without end: scene drawn, rendered, measured and cropped, with the answer in crop units."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from spf.hand.model import load_hand
from spf.kernels.samples import draw_samples
from spf.kernels.sensing import Pools
from spf.learned.layout import ARTICULATED, CROP_SIZE
from spf.training.scenes import draw_scenes, other_faces
from spf.training.shapes import ShapeTable, make_shapes

__all__ = ["Batch", "Generator"]

Array = NDArray[np.float64]
Image = NDArray[np.float32]

_POOL = 1 << 22


class Batch(NamedTuple):
    """N samples; lengths in sides of the cube, from its centre, in the frame of the crop's camera.

    Attributes:
        crops: (N, S, S) float32, -1 to 1.
        points: (N, 22, 3) float32: 21 joints and the palm's centre.
        rotations: (N, 3, 3) float32 orientation of the palm.
        angles: (N, 16) float32 radians, of ARTICULATED.
        perspectives: (N,) float32, the cube's side over the distance from the camera to its centre.
        log_sizes: (N,) float32, logarithm of the bundled hand's length times the hand's size over the cube's side.
        present: (N,) float32, 1 where there is a hand.
        right: (N,) float32, 1 where it is a right one; of mirrored crops ``rotations`` are not true.
    """

    crops: Image
    points: Image
    rotations: Image
    angles: Image
    perspectives: Image
    log_sizes: Image
    present: Image
    right: Image


class Generator:
    """Makes numbered batches; a number and a seed always give the same batch.

    Args:
        seed: of everything.
        shapes: how many different hands, or a table.
    """

    def __init__(self, seed: int, shapes: int | ShapeTable = 400) -> None:
        self.seed = seed
        self.table = make_shapes(shapes, seed) if isinstance(shapes, int) else shapes
        hand = self.table.arrays
        faces = np.concatenate([hand.faces, other_faces(hand.faces, len(hand.skin.vertices))])
        self._arrays = hand._replace(faces=faces)
        rng = np.random.default_rng([seed, 2])
        self._pools = Pools(rng.standard_normal(_POOL, dtype=np.float32), rng.random(_POOL, dtype=np.float32))

    def batch(self, number: int, n: int, left_share: float = 0.18) -> Batch:
        """Make batch ``number`` of n samples, of which a share are mirrored."""
        rng = np.random.default_rng([self.seed, 3, number])
        scenes, left, present = draw_scenes(rng, n, self.table, left_share)
        crops = np.empty((n, CROP_SIZE, CROP_SIZE), np.float32)
        joints = np.empty((n, 21, 3))
        draw_samples(self._arrays, scenes, self._pools, crops, joints)
        crops[left] = crops[left, :, ::-1]
        centres = np.stack([np.zeros(n), np.zeros(n), scenes.away], axis=1)
        points = np.concatenate([joints, scenes.poses[:, None, :3]], axis=1) - centres[:, None]
        points[left, :, 0] *= -1.0
        return Batch(
            crops,
            (points / scenes.extents[:, None, None]).astype(np.float32),
            scenes.orientations.astype(np.float32),
            scenes.poses[:, ARTICULATED].astype(np.float32),
            (scenes.extents / scenes.away).astype(np.float32),
            np.log(load_hand("right").length * self.table.sizes[scenes.shape] / scenes.extents).astype(np.float32),
            present.astype(np.float32),
            (~left).astype(np.float32),
        )
