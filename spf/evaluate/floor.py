"""The floor under a tracker's error: what is left of it when every frame is begun at the truth.

Two parts of an error are not the tracker's search: the hand's shape and the data set's marks, which no pose removes (the hand
*fitted* to the true joints), and what the cost prefers to the truth on noisy depth (the *descent* from there). The descent's
digits are pulled to where it began, as a filter's are to the prediction: what is hidden stays where it is true. Without the pull
("free") nothing but the start is known: where such descents end farther off, the pull knows the truth as no filter does.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from spf.cost.problem import make_problem
from spf.filters.dynamics import noise_scale
from spf.filters.smart import SpfSettings
from spf.frame import Frame
from spf.hand.kinematics import joints_of
from spf.hand.model import MIRROR, Hand
from spf.lens import as_stated, seen_through
from spf.locate import reach_of
from spf.observation import observe
from spf.optimisers.smd import optimise
from spf.prepare import fit_pose

__all__ = ["Floor", "floor_of", "marked"]

Array = NDArray[np.float64]
_FRAME = 1.0 / 30.0  # s between two frames, of the pull


class Floor(NamedTuple):
    """What no search in a frame can be expected to undercut.

    Attributes:
        fitted: (21,) m, joint errors of the hand fitted to the true joints; NaN where the truth is.
        descended: (21,) m, joint errors after descents from that pose on the frame's depth.
        pose: (D,) mean of where the descents ended, relative to ``reference``.
        reference: (3, 3) R_ref.
    """

    fitted: Array
    descended: Array
    pose: Array
    reference: Array


def marked(hand: Hand, offsets: Array) -> Hand:
    """Return a hand whose joints lie where a data set marks them.

    Args:
        hand: the calibrated hand.
        offsets: (21, 3) from :func:`spf.joint_definitions.offsets_of`.
    """
    mirror = MIRROR if hand.side == "left" else np.ones(3)
    return hand._replace(joint_offset=hand.joint_offset + offsets * mirror * hand.length)


def floor_of(
    hand: Hand,
    frame: Frame,
    rng: np.random.Generator,
    *,
    settings: SpfSettings | None = None,
    exact: bool = False,
    descents: int = 4,
    pulled: bool = True,
    lens: float = 1.0,
) -> Floor | None:
    """Fit a hand to a frame's truth, and descend from there.

    Args:
        hand: the hand; :func:`marked` where the data set's joints are not the model's.
        frame: with truth.
        rng: randomness of the descent.
        settings: of the cost and the descent; the default filter's when None.
        exact: begin at the exact pose of the truth, which must be one of this very hand, not at a fitted one.
        descents: SMD runs whose ends are averaged, as a filter's estimate averages its particles.
        pulled: pull the digits to where they began; else the descent is free.
        lens: that the hand was found through (:mod:`spf.lens`); errors are as the stated camera shows them.

    Returns:
        The floor, or None when the frame has no truth or shows nothing where that puts the hand.

    Raises:
        StartError: fewer than three joints of the palm are known.
    """
    frame = seen_through(frame, lens)
    truth = frame.truth
    if truth is None:
        return None
    if exact and truth.pose is not None:
        pose, reference = truth.pose, np.eye(3) if truth.orientation is None else truth.orientation
    else:
        pose, reference = fit_pose(hand, truth.joints)
    observation = observe(frame, pose[:3], reach_of(hand))
    if observation.is_empty:
        return None
    chosen = settings or SpfSettings()
    problem = make_problem(hand, observation, chosen, reference, rng)
    precision = chosen.points * chosen.prediction_pull / noise_scale(hand, chosen, _FRAME) ** 2
    precision[:6] = 0.0
    if not pulled:
        precision[:] = 0.0
    ends = [optimise(problem, chosen, rng, pose, prior=pose, precision=precision)[0] for _ in range(descents)]
    end = np.mean(ends, axis=0)
    fitted, descended = (_apart(joints_of(hand, p, reference) - truth.joints, lens) for p in (pose, end))
    return Floor(fitted, descended, end, reference)


def _apart(differences: Array, lens: float) -> Array:
    return np.asarray(np.linalg.norm(as_stated(differences, lens), axis=1))
