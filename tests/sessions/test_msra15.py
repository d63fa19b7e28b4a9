from __future__ import annotations

import struct
from pathlib import Path

import numpy as np
import pytest

from spf.errors import SessionError
from spf.sessions import open_session
from tests.sessions.makers import make_msra15


@pytest.fixture
def made(tmp_path: Path, rng: np.random.Generator):
    return make_msra15(tmp_path / "P0" / "TIP", rng)


def test_says_what_it_is(made):
    session = open_session(made.path)
    assert (session.name, session.joint_definition, session.side) == ("P0-TIP", "msra15", None)


def test_depth_is_within_half_a_tenth_of_a_millimetre(made, rng):
    depth_mm = rng.uniform(200, 700, (4, 5)).astype(np.float32)
    header = struct.pack("<6I", 320, 240, 10, 20, 15, 24)
    (made.path / "000000_depth.bin").write_bytes(header + depth_mm.tobytes())
    depth = open_session(made.path)[0].depth
    assert np.abs(depth[20:24, 10:15] - depth_mm / 1000).max() <= 0.0000501
    assert np.count_nonzero(depth) == 20


def test_whole_millimetres_are_exact(made):
    depth_mm = np.arange(200, 220, dtype=np.float32).reshape(4, 5)
    header = struct.pack("<6I", 320, 240, 10, 20, 15, 24)
    (made.path / "000000_depth.bin").write_bytes(header + depth_mm.tobytes())
    raw = open_session(made.path).raw_depth(0)
    np.testing.assert_array_equal(raw[20:24, 10:15], np.arange(200, 220).reshape(4, 5) * 10)


def test_a_file_without_a_line_has_no_truth(made):
    lines = (made.path / "joint.txt").read_text().splitlines()
    (made.path / "joint.txt").write_text("\n".join(lines[:-1]))
    session = open_session(made.path)
    assert session[3].truth is None
    np.testing.assert_allclose(session[2].truth.joints, made.joints[2], atol=1e-9)
    assert session.warnings == ("1 frames have no line in joint.txt and so no truth.",)


def test_a_line_without_a_file_is_left_out(made):
    (made.path / "000001_depth.bin").unlink()
    session = open_session(made.path)
    np.testing.assert_allclose(session[1].truth.joints, made.joints[2], atol=1e-9)
    np.testing.assert_allclose(session.times, [0, 2 / 30, 3 / 30], atol=1e-9)
    assert session.warnings == ("1 lines of joint.txt have no depth file and were left out.",)


@pytest.mark.parametrize("kept", [0, 10, 24, 1000])
def test_a_torn_file_is_named(made, kept):
    path = made.path / "000000_depth.bin"
    path.write_bytes(path.read_bytes()[:kept])
    with pytest.raises(SessionError, match=r"000000_depth\.bin is torn"):
        open_session(made.path)


def test_a_box_outside_the_image_is_torn(made):
    (made.path / "000000_depth.bin").write_bytes(struct.pack("<6I", 320, 240, 300, 0, 330, 1) + bytes(120))
    with pytest.raises(SessionError, match=r"000000_depth\.bin is torn"):
        open_session(made.path)


def test_another_image_size_is_named(made):
    data = (made.path / "000000_depth.bin").read_bytes()
    (made.path / "000000_depth.bin").write_bytes(struct.pack("<2I", 640, 480) + data[8:])
    with pytest.raises(SessionError, match="640×480"):
        open_session(made.path)


def test_a_damaged_line_is_named(made):
    with (made.path / "joint.txt").open("a") as file:
        file.write("1.0 2.0\n")
    with pytest.raises(SessionError, match=r"Line 6 of .*joint\.txt is damaged"):
        open_session(made.path)
