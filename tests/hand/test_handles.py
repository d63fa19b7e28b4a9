"""A hand posed by dragging: each handle does one thing, follows the mouse, and keeps to the limits."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from spf.frame import JOINT_NAMES
from spf.hand.handles import HANDLES, Stance, dragged, entries_of, handle_points, turned_home
from spf.hand.kinematics import joints_of, rotation_about
from spf.hand.model import FINGERS, load_hand
from tests.scenes import CAMERAS, FACING, natural_pose

HAND = load_hand("right")
STANCE = Stance(natural_pose(HAND, (0.1, -0.2, 0.05)), FACING)
steps = st.floats(-25, 25)


def at(camera, stance, handle):
    return camera.project(handle_points(HAND, stance)[handle])


def drag(camera, handle, right, down, surface=0.0):
    start = at(camera, STANCE, handle)
    return dragged(HAND, camera, STANCE, handle, start, np.add(start, (right, down)), surface)


@pytest.mark.parametrize("camera", CAMERAS.values(), ids=CAMERAS)
@given(right=steps, down=steps)
def test_the_palm_goes_where_the_mouse_goes_at_its_depth(camera, right, down):
    moved = drag(camera, "palm", right, down)
    assert at(camera, moved, "palm") == pytest.approx(np.add(at(camera, STANCE, "palm"), (right, down)))
    assert moved.pose[2] == STANCE.pose[2]
    shapes = [joints - joints[0] for joints in (joints_of(HAND, *STANCE), joints_of(HAND, *moved))]
    assert shapes[1] == pytest.approx(shapes[0])


@pytest.mark.parametrize("camera", CAMERAS.values(), ids=CAMERAS)
@given(right=steps, down=steps)
def test_the_wrist_points_to_the_mouse_and_the_palm_stays(camera, right, down):
    moved = drag(camera, "wrist", right, down)
    assert moved.pose[:3] == pytest.approx(STANCE.pose[:3])
    middle = at(camera, STANCE, "palm")
    focal = np.array([camera.fx, camera.fy])
    wanted = (np.add(at(camera, STANCE, "wrist"), (right, down)) - middle) / focal
    got = (at(camera, moved, "wrist") - middle) / focal
    if np.linalg.norm(wanted * focal) > 5:
        apart = np.arctan2(wanted[1], wanted[0]) - np.arctan2(got[1], got[0])
        # what is beside the optical axis is seen a little aslant by a pinhole camera
        assert abs((apart + np.pi) % (2 * np.pi) - np.pi) < 0.06


def test_the_knuckle_tilts_the_hand_about_the_axis_across_the_drag():
    camera = CAMERAS["pinhole"]
    moved = drag(camera, "knuckle", 0, 20)
    assert moved.pose[:3] == pytest.approx(STANCE.pose[:3])
    palm = rotation_about(STANCE.pose[3:6]) @ STANCE.reference
    turn = moved.reference @ palm.T
    axis = np.array([turn[2, 1] - turn[1, 2], turn[0, 2] - turn[2, 0], turn[1, 0] - turn[0, 1]])
    assert axis / np.linalg.norm(axis) == pytest.approx([1, 0, 0])  # what faces the camera goes down
    angle = np.arccos((np.trace(turn) - 1) / 2)
    assert angle == pytest.approx(20 / camera.fy * STANCE.pose[2] / (0.5 * HAND.length))


@pytest.mark.parametrize("camera", CAMERAS.values(), ids=CAMERAS)
@pytest.mark.parametrize("finger", FINGERS)
def test_a_tip_is_seen_where_it_was_dragged_to_and_nothing_else_moves(camera, finger):
    right, down = (-6, 10) if finger == "thumb" else (2, 12)
    moved = drag(camera, f"{finger}_tip", right, down)
    reached = at(camera, moved, f"{finger}_tip") - at(camera, STANCE, f"{finger}_tip")
    assert reached == pytest.approx([right, down], abs=1.0)
    others = np.ones(HAND.dofs, bool)
    others[[3, 4, 5, *entries_of(finger)]] = False
    assert moved.pose[others] == pytest.approx(STANCE.pose[others])
    own = [name.startswith(finger) for name in JOINT_NAMES]
    apart = np.linalg.norm(joints_of(HAND, *moved) - joints_of(HAND, *STANCE), axis=1)
    assert apart[~np.array(own)].max() < 1e-9
    assert apart[own].max() > 0.005


@given(handle=st.sampled_from(HANDLES), right=st.floats(-400, 400), down=st.floats(-400, 400))
def test_no_drag_leaves_the_limits_or_the_rotations(handle, right, down):
    moved = drag(CAMERAS["pinhole"], handle, right, down, surface=0.43)
    assert np.isfinite(moved.pose).all()
    assert (moved.pose >= HAND.limits[:, 0] - 1e-9).all()
    assert (moved.pose <= HAND.limits[:, 1] + 1e-9).all()
    assert moved.reference @ moved.reference.T == pytest.approx(np.eye(3))
    assert np.linalg.det(moved.reference) == pytest.approx(1)


def test_a_tip_is_laid_onto_the_surface_that_is_about_as_deep():
    camera, tip = CAMERAS["pinhole"], JOINT_NAMES.index("index_tip")
    free = joints_of(HAND, *drag(camera, "index_tip", 0, 8))[tip]
    laid = joints_of(HAND, *drag(camera, "index_tip", 0, 8, surface=free[2] + 0.01))[tip]
    far = joints_of(HAND, *drag(camera, "index_tip", 0, 8, surface=free[2] + 0.5))[tip]
    assert laid[2] > free[2] + 0.002
    assert far == pytest.approx(free)


def test_turned_home_is_the_same_hand():
    home = turned_home(STANCE)
    assert (home.pose[3:6] == 0).all()
    assert joints_of(HAND, *home) == pytest.approx(joints_of(HAND, *STANCE))


def test_the_entries_of_palm_and_fingers_are_all_26():
    entries = [entry for part in ("palm", *FINGERS) for entry in entries_of(part)]
    assert entries == list(range(26))
