"""Frames whose labels contradict the depth, told from the labels and the depth alone: no tracker is asked.

A hand is sized and posed by the true joints of a frame and rendered; where that picture explains little of the depth, the
labels show another hand than the sensor does, and an error against them says little.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize_scalar

from spf.cost.problem import golden, make_problem
from spf.cost.settings import CostSettings
from spf.evaluate.floor import marked
from spf.frame import Frame
from spf.hand.kinematics import joints_of
from spf.hand.model import Hand, Side
from spf.hand.shape import HandShape
from spf.locate import reach_of
from spf.observation import observe
from spf.prepare import fit_pose

__all__ = ["CONTRADICTED", "label_energy", "labelled_hand"]

Array = NDArray[np.float64]

#: Golden energy of the labelled hand from which labels contradict the depth; 0.2-0.5 is usual, 1 explains nothing.
CONTRADICTED = 0.65
_SIZES = (0.5, 1.8)  # of the bundled mesh, between which a hand's size is looked for
_SIZE_TOLERANCE = 0.005


def labelled_hand(side: Side, joints: Array, offsets: Array) -> Hand:
    """Return the hand, sized by its labels, with its joints where the data set marks them.

    Args:
        side: which hand.
        joints: (N, 21, 3) m, true joints of some frames; NaN where one is not known.
        offsets: (21, 3) from :func:`spf.joint_definitions.offsets_of`.

    Raises:
        StartError: a frame has fewer than three known joints of the palm.
    """

    def sized(scale: float) -> Hand:
        return marked(HandShape(side, scale=float(scale)).hand(), offsets)

    def misfit(scale: float) -> float:
        hand = sized(scale)
        return float(np.mean([_distance(hand, own) for own in joints]))

    best = minimize_scalar(misfit, bounds=_SIZES, method="bounded", options={"xatol": _SIZE_TOLERANCE})
    return sized(best.x)


def _distance(hand: Hand, joints: Array) -> float:
    pose, reference = fit_pose(hand, joints)
    return float(np.nanmean(np.linalg.norm(joints_of(hand, pose, reference) - joints, axis=1)))


def label_energy(hand: Hand, frame: Frame) -> float:
    """Return how badly the labels of a frame explain its depth: golden energy of the hand posed by them.

    Args:
        hand: from :func:`labelled_hand`, or the exact hand of a synthetic session.
        frame: with truth; the exact pose is taken where the truth has one.

    Returns:
        0 where the render explains all, 1 and more where it explains nothing; nan without truth.

    Raises:
        StartError: fewer than three joints of the palm are known.
    """
    truth = frame.truth
    if truth is None:
        return float("nan")
    if truth.pose is not None:
        pose, reference = truth.pose, np.eye(3) if truth.orientation is None else truth.orientation
    else:
        pose, reference = fit_pose(hand, truth.joints)
    observation = observe(frame, pose[:3], reach_of(hand))
    if observation.is_empty:
        return 1.0
    problem = make_problem(hand, observation, CostSettings(), reference, np.random.default_rng(0))
    return float(golden(problem, pose[None])[0][0])
