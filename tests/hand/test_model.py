"""The hand model: its mesh, its degrees of freedom, its limits, and the files that are no hand."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from spf.errors import HandError
from spf.hand import BONES, DOF_NAMES, FREE_DIP_NAMES, load_hand
from spf.hand.kinematics import joints_of, pose_hand
from tests.hand.makers import bundled_bytes, write_changed_glb

SIDES = ("left", "right")


def edges(faces: np.ndarray) -> list[tuple[int, int]]:
    return [(int(f[k]), int(f[(k + 1) % 3])) for f in faces for k in range(3)]


@pytest.mark.parametrize("side", SIDES)
class TestMesh:
    def test_is_watertight_after_welding(self, side: str) -> None:
        """Each directed edge is there once, and its opposite too: closed, and all faces turned alike."""
        hand = load_hand(side)
        assert len(hand.skin.vertices) == 1159
        assert len(hand.faces) == 2314
        directed = edges(hand.faces)
        assert len(set(directed)) == len(directed)
        assert {(b, a) for a, b in directed} == set(directed)
        assert len(hand.skin.vertices) - len(directed) // 2 + len(hand.faces) == 2  # Euler: one piece, no handle

    def test_is_turned_outward(self, side: str) -> None:
        hand = load_hand(side)
        a, b, c = (hand.skin.vertices[hand.faces[:, k]] for k in range(3))
        volume = np.einsum("ij,ij->i", a, np.cross(b, c)).sum() / 6.0
        assert 2e-4 < volume < 5e-4  # m³: a hand is about a third of a litre

    def test_weights_are_convex_and_of_at_most_four_bones(self, side: str) -> None:
        skin = load_hand(side).skin
        np.testing.assert_allclose(skin.influence_weight.sum(axis=1), 1.0)
        assert (skin.influence_weight >= 0).all()
        assert (np.diff(skin.influence_weight, axis=1) <= 0).all()
        np.testing.assert_array_equal(skin.influence_count, (skin.influence_weight > 0).sum(axis=1))

    def test_the_proxy_is_close_to_the_skin(self, side: str) -> None:
        hand = load_hand(side)
        gaps = np.linalg.norm(hand.proxy.vertices[:, None] - hand.skin.vertices[None], axis=2).min(axis=1)
        assert len(hand.proxy_faces) < 0.3 * len(hand.faces)
        assert gaps.max() < 0.008

    def test_every_digit_has_skin_on_its_side(self, side: str) -> None:
        hand = load_hand(side)
        across = [hand.skin.vertices[hand.digit == digit, 0].mean() for digit in range(1, 6)]
        order = np.diff(across)  # thumb to little finger: one way across the hand
        assert (order > 0).all() if side == "right" else (order < 0).all()
        assert set(hand.digit) == set(range(6))


class TestDegreesOfFreedom:
    def test_there_are_26_and_30(self) -> None:
        assert load_hand("right").dof_names == DOF_NAMES
        assert load_hand("right", free_dip=True).dof_names == DOF_NAMES + FREE_DIP_NAMES
        assert (len(DOF_NAMES), len(DOF_NAMES + FREE_DIP_NAMES)) == (26, 30)

    def test_there_are_16_bones_parents_first(self) -> None:
        parent = load_hand("right").skeleton.parent
        assert len(parent) == len(BONES) == 16
        assert parent[0] == -1
        assert (parent[1:] < np.arange(1, 16)).all()

    def test_a_tied_dip_bends_two_thirds_of_the_pip(self) -> None:
        """The 30-DOF hand with DIP = 2/3 PIP is the 26-DOF hand."""
        tied, free = load_hand("right"), load_hand("right", free_dip=True)
        pose = tied.neutral_pose()
        pip = [DOF_NAMES.index(f"{finger}_pip_flexion") for finger in ("index", "middle", "ring", "little")]
        pose[pip] = np.radians([30.0, 60.0, 90.0, 110.0])
        freed = np.concatenate([pose, 2.0 / 3.0 * pose[pip]])
        np.testing.assert_allclose(joints_of(free, freed), joints_of(tied, pose), atol=1e-12)

    def test_each_one_moves_its_own_digit_only(self) -> None:
        hand = load_hand("right", free_dip=True)
        still = pose_hand(hand, hand.neutral_pose()).joints
        for entry, name in enumerate(hand.dof_names[6:], start=6):
            pose = hand.neutral_pose()
            pose[entry] = 0.3
            moved = np.linalg.norm(pose_hand(hand, pose).joints - still, axis=1) > 1e-9
            digit = ("thumb", "index", "middle", "ring", "little").index(name.split("_")[0])
            of_digit = np.zeros(21, dtype=bool)
            of_digit[1 + 4 * digit : 5 + 4 * digit] = True
            assert not moved[~of_digit].any()
            if not name.endswith("twist"):  # a straight finger's joints stay on the axis that it twists about
                assert moved[of_digit].any()


class TestLimits:
    @given(seed=st.integers(0, 2**31), spread=st.floats(0.0, 10.0))
    def test_constrain_clips_into_them_and_is_idempotent(self, seed: int, spread: float) -> None:
        hand = load_hand("right", free_dip=True)
        pose = np.random.default_rng(seed).normal(0.0, spread, (3, 30))
        constrained = hand.constrain(pose)
        assert (constrained >= hand.limits[:, 0]).all()
        assert (constrained <= hand.limits[:, 1]).all()
        np.testing.assert_array_equal(hand.constrain(constrained), constrained)
        inside = (pose >= hand.limits[:, 0]) & (pose <= hand.limits[:, 1])
        np.testing.assert_array_equal(constrained[inside], pose[inside])

    def test_the_palm_has_none(self) -> None:
        far = np.zeros(26)
        far[:6] = 100.0
        np.testing.assert_array_equal(load_hand("left").constrain(far), far)

    def test_the_bind_pose_is_inside(self) -> None:
        limits = load_hand("right").limits
        assert (limits[:, 0] < 0).all()
        assert (limits[:, 1] > 0).all()

    def test_fingers_close_far_and_hardly_open_backwards(self) -> None:
        hand = load_hand("right")
        for finger in ("index", "middle", "ring", "little"):
            for joint, least in (("mp", 85), ("pip", 100)):
                low, high = np.degrees(hand.limits[hand.dof_names.index(f"{finger}_{joint}_flexion")])
                assert high >= least
                assert -30 <= low < 0


class TestScale:
    def test_scaling_enlarges_everything(self) -> None:
        hand = load_hand("right")
        pose = 0.4 * np.ones(26)
        pose[:3] = 0.0
        large = hand.scaled(1.25)
        np.testing.assert_allclose(pose_hand(large, pose).vertices, 1.25 * pose_hand(hand, pose).vertices, atol=1e-12)
        np.testing.assert_allclose(pose_hand(large, pose).normals, pose_hand(hand, pose).normals, atol=1e-12)
        np.testing.assert_allclose(joints_of(large, pose), 1.25 * joints_of(hand, pose), atol=1e-12)
        assert large.length == pytest.approx(1.25 * hand.length)

    def test_a_hand_is_as_long_as_a_hand(self) -> None:
        assert 0.16 < load_hand("right").length < 0.21


class TestFiles:
    def test_any_webxr_hand_loads(self, tmp_path: Path) -> None:
        path = tmp_path / "mine.glb"
        path.write_bytes(bundled_bytes("left"))
        mine, bundled = load_hand("left", path), load_hand("left")
        np.testing.assert_array_equal(mine.skin.vertices, bundled.skin.vertices)

    def test_without_some_joints(self, tmp_path: Path) -> None:
        def rename(gltf: dict[str, Any]) -> None:
            for node in gltf["nodes"]:
                node["name"] = node.get("name", "").replace("thumb", "dewclaw").replace("wrist", "ankle")

        path = write_changed_glb(tmp_path / "paw.glb", rename)
        with pytest.raises(HandError, match=r"lacks the WebXR joints wrist, thumb-metacarpal, .*; name its joints"):
            load_hand("right", path)

    def test_without_a_skin(self, tmp_path: Path) -> None:
        path = write_changed_glb(tmp_path / "statue.glb", lambda gltf: gltf.pop("skins"))
        with pytest.raises(HandError, match="no complete skinned mesh"):
            load_hand("right", path)

    @pytest.mark.parametrize(
        ("content", "says"),
        [
            (b"", "not a binary glTF"),
            (b"solid hand\nendsolid", "not a binary glTF"),
            (bundled_bytes()[:300], "torn"),
            (bundled_bytes()[:20_000], "no complete skinned mesh|torn"),
        ],
        ids=["empty", "another format", "torn header", "torn mesh"],
    )
    def test_that_are_no_hand(self, tmp_path: Path, content: bytes, says: str) -> None:
        path = tmp_path / "broken.glb"
        path.write_bytes(content)
        with pytest.raises(HandError, match=says) as caught:
            load_hand("right", path)
        assert str(caught.value).count("\n") == 0
        assert str(caught.value).endswith(".")

    def test_that_are_not_there(self, tmp_path: Path) -> None:
        with pytest.raises(HandError, match=r"nothing\.glb cannot be read: No such file"):
            load_hand("right", tmp_path / "nothing.glb")

    def test_a_hand_has_a_side(self) -> None:
        with pytest.raises(HandError, match="'left' or 'right', not 'both'"):
            load_hand("both")  # type: ignore[arg-type]
