from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest

from spf.errors import SessionError
from spf.sessions import open_session
from tests.sessions.makers import make_cvar


@pytest.fixture
def made(tmp_path: Path, rng: np.random.Generator):
    return make_cvar(tmp_path / "P9", rng)


def edit_joints(folder: Path, change) -> None:
    lines = (folder / "joint.txt").read_text().splitlines()
    (folder / "joint.txt").write_text("\n".join(change(lines)))


def test_says_what_it_is(made):
    session = open_session(made.path)
    assert (session.name, session.joint_definition, session.side) == ("P9", "cvar", None)
    assert session.metadata["sensor"] == "Creative Senz3D"
    np.testing.assert_allclose(session.times, np.arange(4) / 30, atol=1e-9)


def test_images_one_column_too_wide_lose_the_last(made):
    for number in range(4):
        path = str(made.path / f"{number:06d}_depth.png")
        wide = np.pad(cv2.imread(path, cv2.IMREAD_UNCHANGED), ((0, 0), (0, 1)), constant_values=555)
        cv2.imwrite(path, wide)
    session = open_session(made.path)
    np.testing.assert_array_equal(session.raw_depth(2), made.raw[2])


def test_two_metres_and_more_is_no_reading(made):
    path = str(made.path / "000000_depth.png")
    stored = cv2.imread(path, cv2.IMREAD_UNCHANGED)
    stored[0, :3] = 1999, 2000, 65535
    cv2.imwrite(path, stored)
    assert open_session(made.path).raw_depth(0)[0, :4].tolist() == [1999, 0, 0, 0]


def test_counts_blank_lines_and_carriage_returns_do_not_matter(made):
    edit_joints(made.path, lambda lines: ["", "17\r", *(part for line in lines[1:] for part in (line + "\r", "  "))])
    session = open_session(made.path)
    assert len(session) == 4
    np.testing.assert_allclose(session[3].truth.joints, made.joints[3], atol=1e-9)
    edit_joints(made.path, lambda lines: lines[2:])  # no count at all
    assert len(open_session(made.path)) == 4


def test_a_missing_image_is_left_out_and_told(made):
    (made.path / "000001_depth.png").unlink()
    session = open_session(made.path)
    assert len(session) == 3
    assert session.warnings == (
        "1 images listed in joint.txt are not in the folder and were left out, first 000001_depth.png.",
    )
    np.testing.assert_allclose(session.times, [0, 2 / 30, 3 / 30], atol=1e-9)
    np.testing.assert_allclose(session[1].truth.joints, made.joints[2], atol=1e-9)


def test_an_unlisted_image_is_left_out_and_told(made):
    edit_joints(made.path, lambda lines: lines[:-1])
    session = open_session(made.path)
    assert len(session) == 3
    assert session.warnings == ("1 images are not listed in joint.txt and were left out, first 000003_depth.png.",)


def test_a_joint_without_depth_is_unknown(made):
    def without_first_depth(lines):
        words = lines[1].split()
        return [lines[0], " ".join([*words[:3], "0.0", *words[4:]]), *lines[2:]]

    edit_joints(made.path, without_first_depth)
    joints = open_session(made.path)[0].truth.joints
    assert np.isnan(joints[0]).all()
    np.testing.assert_allclose(joints[1:], made.joints[0, 1:], atol=1e-9)


@pytest.mark.parametrize(
    "change",
    [
        lambda lines: [*lines[:2], lines[2].rsplit(" ", 2)[0]],
        lambda lines: [*lines[:2], lines[2] + " 1.0"],
        lambda lines: [*lines[:2], lines[2].replace(".", "x", 5)],
    ],
)
def test_a_damaged_line_is_named(made, change):
    edit_joints(made.path, change)
    with pytest.raises(SessionError, match=r"Line 3 of .*joint\.txt is damaged"):
        open_session(made.path)


def test_an_empty_list_is_told(made):
    (made.path / "joint.txt").write_text("0\n")
    with pytest.raises(SessionError, match="lists no frame"):
        open_session(made.path)


def test_a_list_of_other_images_is_told(made):
    edit_joints(made.path, lambda lines: [line.replace("_depth", "_other") for line in lines])
    with pytest.raises(SessionError, match="None of the 4 images"):
        open_session(made.path)


def test_a_list_that_is_no_text_is_told(made):
    (made.path / "joint.txt").write_bytes(b"\xff\xfe\x00\x81")
    with pytest.raises(SessionError, match="no text"):
        open_session(made.path)


def test_images_in_tenths_of_millimetres_are_refused(made):
    for path in made.path.glob("*.png"):
        cv2.imwrite(str(path), cv2.imread(str(path), cv2.IMREAD_UNCHANGED).clip(0, 6000) * 10)
    with pytest.raises(SessionError, match=r"no depth reading.*not in counts of 0.001 m"):
        open_session(made.path)
