"""The spheres inside the digits."""

from __future__ import annotations

import numpy as np
import pytest

from spf.cost.problem import costs
from spf.cost.spheres import digit_spheres
from spf.hand.model import BONES, Hand, load_hand, mirrored
from spf.kernels.cost import Spheres
from tests.reference.hand import bone_transforms
from tests.scenes import CAMERAS, FACING, hand_problem, natural_pose


@pytest.mark.parametrize("side", ["left", "right"])
def test_spheres_fit_the_skin_of_their_bone(side: str) -> None:
    hand = load_hand(side)
    spheres = digit_spheres(hand)
    assert spheres.bone.min() > 0  # the palm has none
    assert len(np.unique(spheres.bone)) == len(BONES) - 1
    assert ((spheres.radius > 0.002) & (spheres.radius < 0.02)).all()
    for bone, centre, radius in zip(spheres.bone, in_model(hand, spheres), spheres.radius, strict=True):
        own = hand.skin.vertices[hand.skin.influence_bone[:, 0] == bone]
        distance = np.linalg.norm(own - centre, axis=1)
        assert distance.min() < 2 * radius  # at the skin of its own bone, not beside it
        assert np.median(distance) > radius  # and inside of it


def test_pairs_are_of_digits_that_can_meet() -> None:
    spheres = digit_spheres(load_hand("right"))
    digits = (spheres.bone - 1) // 3
    met = {(int(digits[a]), int(digits[b])) for a, b in pairs(spheres)}
    assert met == {(0, 1), (0, 2), (0, 3), (1, 2), (2, 3), (3, 4)}


def test_nothing_collides_in_the_bind_pose() -> None:
    hand = load_hand("right")
    spheres = digit_spheres(hand)
    homogeneous = np.c_[in_model(hand, spheres), np.ones(len(spheres.bone))]
    transforms = bone_transforms(hand, hand.neutral_pose(), FACING)
    place = np.einsum("qij,qj->qi", transforms[spheres.bone], homogeneous)[:, :3]
    a, b = np.array(pairs(spheres)).T
    overlap = spheres.radius[a] + spheres.radius[b] - np.linalg.norm(place[a] - place[b], axis=1)
    assert overlap.max() < 0


def test_a_mirrored_hand_has_the_mirrored_spheres() -> None:
    hand = load_hand("right")
    own, other = digit_spheres(hand), digit_spheres(mirrored(hand))
    np.testing.assert_allclose(in_model(mirrored(hand), other), in_model(hand, own) * [-1, 1, 1], atol=1e-9)
    np.testing.assert_allclose(other.radius, own.radius, atol=1e-9)
    np.testing.assert_array_equal(other.partners, own.partners)


def test_crossing_fingers_costs() -> None:
    hand = load_hand("right")
    apart = natural_pose(hand)
    crossed = apart.copy()
    crossed[[hand.dof_names.index(f"{finger}_mp_abduction") for finger in ("index", "middle")]] = -0.3, 0.2
    problem = hand_problem(hand, apart, CAMERAS["pinhole"])
    free = problem._replace(weights=problem.weights._replace(collision=0.0))
    pushed = costs(problem, np.stack([apart, crossed])) - costs(free, np.stack([apart, crossed]))
    assert pushed[0] == pytest.approx(0, abs=1e-9)
    assert pushed[1] > 1


def pairs(spheres: Spheres) -> list[tuple[int, int]]:
    return [(a, b) for a, (first, last) in enumerate(spheres.partners.tolist()) for b in range(first, last)]


def in_model(hand: Hand, spheres: Spheres) -> np.ndarray:
    """Centres in the bind pose, model frame."""
    bind = hand.skeleton.bind[spheres.bone]
    return np.einsum("qij,qj->qi", bind[:, :, :3], spheres.centre) + bind[:, :, 3]
