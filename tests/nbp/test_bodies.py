"""Bodies, joints and hands: there and back, and within what a hand can do."""

from __future__ import annotations

import numpy as np
import pytest

from spf.hand.kinematics import joints_of, pose_hand
from spf.hand.model import BONES, load_hand
from spf.nbp.bodies import PLACE, aligned, bodies_of, rotations_of, states_of
from spf.nbp.graph import graph_of
from spf.nbp.hands import draw_hands
from spf.nbp.joints import angles_between, child_of, draw_angles, parent_of
from spf.nbp.mixture import Mixture

TURN = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])


def pose_of(hand, rng):
    pose = np.zeros(hand.dofs)
    pose[:6] = [0.02, -0.01, 0.5, 0.2, -0.3, 0.1]
    low, high = hand.limits[6:].T
    pose[6:] = rng.uniform(0.8 * low, 0.8 * high)
    return pose


@pytest.mark.parametrize("side", ["right", "left"])
@pytest.mark.parametrize("free_dip", [False, True])
def test_a_hand_comes_back_from_its_bodies(side, free_dip, rng):
    hand = load_hand(side, free_dip=free_dip)
    graph = graph_of(hand, bodies_of(hand))
    for _ in range(5):
        pose = pose_of(hand, rng)
        states = states_of(hand, pose[None], TURN)
        beliefs = [Mixture(own, np.zeros(1), np.full(7, 1e-3)) for own in states]
        again = draw_hands(hand, graph, beliefs, TURN, 3, rng)
        assert again.shape == (3, hand.dofs)
        off = joints_of(hand, again[1], TURN) - joints_of(hand, pose, TURN)
        assert np.linalg.norm(off, axis=1).max() < 0.003  # a twist of a bent finger is told from its spread to a degree


def test_bodies_lie_on_the_posed_skin(rng):
    hand = load_hand("right")
    pose, bodies = pose_of(hand, rng), bodies_of(hand)
    states = states_of(hand, pose[None], TURN)
    skin = pose_hand(hand, pose, TURN).vertices
    for body in range(len(BONES)):
        points = states[body, 0, PLACE] + bodies.points[body] @ rotations_of(states[body])[0].T
        apart = np.linalg.norm(points[:, None] - skin, axis=2).min(axis=1)
        assert np.median(apart) < 0.002  # one bone alone does not bend the skin around a joint as all do
    assert (bodies.radii > 0.004).all()
    assert (bodies.radii < 0.03).all()


def test_joints_move_children_and_parents_alike(rng):
    hand = load_hand("left")
    for joint in graph_of(hand, bodies_of(hand)).joints:
        angles = draw_angles(joint, np.zeros((20, len(joint.axes))), 3.2, rng)
        assert (angles >= joint.limits[:, 0]).all()
        assert (angles <= joint.limits[:, 1]).all()
        parents = aligned(rng.normal(size=(20, 7)), np.array([0.0, 0.0, 0.0, 1.0]))
        children = child_of(joint, parents, angles)
        back = parent_of(joint, children, angles)
        np.testing.assert_allclose(back[:, PLACE], parents[:, PLACE], atol=1e-9)
        np.testing.assert_allclose(rotations_of(back), rotations_of(parents), atol=1e-9)
        found = angles_between(joint, parents, children)
        np.testing.assert_allclose(found, angles, atol=1e-6 if len(joint.axes) < 3 else 0.08)


def test_angles_are_drawn_around_others_and_within_the_limits(rng):
    hand = load_hand("right")
    joint = graph_of(hand, bodies_of(hand)).joints[-1]
    around = np.full((200, 1), joint.limits[0, 1])
    drawn = draw_angles(joint, around, 0.2, rng)
    assert drawn.max() <= joint.limits[0, 1]
    assert drawn.min() >= joint.limits[0, 1] - 0.2
    assert np.ptp(drawn) > 0.15


def test_the_graph_joins_all_bodies_and_keeps_digits_apart():
    hand = load_hand("right")
    graph = graph_of(hand, bodies_of(hand))
    reached = {0}
    for joint in graph.joints:
        assert joint.parent in reached  # parents first
        reached.add(joint.child)
    assert len(reached) == len(BONES)
    for edge in graph.apart:
        assert (edge.one - 1) // 3 != (edge.other - 1) // 3
        assert 0.005 < edge.distance < 0.03
