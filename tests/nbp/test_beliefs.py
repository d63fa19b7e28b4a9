"""Evidence, occlusion, structure, and what an iteration of belief propagation does to a hand that is put wrongly."""

from __future__ import annotations

import numpy as np
import pytest

from spf.hand.kinematics import joints_of
from spf.hand.model import BONES
from spf.locate import reach_of
from spf.nbp.beliefs import Model, _structural, propagate
from spf.nbp.bodies import PLACE, QUATERNION, bodies_of, states_of
from spf.nbp.evidence import EvidenceSettings, hidden_by, log_evidence
from spf.nbp.graph import graph_of
from spf.nbp.hands import draw_hands
from spf.nbp.mixture import Mixture
from spf.nbp.tracker import NbpSettings
from spf.observation import observe
from spf.synthetic import SyntheticSettings, synthesise

INDEX_TIP, LITTLE_TIP = BONES.index("index_distal"), BONES.index("little_distal")


@pytest.fixture(scope="module")
def scene():
    session = synthesise(SyntheticSettings(motion="open_close", sensor="ideal", frames=2, clutter="none", seed=4))
    truth = session[0].truth
    observation = observe(session[0], truth.pose[:3], reach_of(session.hand))
    return session.hand, truth, observation


def beliefs_at(states, spread=1e-3):
    return [Mixture(own, np.full(len(own), -np.log(len(own))), np.full(7, spread)) for own in states]


def test_a_body_is_likelier_where_it_is_than_beside_it(scene):
    hand, truth, observation = scene
    bodies, states = bodies_of(hand), states_of(hand, truth.pose[None], truth.orientation)
    for body in range(len(BONES)):
        moved = np.repeat(states[body], 4, axis=0)
        moved[1, 2] += 0.015
        moved[2, 2] -= 0.015
        moved[3, 0] += 0.06
        log_p = log_evidence(observation, bodies, body, moved, EvidenceSettings(), None, [])
        assert log_p[0] > log_p[1:].max() + 1.0


def test_what_another_body_hides_is_no_evidence_against_a_body(scene):
    """A fingertip 4 cm behind the palm: impossible if it is taken for visible, and no worse than unseen if the palm hides it."""
    hand, truth, observation = scene
    bodies, states = bodies_of(hand), states_of(hand, truth.pose[None], truth.orientation)
    behind = states[INDEX_TIP].copy()
    middle = states[0, 0, PLACE] * 0.4 + states[BONES.index("middle_proximal"), 0, PLACE] * 0.6
    behind[0, PLACE] = middle * (1.0 + 0.04 / middle[2])
    hidden = hidden_by(observation, bodies, beliefs_at(states))
    others = [body for body in range(len(BONES)) if body != INDEX_TIP]
    plain = log_evidence(observation, bodies, INDEX_TIP, behind, EvidenceSettings(), None, others)[0]
    aware = log_evidence(observation, bodies, INDEX_TIP, behind, EvidenceSettings(), hidden, others)[0]
    assert plain < -10.0
    assert aware > 0.25 * plain
    in_place = log_evidence(observation, bodies, INDEX_TIP, states[INDEX_TIP], EvidenceSettings(), hidden, others)[0]
    assert in_place > aware + 5.0


def test_the_share_of_a_cell_is_the_weight_of_the_samples_that_cover_it(scene):
    hand, truth, observation = scene
    bodies, states = bodies_of(hand), states_of(hand, truth.pose[None], truth.orientation)
    twice = np.repeat(states, 2, axis=1)
    twice[:, 1, 0] += 5.0  # far beside the picture
    beliefs = [Mixture(own, np.log([0.3, 0.7]), np.full(7, 1e-3)) for own in twice]
    hidden = hidden_by(observation, bodies, beliefs)
    assert hidden.shares.max() == pytest.approx(0.3)
    covered = hidden.shares[0] > 0.0
    assert covered.sum() > 50
    assert np.abs(hidden.depths[0][covered] - states[0, 0, 2]).max() < 0.1


def test_bodies_of_different_digits_are_kept_apart(scene):
    hand, truth, observation = scene
    bodies = bodies_of(hand)
    graph = graph_of(hand, bodies)
    states = states_of(hand, truth.pose[None], truth.orientation)
    anchors = states[:, 0, QUATERNION]
    model = Model(bodies, graph, observation, NbpSettings(), beliefs_at(states), anchors)
    ring = BONES.index("ring_distal")
    both = np.concatenate([states[LITTLE_TIP], states[ring]])
    free, inside = _structural(model, LITTLE_TIP, both, beliefs_at(states))
    assert free == pytest.approx(0.0)
    assert inside < -3.0


def test_iterations_refine_a_coarse_hand(scene, rng):
    """Fig. 4: from poses around a wrong one, beliefs move to the hand."""
    hand, truth, observation = scene
    bodies = bodies_of(hand)
    wrong = truth.pose + rng.normal(size=(60, hand.dofs)) * np.concatenate([[0.004] * 3, [0.05] * 3, [0.15] * 20])
    wrong[:, 0] += 0.015
    wrong = hand.constrain(wrong)
    states = states_of(hand, wrong, truth.orientation)
    anchors = states_of(hand, truth.pose[None], truth.orientation)[:, 0, QUATERNION]
    wide = np.array([0.008] * 3 + [0.08] * 4)
    temporal = [own._replace(bandwidth=wide) for own in beliefs_at(states)]
    model = Model(bodies, graph_of(hand, bodies), observation, NbpSettings(), temporal, anchors)
    beliefs, messages = temporal, {}
    for _ in range(4):
        beliefs, messages = propagate(model, messages, beliefs, 60, rng)
    assert len(messages) == 30
    drawn = draw_hands(hand, model.graph, beliefs, truth.orientation, 40, rng)

    def apart(poses):
        joints = np.mean([joints_of(hand, pose, truth.orientation) for pose in poses], axis=0)
        return np.linalg.norm(joints - truth.joints, axis=1).mean()

    assert apart(drawn) < 0.7 * apart(wrong)
