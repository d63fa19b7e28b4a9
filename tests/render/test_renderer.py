"""The renderer: its pictures show what the scene says, now and not a moment ago, whatever happens to its process."""

import asyncio
from concurrent.futures import CancelledError, ThreadPoolExecutor

import cv2
import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from spf.errors import RenderError
from spf.frame import Camera
from spf.hand import load_hand
from spf.hand.kinematics import pose_hand
from spf.render import Lines, Mesh, Points, Scene, ViewCamera, reconstruction_scene
from tests.render.conftest import METRES_A_PIXEL, SIZE, VIEW, centre_of, drawn, sphere

RED, BLUE = (1.0, 0.2, 0.1), (0.1, 0.3, 1.0)


def ball(x=0.0, y=0.0, **kwargs):
    return Scene(meshes=(sphere((x, y, 0.5), **kwargs),))


def test_a_sphere_is_round_shaded_and_where_it_should_be(renderer):
    picture = renderer.picture(ball(0.03, -0.02, radius=0.03, colour=BLUE), VIEW, SIZE)
    assert picture.shape == (120, 160, 3)
    assert picture.dtype == np.uint8
    assert_allclose(centre_of(picture), [0.03, -0.02], atol=METRES_A_PIXEL)
    assert_allclose(np.sqrt(drawn(picture).sum() / np.pi) * METRES_A_PIXEL, 0.03, rtol=0.05)
    inside = picture[drawn(picture)].astype(float)
    assert (inside[:, 2] >= inside[:, 0]).all()
    assert inside[:, 2].std() > 10


@pytest.mark.parametrize("side", ["left", "right"])
def test_a_posed_hand_covers_the_pixels_that_the_sensor_s_camera_projects_it_to(renderer, side):
    hand = load_hand(side)
    vertices = pose_hand(hand, hand.neutral_pose()).vertices
    vertices = vertices - vertices.mean(axis=0) + [0.0, 0.0, 0.6]
    view = ViewCamera((0.0, 0.0, 0.6), distance=0.6, extent=0.3)  # on the axis, so that it is a plain pinhole camera
    width, height = 320, 240
    focal = height / (view.extent / view.distance)
    camera = Camera(width, height, focal, focal, (width - 1) / 2, (height - 1) / 2)
    picture = renderer.picture(reconstruction_scene(vertices, hand.faces), view, (width, height))
    columns, rows = (np.flatnonzero(drawn(picture).any(axis=axis)) for axis in (0, 1))
    projected = camera.project(vertices)
    assert_allclose([columns[0], rows[0]], projected.min(axis=0), atol=1.5)
    assert_allclose([columns[-1], rows[-1]], projected.max(axis=0), atol=1.5)
    assert picture[drawn(picture)].astype(float).std(axis=0).min() > 15  # shaded, not flat


def test_y_points_down_and_the_nearer_hides_the_farther(renderer):
    scene = Scene(meshes=(sphere((0, 0, 0.4), 0.01, colour=RED), sphere((0, 0, 0.6), 0.05, colour=BLUE)))
    picture = renderer.picture(scene, VIEW, SIZE).astype(int)
    assert picture[60, 80, 0] > picture[60, 80, 2]
    assert picture[85, 80, 2] > picture[85, 80, 0]
    low = renderer.picture(Scene(points=(Points([[0, 0.05, 0.5]], (1, 1, 1), size=20.0),)), VIEW, SIZE)
    assert centre_of(low)[1] > 0.04


def test_an_update_in_place_is_not_stale(renderer):
    for x in (-0.05, 0.0, 0.05, -0.02):
        assert_allclose(centre_of(renderer.picture(ball(x), VIEW, SIZE)), [x, 0], atol=METRES_A_PIXEL)
    first, other, again = (renderer.picture(ball(0, colour=c), VIEW, SIZE) for c in (RED, BLUE, RED))
    assert not np.array_equal(first, other)
    assert_array_equal(first, again)


def test_actors_are_used_again_for_other_shapes_and_hidden_when_unused(renderer):
    empty = renderer.picture(Scene(), VIEW, SIZE)
    assert not drawn(empty).any()
    points = Points(np.random.default_rng(0).normal([-0.05, 0, 0.5], 0.005, (200, 3)), RED, size=4.0)
    lines = Lines([[[0.02, -0.05, 0.5], [0.02, 0.05, 0.5]], [[0.06, -0.05, 0.5], [0.06, 0.05, 0.5]]], BLUE, width=6.0)
    coarse, fine = sphere(rings=4), sphere((0.04, 0, 0.5), rings=20)
    for scene in (
        Scene(meshes=(coarse, fine), points=(points,), lines=(lines,)),
        Scene(meshes=(fine,)),
        Scene(meshes=(coarse,), points=(points, points)),
        Scene(points=(Points(points.xyz[:7], RED, size=4.0),)),
        Scene(lines=(Lines(lines.paths[:1], BLUE, width=6.0),)),
    ):
        once = renderer.picture(scene, VIEW, SIZE)
        assert drawn(once).any()
        renderer.picture(Scene(meshes=(fine, coarse, fine), points=(points,), lines=(lines, lines)), VIEW, SIZE)
        assert_array_equal(renderer.picture(scene, VIEW, SIZE), once)
    assert_array_equal(renderer.picture(Scene(), VIEW, SIZE), empty)
    nothing = Scene(
        meshes=(Mesh(np.zeros((0, 3)), np.zeros((0, 3))),),
        points=(Points(np.zeros((0, 3))),),
        lines=(Lines(np.zeros((0, 2, 3))), Lines([[[0, 0, 0.5]]])),
    )
    assert_array_equal(renderer.picture(nothing, VIEW, SIZE), empty)


def test_a_mesh_with_other_faces_takes_the_place_of_the_one_before(renderer):
    for rings in (16, 8, 24):
        picture = renderer.picture(ball(0.02, radius=0.03, rings=rings), VIEW, SIZE)
        assert_allclose(centre_of(picture), [0.02, 0], atol=METRES_A_PIXEL)
        assert_allclose(drawn(picture).sum() * METRES_A_PIXEL**2, np.pi * 0.03**2, rtol=0.1)


def test_other_numbers_of_paths_steps_and_points_take_the_place_of_those_before(renderer):
    for count, length in ((3, 2), (1, 9), (4, 3)):
        x = np.linspace(-0.06, 0.0, count)[:, None] + np.zeros(length)
        paths = np.stack([x, np.linspace(-0.05, 0.05, length) + 0 * x, 0 * x + 0.5], axis=-1)
        columns = np.flatnonzero(drawn(renderer.picture(Scene(lines=(Lines(paths, width=4.0),)), VIEW, SIZE))[60])
        expected = np.linspace(-0.06, 0.0, count) / METRES_A_PIXEL + 79.5
        assert np.abs(columns[:, None] - expected).min(axis=1).max() < 2  # nothing but lines …
        assert np.abs(columns[:, None] - expected).min(axis=0).max() < 2  # … and all of them
    for count in (2, 5, 3):
        xyz = np.stack([np.linspace(-0.06, 0.06, count), np.zeros(count), np.full(count, 0.5)], axis=-1)
        picture = renderer.picture(Scene(points=(Points(xyz, size=12.0),)), VIEW, SIZE)
        assert cv2.connectedComponents(drawn(picture).astype(np.uint8))[0] == 1 + count


def test_lines_and_coloured_points_are_drawn_where_and_as_they_are(renderer):
    line = Scene(lines=(Lines([[[-0.08, 0, 0.5], [0.08, 0, 0.5]]], np.array([RED, BLUE]), width=8.0),))
    picture = renderer.picture(line, VIEW, SIZE).astype(int)
    assert picture[60, 35, 0] > picture[60, 35, 2]
    assert picture[60, 125, 2] > picture[60, 125, 0]
    two = Scene(points=(Points([[-0.05, 0, 0.5], [0.05, 0, 0.5]], np.array([RED, BLUE]), size=40.0, ball=True),))
    picture = renderer.picture(two, VIEW, SIZE).astype(int)
    assert picture[60, 50, 0] > picture[60, 50, 2]
    assert picture[60, 110, 2] > picture[60, 110, 0]


def test_a_see_through_mesh_lets_through_what_is_behind(renderer):
    behind = sphere((0, 0, 0.6), 0.02, colour=RED)
    alone, veiled, hidden = (
        renderer.picture(Scene(meshes=(behind, *front)), VIEW, SIZE)[60, 80].astype(int)
        for front in ((), (sphere(colour=BLUE, opacity=0.5),), (sphere(colour=BLUE),))
    )
    assert alone[0] > veiled[0] > hidden[0]
    assert alone[2] < veiled[2]
    invisible = Scene(meshes=(behind, sphere(colour=BLUE, opacity=0.0)))
    assert_array_equal(renderer.picture(invisible, VIEW, SIZE)[60, 80], alone)


def test_an_orbit_changes_the_picture_and_shows_the_other_side(renderer):
    scene = Scene(meshes=(sphere((0.04, 0, 0.5), 0.02, colour=RED), sphere((-0.04, 0, 0.5), 0.02, colour=BLUE)))
    front = renderer.picture(scene, VIEW, SIZE).astype(int)
    back = renderer.picture(scene, VIEW._replace(azimuth=np.pi), SIZE).astype(int)
    side = renderer.picture(scene, VIEW._replace(azimuth=np.pi / 2), SIZE).astype(int)
    right, left = (60, 104), (60, 56)
    assert front[right][0] > front[right][2]
    assert back[right][2] > back[right][0]
    assert drawn(side).sum() < 0.8 * drawn(front).sum()
    above = renderer.picture(scene, VIEW._replace(elevation=1.0), SIZE)
    assert not np.array_equal(above, front)
    assert drawn(front)[left]


def test_zoom_size_and_background(renderer):
    plain = drawn(renderer.picture(ball(radius=0.01), VIEW, SIZE)).sum()
    assert_allclose(
        drawn(renderer.picture(ball(radius=0.01), VIEW._replace(zoom=2.0), SIZE)).sum(), 4 * plain, rtol=0.2
    )
    large = renderer.picture(ball(radius=0.01), VIEW, (320, 240))
    assert large.shape == (240, 320, 3)
    assert_allclose(drawn(large).sum(), 4 * plain, rtol=0.2)
    white = renderer.picture(Scene(background=(1.0, 1.0, 1.0)), VIEW, SIZE)
    assert (white == 255).all()


def test_a_smooth_picture_is_the_same_one_with_shades_at_its_edges(renderer):
    scene = Scene(meshes=(sphere(colour=(1.0, 1.0, 1.0)),), background=(0.0, 0.0, 0.0))
    plain, smooth = (renderer.picture(scene, VIEW, SIZE, smooth=s).astype(int) for s in (False, True))
    edge = (plain.max(axis=-1) == 0) & (smooth.max(axis=-1) > 0)
    assert 20 < edge.sum() < 400
    assert np.abs(plain - smooth).mean() < 2
    assert_array_equal(renderer.picture(scene, VIEW, SIZE), plain)


def test_files_hold_the_picture(renderer):
    picture = renderer.picture(ball(0.02, colour=RED), VIEW, SIZE)
    for file, tolerance in (
        (renderer.jpeg(ball(0.02, colour=RED), VIEW, SIZE, quality=95), 4.0),
        (renderer.png(ball(0.02, colour=RED), VIEW, SIZE, smooth=False), 0.0),
    ):
        decoded = cv2.imdecode(np.frombuffer(file, np.uint8), cv2.IMREAD_COLOR)[..., ::-1]
        assert np.abs(decoded.astype(int) - picture).mean() <= tolerance
    small, big = (len(renderer.jpeg(ball(), VIEW, SIZE, quality=q)) for q in (10, 95))
    assert small < big


def test_many_threads_each_get_their_own_picture(renderer):
    def ask(k):
        x = 0.01 * (k % 9 - 4)
        return centre_of(renderer.picture(ball(x), VIEW, SIZE)) - [x, 0]

    with ThreadPoolExecutor(8) as pool:
        misses = np.array(list(pool.map(ask, range(40))))
    assert np.abs(misses).max() < METRES_A_PIXEL


def test_a_future_can_be_awaited_and_one_that_waits_cancelled(renderer):
    async def picture():
        return await asyncio.wrap_future(renderer.submit(ball(), VIEW, SIZE))

    assert drawn(asyncio.run(picture())).any()
    queued = [renderer.submit(ball(), VIEW, (640, 480)) for _ in range(10)]
    assert queued[-1].cancel()
    with pytest.raises(CancelledError):
        queued[-1].result()
    assert drawn(queued[-2].result()).any()


@pytest.mark.parametrize(
    ("change", "sentence"),
    [
        ({"size": (0, 10)}, "0×10 pixels"),
        ({"size": (10, 100_000)}, "10×100000"),
        ({"quality": 0}, "quality is 0"),
        ({"view": VIEW._replace(zoom=-1.0)}, "is no view"),
    ],
)
def test_what_cannot_be_drawn_is_refused_at_once(renderer, change, sentence):
    with pytest.raises(ValueError, match=sentence):
        renderer.submit(ball(), **{"view": VIEW, **change})


def test_a_drawing_that_fails_says_why_and_the_next_one_works(renderer):
    with pytest.raises(RenderError, match="could not be drawn: AttributeError"):
        renderer.submit("not a scene", VIEW, SIZE).result()
    assert drawn(renderer.picture(ball(), VIEW, SIZE)).any()
