"""Depth frames with a known answer: the posed mesh, spheres and planes, drawn without noise."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from spf.cost.problem import Problem, make_problem
from spf.cost.settings import CostSettings
from spf.frame import Camera, Frame
from spf.hand.kinematics import pose_hand
from spf.hand.model import Hand
from spf.kernels.render import project_vertices, rasterise
from spf.observation import camera_numbers, observe

Array = NDArray[np.float64]

CAMERAS = {
    "pinhole": Camera(320, 240, 260.0, 260.0, 160.0, 120.0),
    "orthographic": Camera(320, 240, 900.0, 900.0, 160.0, 120.0, "orthographic"),
}
PALM = np.array([0.005, 0.01, 0.45])  # m, camera frame
REACH = 0.17

#: Palm towards the camera, fingers up: the columns are the model's x, y (back of the hand) and z (to the arm).
FACING = np.array([[-1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, 1.0, 0.0]])


def natural_pose(hand: Hand, angles: ArrayLike = (0.0, 0.0, 0.0), flexion: float = 0.3) -> Array:
    """A slightly closed hand in front of the camera."""
    pose = hand.neutral_pose()
    pose[:3], pose[3:6] = PALM, angles
    for entry, name in enumerate(hand.dof_names):
        if "flexion" in name:
            pose[entry] = flexion if "thumb" not in name else 0.5 * flexion
    return pose


def frame_of(depth: NDArray[np.float32], camera: Camera) -> Frame:
    return Frame(0, 0.0, depth, camera)


def draw_hand(hand: Hand, pose: Array, camera: Camera, reference: Array = FACING) -> NDArray[np.float32]:
    """Depth map (H, W) of the full mesh, 0 where it is not."""
    vertices = pose_hand(hand, pose, reference).vertices
    projected = np.empty((len(vertices), 3), np.float32)
    depth = np.empty((camera.height, camera.width), np.float32)
    project_vertices(vertices, camera_numbers(camera), projected)
    rasterise(projected, hand.faces, depth)
    return np.where(depth < 1e8, depth, np.float32(0))


def hand_problem(
    hand: Hand, truth: Array, camera: Camera, settings: CostSettings | None = None, seed: int = 3
) -> Problem:
    """The cost of a noiseless frame whose true pose is known."""
    observation = observe(frame_of(draw_hand(hand, truth, camera), camera), PALM, REACH)
    return make_problem(hand, observation, settings or CostSettings(), FACING, np.random.default_rng(seed))
