"""The z-buffer against a ray caster and a sphere's formula; visibility; the comparison of depth maps."""

from __future__ import annotations

import numpy as np
import pytest

from spf.frame import Camera
from spf.hand import Hand, load_hand
from spf.hand.kinematics import PosedHand, pose_hand
from spf.kernels.cost_inputs import EMPTY, HAND, UNKNOWN
from spf.kernels.golden import compare_depth
from spf.kernels.kinematics import make_chain, pose_bones
from spf.kernels.render import FAR, project_skin, project_vertices, rasterise
from spf.kernels.sight import visible_vertices
from tests.reference.ray_casting import cast_rays

PINHOLE = Camera(56, 48, 110.0, 112.0, 27.3, 23.8)
ORTHOGRAPHIC = Camera(56, 48, 230.0, 230.0, 27.3, 23.8, "orthographic")
CAMERAS = pytest.mark.parametrize("camera", [PINHOLE, ORTHOGRAPHIC], ids=["pinhole", "orthographic"])


def numbers(camera: Camera) -> np.ndarray:
    return np.array([camera.fx, camera.fy, camera.cx, camera.cy, float(camera.model == "pinhole")])


def draw(vertices: np.ndarray, faces: np.ndarray, camera: Camera) -> tuple[np.ndarray, np.ndarray]:
    projected = np.empty((len(vertices), 3), np.float32)
    depth = np.empty((camera.height, camera.width), np.float32)
    project_vertices(vertices, numbers(camera), projected)
    rasterise(projected, faces, depth)
    return projected, depth


PALM = np.array([[-1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, 1.0, 0.0]])


def bent_pose(hand: Hand, z: float = 0.5) -> np.ndarray:
    pose = hand.constrain(np.full(hand.dofs, 0.35))
    pose[:6] = 0.0, 0.0, z, 0.4, 0.3, -0.2
    return pose


def bent(hand: Hand, z: float = 0.5) -> PosedHand:
    return pose_hand(hand, bent_pose(hand, z), PALM)


@pytest.fixture(scope="module")
def hand() -> Hand:
    return load_hand("right")


@CAMERAS
def test_projection_is_the_camera_s(hand: Hand, camera: Camera) -> None:
    posed = bent(hand)
    projected, _ = draw(posed.vertices, hand.faces, camera)
    np.testing.assert_allclose(projected[:, :2], camera.project(posed.vertices), atol=1e-4)
    np.testing.assert_allclose(projected[:, 2], posed.vertices[:, 2], atol=1e-6)


@CAMERAS
def test_posing_and_projecting_in_one_go_is_the_same(hand: Hand, camera: Camera) -> None:
    pose = hand.constrain(np.full(hand.dofs, 0.35))
    pose[:6] = 0.01, -0.02, 0.6, 0.4, 0.3, -0.2
    chain = make_chain(len(hand.skeleton.parent), len(hand.skeleton.revolute_bone))
    pose_bones(hand.skeleton, pose, np.eye(3), chain)
    projected = np.empty((len(hand.skin.vertices), 3), np.float32)
    for scale in (1.0, 0.8):
        project_skin(hand.skin, chain, scale, pose, numbers(camera), projected)
        expected, _ = draw(pose_hand(hand.scaled(scale), pose).vertices, hand.faces, camera)
        np.testing.assert_allclose(projected, expected, atol=1e-3)


@CAMERAS
def test_a_hand_is_drawn_as_rays_see_it(hand: Hand, camera: Camera) -> None:
    posed = bent(hand)
    _, drawn = draw(posed.vertices, hand.faces, camera)
    cast = cast_rays(posed.vertices, hand.faces, camera)
    covered = drawn < FAR
    assert covered.sum() > 300
    assert (covered != np.isfinite(cast)).sum() <= 2  # rays along an edge
    both = covered & np.isfinite(cast)
    assert (np.abs(drawn[both] - cast[both]) < 1e-4).mean() > 0.995  # and the few where folded skin faces away


def test_nothing_is_drawn_behind_the_camera_or_beside_the_picture(hand: Hand) -> None:
    for offset in ((0.0, 0.0, -1.2), (3.0, 0.0, 0.0), (0.0, -3.0, 0.0)):
        _, depth = draw(bent(hand).vertices + offset, hand.faces, PINHOLE)
        assert (depth == FAR).all()


def test_the_picture_is_cleared_first(hand: Hand) -> None:
    posed = bent(hand)
    projected, once = draw(posed.vertices, hand.faces, PINHOLE)
    again = np.zeros_like(once)
    rasterise(projected, hand.faces, again)
    np.testing.assert_array_equal(again, once)


def test_the_nearer_of_two_triangles_wins_whatever_their_order() -> None:
    corners = np.array([[-0.1, -0.1, 0.5], [0.0, 0.1, 0.5], [0.1, -0.1, 0.5]])
    vertices = np.concatenate([corners, corners * 1.5])
    for faces in ([[0, 1, 2], [3, 4, 5]], [[3, 4, 5], [0, 1, 2]]):
        turned = np.array(faces, dtype=np.int32)[:, ::-1].copy()
        seen = [d for f in (np.array(faces, np.int32), turned) for _, d in [draw(vertices, f, PINHOLE)]]
        front = min(seen, key=lambda d: d.min())  # one of the two turns faces the camera, the other is culled
        back = max(seen, key=lambda d: d.min())
        assert front[18, 27] == pytest.approx(0.5, abs=1e-5)
        assert (back == FAR).all()


class TestVisibility:
    def visible(self, hand: Hand, pose: np.ndarray, palm: np.ndarray, camera: Camera) -> np.ndarray:
        posed = pose_hand(hand, pose, palm)
        _, depth = draw(posed.vertices, hand.faces, camera)
        chain = make_chain(len(hand.skeleton.parent), len(hand.skeleton.revolute_bone))
        pose_bones(hand.skeleton, pose, palm, chain)
        found, near = np.empty(len(posed.vertices), np.int32), np.empty((7, len(posed.vertices)), np.float32)
        count = visible_vertices(hand.skin, chain.bones, pose, numbers(camera), depth, 0.003, found, near)
        listed = found[:count]
        places = posed.vertices[listed] - pose[:3]
        np.testing.assert_allclose(near[:3, :count].T, places, atol=1e-6)
        np.testing.assert_allclose(near[3:6, :count].T, posed.normals[listed], atol=1e-6)
        np.testing.assert_allclose(near[6, :count], np.sum(places**2, axis=1), atol=1e-6)
        return np.isin(np.arange(len(posed.vertices)), listed)

    @CAMERAS
    def test_visible_vertices_face_the_camera_and_lie_on_the_picture(self, hand: Hand, camera: Camera) -> None:
        fine = camera._replace(
            width=camera.width * 8, height=camera.height * 8,
            fx=camera.fx * 8, fy=camera.fy * 8, cx=camera.cx * 8, cy=camera.cy * 8,
        )  # fmt: skip
        posed, seen = bent(hand), self.visible(hand, bent_pose(hand), PALM, fine)
        assert 0.2 < seen.mean() < 0.6
        sight = posed.vertices / np.linalg.norm(posed.vertices, axis=1, keepdims=True)
        if camera.model == "orthographic":
            sight = np.array([0.0, 0.0, 1.0])
        assert (np.sum(posed.normals * sight, axis=1)[seen] <= -0.05).all()
        _, depth = draw(posed.vertices, hand.faces, fine)
        u, v = np.rint(fine.project(posed.vertices[seen])).astype(int).T
        assert (posed.vertices[seen, 2] <= depth[v, u] + 0.003 + 1e-6).all()

    def test_a_hidden_finger_is_not_visible(self, hand: Hand) -> None:
        """In a fist seen from its back no fingertip is in sight; from the palm's side they are."""
        pose = hand.neutral_pose()
        pose[[11, 15, 19, 23]] = np.radians(85.0)
        pose[[13, 17, 21, 25]] = np.radians(100.0)
        pose[2] = 0.5
        palm = np.array([[-1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, 1.0, 0.0]])
        turned = np.diag([-1.0, 1.0, -1.0]) @ palm
        fine = Camera(448, 384, 880.0, 880.0, 220.0, 190.0)
        distal = np.isin(hand.skin.influence_bone[:, 0], [6, 9, 12, 15])
        assert not self.visible(hand, pose, turned, fine)[distal].any()
        assert self.visible(hand, pose, palm, fine)[distal].any()


class TestComparison:
    """A square of 10 × 10 hand pixels at half a metre, the wrist far away below it."""

    def setup_method(self) -> None:
        self.labels = np.full((40, 40), EMPTY, np.uint8)
        self.labels[10:20, 10:20] = HAND
        self.observed = np.where(self.labels == HAND, 0.5, 0.0).astype(np.float32)
        self.rendered = np.where(self.labels == HAND, 0.5, FAR).astype(np.float32)
        self.outside = np.where(self.labels == HAND, 0.0, 1.0).astype(np.float32)

    def compare(self, rendered: np.ndarray) -> tuple[float, float]:
        camera, wrist, axis = np.array([40.0, 40.0, 19.5, 19.5, 1.0]), np.array([0.0, 5.0, 0.5]), np.array([0.0, 1, 0])
        return compare_depth(rendered, self.observed, self.labels, self.outside, camera, wrist, axis, 1.0, 0.04)

    def test_of_equal_maps_is_zero(self) -> None:
        assert self.compare(self.rendered) == (0.0, 1.0)

    def test_of_disjoint_maps_is_one(self) -> None:
        elsewhere = np.roll(self.rendered, 15, axis=1)
        energy, overlap = self.compare(elsewhere)
        assert energy == pytest.approx(1.0)
        assert overlap == 0.0

    def test_of_nothing_rendered_is_one(self) -> None:
        energy, overlap = self.compare(np.full((40, 40), FAR, np.float32))
        assert (energy, overlap) == (pytest.approx(1.0), 0.0)

    @pytest.mark.parametrize("shift", [0.01, -0.02, 0.04, -0.3])
    def test_grows_with_the_distance_squared_up_to_the_truncation(self, shift: float) -> None:
        moved = np.where(self.rendered < FAR, self.rendered + np.float32(shift), FAR).astype(np.float32)
        energy, overlap = self.compare(moved)
        assert energy == pytest.approx(min(shift**2 / 0.04**2, 1.0), rel=1e-4)
        assert overlap == 1.0

    def test_half_covered_is_half(self) -> None:
        half = self.rendered.copy()
        half[10:15] = FAR
        assert self.compare(half) == (pytest.approx(0.5), pytest.approx(0.5))

    def test_unknown_pixels_count_nothing(self) -> None:
        before = self.compare(self.rendered)
        more = self.rendered.copy()
        more[25:30] = 0.4
        self.labels[25:30] = UNKNOWN
        assert self.compare(more) == before

    def test_covering_pixels_beside_the_hand_costs_what_they_say(self) -> None:
        more = self.rendered.copy()
        more[10:20, 20:30] = 0.5
        self.outside[10:20, 20:30] = 0.25
        energy, overlap = self.compare(more)
        assert energy == pytest.approx(0.25 * 100 / 200)
        assert overlap == pytest.approx(0.5)
