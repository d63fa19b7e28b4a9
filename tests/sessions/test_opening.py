from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from spf.errors import SessionError
from spf.sessions import FORMATS, open_session
from tests.sessions.makers import make_cvar, make_mcap, make_png_folder


def test_names_say_nothing(tmp_path, rng):
    made = make_mcap(tmp_path / "session.mcap", rng)
    made.path.rename(tmp_path / "picture.png")
    assert open_session(tmp_path / "picture.png").format == "mcap"
    folder = make_png_folder(tmp_path / "folder.mcap", rng).path
    assert open_session(str(folder)).format == "png-folder"


def test_cvar_without_its_list_is_a_plain_folder(tmp_path, rng):
    made = make_cvar(tmp_path / "P1", rng)
    (made.path / "joint.txt").unlink()
    with pytest.raises(SessionError, match="no camera file"):
        open_session(made.path)
    (made.path / "camera.json").write_text('{"fx": 224.5, "fy": 230.5, "cx": 160, "cy": 120, "no_reading": [32001]}')
    session = open_session(made.path)
    assert (session.format, session.has_truth) == ("png-folder", False)
    np.testing.assert_array_equal(session.raw_depth(1), made.raw[1])


def test_nothing_there(tmp_path):
    with pytest.raises(SessionError, match=r"There is no file or folder .*gone"):
        open_session(tmp_path / "gone")


def test_an_empty_folder(tmp_path):
    with pytest.raises(SessionError, match="is no session: it is an empty folder"):
        open_session(tmp_path)


def test_a_folder_of_sessions_names_them(tmp_path, rng):
    for name in ("P1", "P10", "P2"):
        make_cvar(tmp_path / name, rng, frames=1)
    with pytest.raises(SessionError, match=r"it is a folder with P1/, P2/, P10/\."):
        open_session(tmp_path)


@pytest.mark.parametrize(
    ("content", "said"),
    [(b"", "an empty file"), (b"hello", "a file of 5 bytes"), (bytes(range(256)) * 9, "a file of 2304 bytes")],
)
def test_a_file_that_is_no_session_lists_what_is_understood(tmp_path: Path, content, said):
    (tmp_path / "session.mcap").write_bytes(content)
    with pytest.raises(SessionError) as caught:
        open_session(tmp_path / "session.mcap")
    assert said in str(caught.value)
    assert all(form.layout in str(caught.value) for form in FORMATS)
    assert "\n" not in str(caught.value)
