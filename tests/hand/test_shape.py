"""Hand shapes: what each factor changes and what it leaves, and the files that hold them."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from spf.errors import HandError
from spf.hand import BONES, Hand, HandShape, load_hand, read_hand_shape, write_hand_shape
from spf.hand.kinematics import joints_of, pose_hand
from spf.hand.shape import lengths_of_digits, shaped

#: For each digit bone, in the order of BONES[1:]: the joints at which it begins and ends.
BONE_ENDS = [(1 + 4 * digit + part, 2 + 4 * digit + part) for digit in range(5) for part in range(3)]


def bone_lengths(hand: Hand) -> np.ndarray:
    joints = joints_of(hand, hand.neutral_pose())
    return np.array([np.linalg.norm(joints[end] - joints[start]) for start, end in BONE_ENDS])


@pytest.mark.parametrize("side", ["left", "right"])
def test_the_identity_shape_changes_nothing(side: str) -> None:
    hand = load_hand(side)
    same = shaped(hand, HandShape(side))  # type: ignore[arg-type]
    pose = 0.3 * np.ones(26)
    np.testing.assert_allclose(pose_hand(same, pose).vertices, pose_hand(hand, pose).vertices, atol=1e-6)
    np.testing.assert_allclose(pose_hand(same, pose).normals, pose_hand(hand, pose).normals, atol=1e-6)
    np.testing.assert_allclose(joints_of(same, pose), joints_of(hand, pose), atol=1e-6)


def test_scale_scales_and_says_the_same_as_the_hand_s_own() -> None:
    hand, pose = load_hand("right"), 0.3 * np.ones(26)
    pose[:3] = 0.0
    large = shaped(hand, HandShape("right", scale=1.3))
    np.testing.assert_allclose(pose_hand(large, pose).vertices, pose_hand(hand.scaled(1.3), pose).vertices, atol=1e-6)
    np.testing.assert_allclose(joints_of(large, pose), 1.3 * joints_of(hand, pose), atol=1e-6)


@given(
    lengths=st.lists(st.floats(0.6, 1.6), min_size=15, max_size=15),
    scale=st.floats(0.5, 1.8),
)
def test_lengths_change_exactly_the_bones_lengths(lengths: list[float], scale: float) -> None:
    hand = load_hand("right")
    other = shaped(hand, HandShape("right", scale=scale, lengths=tuple(lengths)))
    np.testing.assert_allclose(bone_lengths(other), scale * np.array(lengths) * bone_lengths(hand), rtol=1e-3)
    knuckles = [0, 1, 5, 9, 13, 17]  # wrist and where the digits begin: the palm's own
    np.testing.assert_allclose(
        np.diff(joints_of(other, np.zeros(26))[knuckles], axis=0),
        scale * np.diff(joints_of(hand, np.zeros(26))[knuckles], axis=0),
        atol=1e-6,
    )


def test_a_longer_bone_takes_its_skin_along() -> None:
    hand = load_hand("right")
    longer = shaped(hand, HandShape("right", lengths=lengths_of_digits((1.0, 1.3, 1.0, 1.0, 1.0))))
    reach = [float(-h.skin.vertices[h.digit == 2, 2].min()) for h in (hand, longer)]
    assert reach[1] - reach[0] == pytest.approx(0.3 * bone_lengths(hand)[3:6].sum(), rel=0.25)
    others = (hand.digit > 2) | (hand.digit == 1)
    shift = (longer.skin.vertices - longer.skeleton.bind[0, :, 3]) - (hand.skin.vertices - hand.skeleton.bind[0, :, 3])
    assert np.linalg.norm(shift[others], axis=1).max() < 0.005  # skin between two digits hangs on both


def test_palm_and_finger_thickness_change_the_cross_sections() -> None:
    hand = load_hand("right")
    thick = shaped(hand, HandShape("right", finger_thickness=1.2))
    wide = shaped(hand, HandShape("right", palm_width=1.1, palm_thickness=1.2))
    tip_of_middle = 9  # BONES: the middle finger's distal bone

    def cross_section(h: Hand) -> float:
        skin = h.skin.vertices[h.skin.influence_bone[:, 0] == tip_of_middle]
        local = skin @ h.skeleton.inverse_bind[tip_of_middle, :, :3].T
        return float(np.ptp(local[:, 0]))

    assert BONES[tip_of_middle] == "middle_distal"
    assert cross_section(thick) == pytest.approx(1.2 * cross_section(hand), rel=0.03)
    np.testing.assert_allclose(bone_lengths(thick), bone_lengths(hand), rtol=1e-2)
    knuckles = [joints_of(h, np.zeros(26))[[5, 17], 0] for h in (hand, wide)]
    assert np.ptp(knuckles[1]) == pytest.approx(1.1 * np.ptp(knuckles[0]), rel=1e-6)


def test_a_shape_makes_its_own_hand() -> None:
    shape = HandShape("left", scale=0.8)
    assert shape.hand().side == "left"
    assert shape.hand(free_dip=True).dofs == 30
    assert shape.hand().length == pytest.approx(0.8 * load_hand("left").length)


def test_a_shape_of_the_other_side_is_refused() -> None:
    with pytest.raises(HandError, match="of a left hand and the model is a right hand"):
        shaped(load_hand("right"), HandShape("left"))


class TestFiles:
    def test_survive_the_round_trip(self, tmp_path: Path) -> None:
        shape = HandShape("left", 0.9, tuple(np.linspace(0.8, 1.2, 15)), 1.05, 0.95, 1.1)
        write_hand_shape(shape, tmp_path / "hand.json")
        assert read_hand_shape(tmp_path / "hand.json") == shape

    def test_may_leave_out_what_is_standard(self, tmp_path: Path) -> None:
        path = tmp_path / "hand.json"
        path.write_text('{"format": "spf-hand-shape", "version": 1, "side": "right"}')
        assert read_hand_shape(path) == HandShape("right")

    @pytest.mark.parametrize(
        ("text", "says"),
        [
            ("", "torn or not JSON"),
            ('{"format": "spf-hand-shape", "side": "ri', "torn or not JSON"),
            ("[1, 2]", "is not a hand shape"),
            ('{"format": "png", "side": "right"}', "is not a hand shape"),
        ],
        ids=["empty", "torn", "a list", "another format"],
    )
    def test_that_are_no_shape(self, tmp_path: Path, text: str, says: str) -> None:
        path = tmp_path / "hand.json"
        path.write_text(text)
        self.check(path, says)

    @pytest.mark.parametrize(
        ("change", "says"),
        [
            ({"side": "both"}, "no human hand"),
            ({"side": None}, "no human hand"),
            ({"scale": 5.0}, "no human hand"),
            ({"scale": "big"}, "not a number"),
            ({"scale": float("nan")}, "no human hand"),
            ({"lengths": [1.0] * 14}, "no human hand"),
            ({"lengths": [0.1] + [1.0] * 14}, "no human hand"),
            ({"lengths": 3}, "not a number"),
            ({"palm_width": [1]}, "not a number"),
        ],
        ids=str,
    )
    def test_with_a_wrong_value(self, tmp_path: Path, change: dict[str, Any], says: str) -> None:
        path = tmp_path / "hand.json"
        path.write_text(json.dumps(HandShape("right").to_dict() | change))
        self.check(path, says)

    def test_without_a_side(self, tmp_path: Path) -> None:
        content = HandShape("right").to_dict()
        del content["side"]
        path = tmp_path / "hand.json"
        path.write_text(json.dumps(content))
        self.check(path, "is not a hand shape")

    def test_that_are_not_there(self, tmp_path: Path) -> None:
        self.check(tmp_path / "nothing.json", "cannot be read: No such file")

    @staticmethod
    def check(path: Path, says: str) -> None:
        with pytest.raises(HandError, match=says) as caught:
            read_hand_shape(path)
        assert str(path) in str(caught.value)
        assert "\n" not in str(caught.value)
        assert str(caught.value).endswith(".")
