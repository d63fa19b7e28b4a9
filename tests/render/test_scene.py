"""Scenes: what cannot be drawn is refused where it is made, and what is drawn later cannot change meanwhile."""

import numpy as np
import pytest
from numpy.testing import assert_array_equal

from spf.render import Lines, Mesh, Points

TRIANGLE = np.eye(3)


@pytest.mark.parametrize(
    ("make", "sentence"),
    [
        (lambda: Mesh(np.zeros((3, 2)), [[0, 1, 2]]), "vertices have shape"),
        (lambda: Mesh(TRIANGLE, [[0, 1]]), "faces have shape"),
        (lambda: Mesh(TRIANGLE, [[0, 1, 3]]), "faces name vertices outside 0 to 2"),
        (lambda: Mesh(TRIANGLE, [[-1, 1, 2]]), "faces name vertices outside"),
        (lambda: Mesh(TRIANGLE * np.nan, [[0, 1, 2]]), "vertices hold a number that is not finite"),
        (lambda: Mesh(TRIANGLE, [[0, 1, 2]], opacity=1.1), "opacity is 1.1"),
        (lambda: Mesh(TRIANGLE, [[0, 1, 2]], opacity=np.nan), "opacity is nan"),
        (lambda: Mesh(TRIANGLE, [[0, 1, 2]], (0, 0, 2)), "colours are numbers from 0 to 1"),
        (lambda: Points(np.zeros(3)), "xyz have shape"),
        (lambda: Points(np.full((2, 3), np.inf)), "not finite"),
        (lambda: Points(np.zeros((2, 3)), np.zeros((3, 3))), "broadcast"),
        (lambda: Lines(np.zeros((4, 3))), "paths have shape"),
        (lambda: Lines(np.zeros((4, 5, 3)), np.zeros((4, 3))), "broadcast"),
    ],
)
def test_what_cannot_be_drawn_is_refused(make, sentence):
    with pytest.raises(ValueError, match=sentence):
        make()


def test_a_scene_does_not_change_with_the_arrays_it_was_made_of():
    vertices = TRIANGLE.astype(np.float32)
    mesh = Mesh(vertices, [[0, 1, 2]])
    vertices += 1
    assert_array_equal(mesh.vertices, TRIANGLE)
    with pytest.raises(ValueError, match="read-only"):
        mesh.vertices += 1


def test_colours_travel_as_bytes():
    assert_array_equal(Points(TRIANGLE, (0.0, 0.5, 1.0)).colour, [0, 128, 255])
    assert Points(TRIANGLE, np.ones((3, 3))).colour.dtype == np.uint8
