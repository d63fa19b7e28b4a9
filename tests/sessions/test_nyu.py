from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest
import scipy.io

from spf.errors import SessionError
from spf.sessions import open_session
from tests.sessions.makers import make_nyu


@pytest.fixture
def made(tmp_path: Path, rng: np.random.Generator):
    return make_nyu(tmp_path / "test", rng)


def test_says_what_it_is(made):
    session = open_session(made.path)
    assert (session.name, session.joint_definition, session.side) == ("nyu-test", "nyu", None)
    assert session[0].colour is None


def test_colour_where_there_is_any(made, rng):
    rgb = rng.integers(0, 256, (480, 640, 3), dtype=np.uint8)
    cv2.imwrite(str(made.path / "rgb_1_0000002.png"), rgb[..., ::-1])
    session = open_session(made.path)
    np.testing.assert_array_equal(session[1].colour, rgb)
    assert session[0].colour is None


def test_depth_beyond_one_byte(made):
    assert open_session(made.path).raw_depth(0).max() > 255


def test_without_labels_there_is_no_truth(made):
    (made.path / "joint_data.mat").unlink()
    session = open_session(made.path)
    assert not session.has_truth
    assert session[0].truth is None
    assert session.warnings == ("There is no joint_data.mat in the folder, so there is no truth.",)


def test_labels_belong_to_the_numbers_of_the_images(made):
    (made.path / "depth_1_0000001.png").unlink()
    session = open_session(made.path)
    np.testing.assert_allclose(session[0].truth.joints, made.joints[1], atol=1e-9)


def test_an_image_without_a_row_has_no_truth(made):
    (made.path / "depth_1_0000003.png").rename(made.path / "depth_1_0000009.png")
    session = open_session(made.path)
    assert session[2].truth is None
    assert session.warnings == ("1 frames have no row in joint_data.mat and so no truth.",)


@pytest.mark.parametrize("kept", [0, 100, 2000])
def test_torn_labels_are_named(made, kept):
    path = made.path / "joint_data.mat"
    path.write_bytes(path.read_bytes()[:kept])
    with pytest.raises(SessionError, match=r"joint_data\.mat is damaged"):
        open_session(made.path)


def test_labels_of_another_kind_are_named(made):
    scipy.io.savemat(made.path / "joint_data.mat", {"joint_xyz": np.zeros((3, 3, 14, 3))})
    with pytest.raises(SessionError, match="36 joints"):
        open_session(made.path)


def test_grey_images_are_refused(made):
    cv2.imwrite(str(made.path / "depth_1_0000001.png"), np.full((480, 640), 400, np.uint16))
    with pytest.raises(SessionError, match=r"depth_1_0000001\.png is a 640×480 16-bit grey PNG"):
        open_session(made.path)
