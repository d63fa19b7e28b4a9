"""Belief propagation (13-17): beliefs of the sixteen bodies from the messages of those around them and from the depth."""

from __future__ import annotations

import dataclasses
import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.distance import cdist

from spf.filters.annealed import annealing_exponent
from spf.filters.particles import normalise
from spf.nbp.bodies import PLACE, Bodies, aligned, rotations_of
from spf.nbp.evidence import EvidenceSettings, hidden_by, log_evidence
from spf.nbp.graph import Graph, Joint
from spf.nbp.joints import angles_between, child_of, draw_angles, parent_of
from spf.nbp.mixture import Mixture, log_density, mixture_of, reweighed, sample_product
from spf.observation import Observation
from spf.settings import setting

__all__ = ["BeliefSettings", "Messages", "Model", "propagate"]

Array = NDArray[np.float64]
_GROUP = "Belief propagation"
_LIGHTEST = 1.5  # nats by which dividing by a message (17) makes a sample heavier than another at most
_INSIDE = 0.02  # least that a structural message (2) leaves of a sample


@dataclasses.dataclass(frozen=True)
class BeliefSettings(EvidenceSettings):
    """How beliefs are propagated."""

    iterations: int = setting(4, "iterations of belief propagation a frame", group=_GROUP, low=1, high=50)
    sweeps: int = setting(2, "sweeps of the Gibbs sampler over the messages of a product", group=_GROUP, low=1, high=50)
    reach: float = setting(
        0.8,
        "what a joint's angle may differ from that between the bodies' samples; 3.2 is all of its range, as in the paper",
        group=_GROUP, low=0.01, high=3.2, unit="rad",
    )  # fmt: skip
    survival: float = setting(
        0.2,
        "least survival rate of a body's samples; evidence that leaves fewer is tempered",
        group=_GROUP, low=0.001, high=0.99, symbol="α",
    )  # fmt: skip
    structural: bool = setting(True, "keep bodies of different digits apart (2)", group=_GROUP)


class Model(NamedTuple):
    """What stays the same during a frame.

    Attributes:
        bodies, graph: of the hand.
        observation: of the frame.
        settings: of everything.
        temporal: messages (3) from the last frame to each body.
        anchors: (B, 4) orientations that quaternions are aligned to.
    """

    bodies: Bodies
    graph: Graph
    observation: Observation
    settings: BeliefSettings
    temporal: list[Mixture]
    anchors: Array


Messages = dict[tuple[int, int], Mixture]  # (from, to) → message


def propagate(
    model: Model, messages: Messages, before: list[Mixture], count: int, rng: np.random.Generator
) -> tuple[list[Mixture], Messages]:
    """One iteration: every body's belief, then every message of the joints.

    Args:
        model: of the frame.
        messages: of the last iteration, none in the first: bodies then know of nothing but the last frame.
        before: beliefs of the last iteration; the temporal messages in the first.
        count: M, samples of a belief.
        rng: randomness.

    Returns:
        (beliefs, messages).
    """
    hidden = hidden_by(model.observation, model.bodies, before) if model.settings.occlusion else None
    beliefs = []
    for body in range(len(before)):
        incoming = [model.temporal[body], *(m for (_, to), m in messages.items() if to == body)]
        drawn = sample_product(incoming, count, model.settings.sweeps, rng)
        states = aligned(drawn, model.anchors[body])
        hiding = model.graph.hiding[body]
        weights = log_evidence(model.observation, model.bodies, body, states, model.settings, hidden, hiding)
        if model.settings.structural:
            weights += _structural(model, body, states, before)
        exponent = min(annealing_exponent(weights, model.settings.survival), 1.0)
        beliefs.append(mixture_of(states, normalise(exponent * weights)))
    sent: Messages = {}
    for joint in model.graph.joints:
        up, down = (joint.child, joint.parent), (joint.parent, joint.child)
        sent[down] = _message(model, joint, beliefs, messages.get(up), down, rng)
        sent[up] = _message(model, joint, beliefs, messages.get(down), up, rng)
    return beliefs, sent


def _message(
    model: Model, joint: Joint, beliefs: list[Mixture], back: Mixture | None, way: tuple[int, int],
    rng: np.random.Generator,
) -> Mixture:  # fmt: skip
    """Message m_ij along a joint (17): samples of p̂(x_i)/m_ji moved through it by angles that it permits."""
    sender, receiver = way
    belief = beliefs[sender]
    if back is not None:
        against = log_density(belief.means, back)
        belief = reweighed(belief, -np.maximum(against, against.max() - _LIGHTEST))
    count = len(belief.means)
    source = belief.means[rng.choice(count, size=count, p=np.exp(belief.log_weights))]
    other = beliefs[receiver]
    paired = other.means[rng.choice(count, size=count, p=np.exp(other.log_weights))]
    downward = receiver == joint.child
    around = angles_between(joint, *((source, paired) if downward else (paired, source)))
    angles = draw_angles(joint, around, model.settings.reach, rng)
    states = child_of(joint, source, angles) if downward else parent_of(joint, source, angles)
    return mixture_of(aligned(states, model.anchors[receiver]), np.full(count, -math.log(count)))


def _structural(model: Model, body: int, states: Array, beliefs: list[Mixture]) -> Array:
    """Logarithm (M,) of the structural messages: the weight of the other body's kernels outside a ball around this one."""
    total = np.zeros(len(states))
    own = _middles(model.bodies, body, states)
    for edge in model.graph.apart:
        if body in (edge.one, edge.other):
            other = edge.other if body == edge.one else edge.one
            near = cdist(own, _middles(model.bodies, other, beliefs[other].means)) < edge.distance
            total += np.log(np.maximum(1.0 - near @ np.exp(beliefs[other].log_weights), _INSIDE))
    return total


def _middles(bodies: Bodies, body: int, states: Array) -> Array:
    """Middles (M, 3) of a body's skin, m, camera frame."""
    return states[:, PLACE] + rotations_of(states) @ bodies.centres[body]
