"""Posing against a naive formulation, and what must hold of any pose."""

from __future__ import annotations

from importlib.resources import as_file, files

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from spf.errors import HandError
from spf.frame import JOINT_NAMES
from spf.hand import Hand, load_hand, model
from spf.hand.glb import SkinnedMesh, read_glb
from spf.hand.kinematics import angles_of, joints_of, joints_of_each, pose_hand, rotation_about
from spf.hand.model import mirrored
from tests.reference.skinning import pose_mesh

SIDES = ("left", "right")
WEBXR_OF_JOINT = {
    "wrist": "wrist",
    **{
        f"thumb_{ours}": f"thumb-{webxr}"
        for ours, webxr in zip(
            ("tm", "mp", "ip", "tip"), ("metacarpal", "phalanx-proximal", "phalanx-distal", "tip"), strict=True
        )
    },
    **{
        f"{finger}_{ours}": f"{'pinky' if finger == 'little' else finger}-finger-{webxr}"
        for finger in ("index", "middle", "ring", "little")
        for ours, webxr in zip(
            ("mcp", "pip", "dip", "tip"),
            ("phalanx-proximal", "phalanx-intermediate", "phalanx-distal", "tip"),
            strict=True,
        )
    },
}


def file_mesh(side: str) -> SkinnedMesh:
    with as_file(files("spf.hand") / "assets" / f"{side}.glb") as path:
        return read_glb(path)


def random_pose(hand: Hand, rng: np.random.Generator) -> np.ndarray:
    pose = np.concatenate([rng.normal(0.0, 0.3, 3), rng.uniform(-1.2, 1.2, 3), np.zeros(hand.dofs - 6)])
    pose[6:] = rng.uniform(hand.limits[6:, 0], hand.limits[6:, 1])
    return pose


@pytest.mark.parametrize("side", SIDES)
def test_faint_influences_hardly_move_the_surface(side: str, rng: np.random.Generator) -> None:
    hand, mesh = load_hand(side), file_mesh(side)
    for _ in range(20):
        pose, reference = random_pose(hand, rng), Rotation.random(rng=rng).as_matrix()
        vertices, _, _ = pose_mesh(mesh, side, dict(zip(hand.dof_names, pose, strict=True)), reference)
        moved = np.linalg.norm(pose_hand(hand, pose, reference).vertices - vertices, axis=1)
        assert moved.mean() < 1e-4
        assert moved.max() < 2e-3


@pytest.mark.parametrize("free_dip", [False, True])
@pytest.mark.parametrize("side", SIDES)
def test_agrees_with_textbook_skinning(
    side: str, free_dip: bool, rng: np.random.Generator, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(model, "_FAINT", 0.0)  # all influences of the file
    hand, mesh = load_hand.__wrapped__(side, free_dip=free_dip), file_mesh(side)
    for _ in range(5):
        pose, reference = random_pose(hand, rng), Rotation.random(rng=rng).as_matrix()
        posed = pose_hand(hand, pose, reference)
        vertices, normals, joints = pose_mesh(mesh, side, dict(zip(hand.dof_names, pose, strict=True)), reference)
        np.testing.assert_allclose(posed.vertices, vertices, atol=1e-6)  # the file's matrices are float32
        np.testing.assert_allclose(posed.normals, normals, atol=1e-4)
        expected = [joints[WEBXR_OF_JOINT[name]] for name in JOINT_NAMES]
        np.testing.assert_allclose(posed.joints, expected, atol=1e-6)


@pytest.mark.parametrize("side", SIDES)
def test_the_bind_pose_is_the_mesh(side: str) -> None:
    """Up to the move of the palm's centre into the origin, with the wrist's axes."""
    hand, mesh = load_hand(side), file_mesh(side)
    posed = pose_hand(hand, hand.neutral_pose())
    wrist = mesh.bind[mesh.joint_names.index("wrist")]
    shift = hand.skeleton.bind[0, :, 3]
    np.testing.assert_allclose(posed.vertices, (mesh.vertices - wrist[:3, 3]) @ wrist[:3, :3] + shift, atol=1e-6)
    np.testing.assert_allclose(posed.vertices, hand.skin.vertices, atol=1e-6)
    np.testing.assert_allclose(posed.normals, hand.skin.normals, atol=1e-4)


@given(
    seed=st.integers(0, 2**31),
    turn=st.tuples(*[st.floats(-1.4, 1.4)] * 3),
    shift=st.tuples(*[st.floats(-2.0, 2.0)] * 3),
)
def test_moving_the_palm_moves_everything_rigidly(seed: int, turn: tuple[float, ...], shift: tuple[float, ...]) -> None:
    hand = load_hand("right")
    pose = random_pose(hand, np.random.default_rng(seed))
    pose[:6] = 0.0
    still, moved = pose_hand(hand, pose), pose.copy()
    moved[:3], moved[3:6] = shift, turn
    rotation = rotation_about(turn)
    for angles in (moved, None):  # the same turn as angles, or as the reference orientation
        palm_only = np.concatenate([shift, np.zeros(3), pose[6:]])
        posed = pose_hand(hand, moved) if angles is not None else pose_hand(hand, palm_only, rotation)
        np.testing.assert_allclose(posed.vertices, still.vertices @ rotation.T + shift, atol=1e-10)
        np.testing.assert_allclose(posed.normals, still.normals @ rotation.T, atol=1e-10)
        np.testing.assert_allclose(posed.joints, still.joints @ rotation.T + shift, atol=1e-10)


@given(seed=st.integers(0, 2**31))
def test_mirrored_poses_mirror(seed: int) -> None:
    hand = load_hand("right")
    other = mirrored(hand)
    pose = random_pose(hand, np.random.default_rng(seed))
    reflected = pose.copy()
    reflected[[0, 4, 5]] *= -1.0  # x, and the turns about y and z
    expected = pose_hand(hand, pose)
    posed = pose_hand(other, reflected)
    np.testing.assert_allclose(posed.vertices * (-1, 1, 1), expected.vertices, atol=1e-6)
    np.testing.assert_allclose(posed.joints * (-1, 1, 1), expected.joints, atol=1e-6)


def test_the_joints_of_many_poses_are_those_of_each(rng):
    hand = load_hand("left").scaled(1.2)
    poses = rng.normal(scale=0.4, size=(5, 26))
    turned = rotation_about((0.4, -0.2, 1.1))
    for axes in (None, turned):
        one_by_one = [joints_of(hand, pose, axes) for pose in poses]
        np.testing.assert_allclose(joints_of_each(hand, poses, axes), one_by_one, atol=1e-12)


def test_the_left_mesh_is_nearly_the_right_one_mirrored() -> None:
    """The two bundled files differ by up to 3 mm, in the thumb."""
    right, left = (joints_of(load_hand(side), np.zeros(26)) for side in ("right", "left"))
    np.testing.assert_allclose(left * (-1, 1, 1), right, atol=3e-3)


@pytest.mark.parametrize("side", SIDES)
def test_signs_are_the_documented_ones(side: str) -> None:
    """Flexion closes (towards the palm, −y), abduction goes to the thumb (−x on a right hand)."""
    hand = load_hand(side)
    towards_thumb = -1.0 if side == "right" else 1.0
    still = joints_of(hand, hand.neutral_pose())
    assert still[4, 0] * towards_thumb > 0.03  # the thumb is where it should be
    for finger, tip in (("index", 8), ("middle", 12), ("ring", 16), ("little", 20)):
        for name, axis, sense in ((f"{finger}_mp_flexion", 1, -1.0), (f"{finger}_mp_abduction", 0, towards_thumb)):
            pose = hand.neutral_pose()
            pose[hand.dof_names.index(name)] = 0.2
            assert (joints_of(hand, pose) - still)[tip, axis] * sense > 0.008
    for name in ("thumb_tm_flexion", "thumb_mp_flexion", "thumb_ip_flexion"):
        pose = hand.neutral_pose()
        pose[hand.dof_names.index(name)] = 0.3
        assert (joints_of(hand, pose) - still)[4, 0] * towards_thumb < -0.003  # across the palm


def test_joints_of_is_the_joints_of_pose_hand(rng: np.random.Generator) -> None:
    hand = load_hand("left")
    pose = random_pose(hand, rng)
    np.testing.assert_array_equal(joints_of(hand, pose), pose_hand(hand, pose).joints)


def test_joints_lie_inside_the_skin() -> None:
    """Every joint has skin within 2 cm; the tip joints lie some millimetres under it."""
    hand = load_hand("right")
    posed = pose_hand(hand, hand.neutral_pose())
    nearest = np.linalg.norm(posed.vertices[None] - posed.joints[:, None], axis=2).min(axis=1)
    assert nearest.max() < 0.02
    assert (nearest[[4, 8, 12, 16, 20]] > 0.004).all()


class TestRotations:
    @given(angles=st.tuples(*[st.floats(-3.0, 3.0)] * 3))
    def test_rotation_about_is_the_intrinsic_xyz_rotation(self, angles: tuple[float, float, float]) -> None:
        np.testing.assert_allclose(rotation_about(angles), Rotation.from_euler("XYZ", angles).as_matrix(), atol=1e-12)

    @given(angles=st.tuples(st.floats(-3.1, 3.1), st.floats(-1.5, 1.5), st.floats(-3.1, 3.1)))
    def test_angles_of_is_its_inverse(self, angles: tuple[float, float, float]) -> None:
        np.testing.assert_allclose(angles_of(rotation_about(angles)), angles, atol=1e-6)


class TestWrongPoses:
    def test_of_another_hand(self) -> None:
        with pytest.raises(HandError, match="26 entries"):
            pose_hand(load_hand("right"), np.zeros(30))

    def test_not_finite(self) -> None:
        pose = np.zeros(26)
        pose[9] = np.nan
        with pytest.raises(HandError, match="not a finite number"):
            joints_of(load_hand("right"), pose)
