"""Solids against their formulas."""

from __future__ import annotations

import numpy as np
import pytest

from spf.frame import Camera
from spf.kernels.render import FAR
from spf.synthetic.solids import Mesh, draw, ellipsoid, plane_depth, tube

PINHOLE = Camera(160, 120, 150.0, 150.0, 79.5, 59.5)
ORTHOGRAPHIC = Camera(160, 120, 400.0, 400.0, 79.5, 59.5, "orthographic")


def volume(mesh: Mesh) -> float:
    """Signed volume: positive when the faces look outward, and exact only when the mesh is closed."""
    a, b, c = (mesh.vertices[mesh.faces[:, k]] for k in range(3))
    return float(np.einsum("ij,ij->i", a, np.cross(b, c)).sum() / 6.0)


def test_an_ellipsoid_is_closed_and_outward() -> None:
    mesh = ellipsoid((0.1, -0.2, 0.7), (0.05, 0.08, 0.03), rings=41)
    assert volume(mesh) == pytest.approx(4.0 / 3.0 * np.pi * 0.05 * 0.08 * 0.03, rel=0.03)


def test_a_tube_is_closed_and_outward() -> None:
    along = np.linspace(0.0, 0.3, 5)
    centres = np.stack([np.zeros(5), along, np.full(5, 0.6)], axis=1)
    radii = np.tile([0.02, 0.03], (5, 1))
    mesh = tube(centres, radii, np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0]]))
    assert volume(mesh) == pytest.approx(np.pi * 0.02 * 0.03 * 0.3, rel=0.02)


def test_a_drawn_sphere_is_where_its_formula_says() -> None:
    centre, radius = np.array([0.02, -0.01, 0.5]), 0.08
    depth = draw([ellipsoid(centre, (radius,) * 3, rings=61)], PINHOLE)
    v, u = np.mgrid[: PINHOLE.height, : PINHOLE.width]
    ray = PINHOLE.back_project(u, v, np.ones(u.shape))
    a, b, c = (ray * ray).sum(-1), ray @ centre, centre @ centre - radius**2
    discriminant = b * b - a * c
    exact = (b - np.sqrt(np.maximum(discriminant, 0.0))) / a
    well_inside = discriminant > 0.3 * discriminant.max()
    np.testing.assert_allclose(depth[well_inside], exact[well_inside], atol=1.5e-3)
    assert (depth[discriminant < -0.05 * discriminant.max()] == FAR).all()


def test_the_nearest_of_several_meshes_is_seen() -> None:
    near, far = ellipsoid((0.0, 0.0, 0.5), (0.05,) * 3), ellipsoid((0.0, 0.0, 0.9), (0.4,) * 3)
    together = draw([far, near], PINHOLE)
    np.testing.assert_array_equal(together, np.minimum(draw([near], PINHOLE), draw([far], PINHOLE)))


def test_no_mesh_is_an_empty_picture() -> None:
    assert (draw([], PINHOLE) == FAR).all()


@pytest.mark.parametrize("camera", [PINHOLE, ORTHOGRAPHIC], ids=["pinhole", "orthographic"])
def test_the_points_of_a_plane_lie_on_it(camera: Camera) -> None:
    point, normal = np.array([0.0, 0.1, 0.6]), np.array([0.1, -0.6, -0.8])
    depth = plane_depth(point, normal, camera)
    v, u = np.nonzero(depth < FAR)
    assert len(v) > 1000
    points = camera.back_project(u, v, depth[v, u])
    np.testing.assert_allclose((points - point) @ normal, 0.0, atol=1e-5)


def test_a_plane_behind_the_camera_is_not_seen() -> None:
    assert (plane_depth((0.0, 0.0, -1.0), (0.0, 0.0, -1.0), PINHOLE) == FAR).all()
