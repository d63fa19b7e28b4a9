"""Normals and the order of see-through faces."""

import numpy as np
from numpy.testing import assert_allclose

from spf.render.surface import blend, vertex_normals
from tests.render.conftest import sphere

EYE = np.zeros(3)


def test_the_normals_of_a_sphere_point_outwards():
    mesh = sphere((0.1, 0.2, 0.5), 0.03)
    outward = (mesh.vertices - [0.1, 0.2, 0.5]) / 0.03
    assert_allclose((vertex_normals(mesh.vertices, mesh.faces) * outward).sum(axis=1), 1, atol=0.01)


def test_a_vertex_without_a_face_has_no_normal():
    vertices = np.float32([[0, 0, 0], [1, 0, 0], [0, 1, 0], [9, 9, 9]])
    normals = vertex_normals(vertices, np.int32([[0, 1, 2]]))
    assert_allclose(normals, [[0, 0, 1]] * 3 + [[0, 0, 0]])


def test_faces_are_painted_from_the_farthest_to_the_nearest_and_only_if_they_face_the_eye():
    shell = blend([sphere((0, 0, 0.4), opacity=0.5), sphere((0, 0, 0.7), opacity=0.5)], EYE)
    corners = shell.vertices[shell.faces]
    distance = np.linalg.norm(corners, axis=-1).mean(axis=1)
    assert (np.diff(distance) <= 1e-6).all()
    assert distance[0] > 0.67
    assert distance[-1] < 0.4
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    assert ((normals * corners.mean(axis=1)).sum(axis=1) < 0).all()
    assert 0.4 < len(shell.faces) / (2 * len(sphere().faces)) <= 0.5


def test_the_rim_is_more_opaque_than_the_middle_and_both_follow_the_opacity():
    mesh = sphere((0, 0, 0.5), opacity=0.8, colour=(1, 0, 0))
    shell = blend([mesh], EYE)
    alpha = shell.rgba[:, 3].astype(float)
    normals = vertex_normals(mesh.vertices, mesh.faces)
    facing = np.abs((normals * mesh.vertices).sum(axis=1)) / np.linalg.norm(mesh.vertices, axis=1)
    assert alpha[facing < 0.1].min() > 2 * alpha[facing > 0.9].max()
    assert alpha.max() <= round(0.8 * 255)
    half = blend([sphere((0, 0, 0.5), opacity=0.4)], EYE).rgba[:, 3]
    assert_allclose(half, alpha / 2, atol=1)
    assert (shell.rgba[:, :3] == [255, 0, 0]).all()
