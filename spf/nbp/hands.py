"""Hands drawn from the beliefs of their bodies: down the tree of joints, each body chosen to fit the one it hangs on."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.distance import cdist

from spf.hand.model import Hand
from spf.nbp.bodies import PLACE, palm_entries, rotations_of
from spf.nbp.graph import Graph
from spf.nbp.joints import angles_between, child_of
from spf.nbp.mixture import Mixture, draw_labels

__all__ = ["draw_hands"]

Array = NDArray[np.float64]
_FIT = 0.006  # m by which a body's joint may lie beside where the body it hangs on has it


def draw_hands(
    hand: Hand, graph: Graph, beliefs: list[Mixture], reference: Array, count: int, rng: np.random.Generator
) -> Array:
    """Draw poses (count, D), relative to R_ref, within the joint limits.

    The potentials (1) of the joints are applied once more, softly: a body's sample is drawn by its weight and by how near
    its joint lies to the chosen parent's; the pose takes the angles between the two, so that nothing hangs loose.
    """
    poses = np.zeros((count, hand.dofs))
    known = np.zeros((count, hand.dofs))  # precision with which an entry is known so far
    palms = beliefs[0].means[rng.choice(len(beliefs[0].means), size=count, p=np.exp(beliefs[0].log_weights))]
    poses[:, :6] = palm_entries(hand, palms, reference)
    placed = {0: palms}
    for joint in graph.joints:
        parents, belief = placed[joint.parent], beliefs[joint.child]
        sockets = parents[:, PLACE] + rotations_of(parents) @ joint.rest[:, 3]
        beside = cdist(sockets, belief.means[:, PLACE], "sqeuclidean") / _FIT**2
        children = belief.means[draw_labels(belief.log_weights - 0.5 * beside, rng)]
        angles = angles_between(joint, parents, children)
        for r, entry in enumerate(joint.entries):  # a last joint is asked for the angle of the one before it, too
            precision = joint.gains[r] ** 2
            total = known[:, entry] + precision
            poses[:, entry] = (known[:, entry] * poses[:, entry] + precision * angles[:, r]) / total
            known[:, entry] = total
        placed[joint.child] = child_of(joint, parents, angles)
    return hand.constrain(poses)
