"""Uploads: stored, unpacked, and refused when they are not what they should be."""

import io
import stat
import zipfile
from pathlib import Path

import numpy as np
import pytest

from app.server import bundled, open_shared
from app.uploads import Uploads
from app.views.upload import Upload
from spf.errors import SessionError
from spf.sessions import open_session
from tests.sessions.file_makers import make_azure_mkv, make_hdf5, make_npz
from tests.sessions.ros_makers import make_realsense, make_ros1_bag, make_ros_mcap


@pytest.fixture
def uploads():
    stored = Uploads()
    yield stored
    stored.close()


def zipped(files):
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w") as archive:
        for name, content in files.items():
            archive.writestr(name, content)
    return buffer.getvalue()


def test_a_recording_can_be_opened_and_is_gone_with_the_page():
    uploads = Uploads()
    path = uploads.store("C:\\captures\\mine.mcap", Path(bundled()["open-close"]).read_bytes())
    assert path.name == "mine.mcap"
    assert len(open_session(path)) == 120
    uploads.close()
    assert not path.exists()


def test_a_zip_becomes_the_folder_that_holds_the_files(uploads):
    folder = uploads.store("capture.zip", zipped({"capture/camera.json": "{}", "capture/0.png": "x"}))
    assert sorted(path.name for path in folder.iterdir()) == ["0.png", "camera.json"]


@pytest.mark.parametrize("name", ["../evil.png", "/etc/evil.png", "a/../../evil.png", "C:/evil.png", "..\\evil.png"])
def test_a_zip_that_reaches_out_of_its_folder_is_refused(uploads, name):
    with pytest.raises(SessionError, match="leads out of its folder"):
        uploads.store("evil.zip", zipped({name: "x"}))


def test_a_zip_with_a_link_is_refused(uploads):
    link = zipfile.ZipInfo("link")
    link.external_attr = (stat.S_IFLNK | 0o777) << 16
    with pytest.raises(SessionError, match="leads out of its folder"):
        uploads.store("evil.zip", zipped({link: "/etc"}))


@pytest.mark.parametrize(
    ("name", "content", "says"),
    [
        ("notes.txt", b"x", "no recording"),
        ("", b"x", "no recording"),
        ("a\0b.mcap", b"x", "no recording"),
        (f"{'a' * 300}.mcap", b"x", "no recording"),
        ("torn.zip", b"PK\x03\x04 torn", "cannot be unpacked"),
        ("empty.zip", zipped({}), "holds no file"),
    ],
)
def test_what_is_no_session_is_refused_in_one_sentence(uploads, name, content, says):
    with pytest.raises(SessionError, match=says):
        uploads.store(name, content)


def test_a_zip_that_unpacks_to_too_much_is_refused(uploads, monkeypatch):
    monkeypatch.setattr("app.uploads._LARGEST_CONTENT", 1000)
    with pytest.raises(SessionError, match="of this page are left"):
        uploads.store("bomb.zip", zipped({"a.png": b"0" * 600, "b.png": b"0" * 600}))


def test_all_uploads_of_a_page_together_are_bounded_and_one_that_is_no_session_makes_room(uploads, monkeypatch):
    monkeypatch.setattr("app.uploads._LARGEST_CONTENT", 1000)
    first = uploads.store("a.mcap", b"0" * 600)
    with pytest.raises(SessionError, match="load the page again"):
        uploads.store("b.mcap", b"0" * 600)
    uploads.drop(first)
    assert not first.parent.exists()
    assert uploads.store("b.mcap", b"0" * 600).exists()


@pytest.mark.parametrize(
    ("ending", "maker"),
    [(".mcap", make_ros_mcap), (".bag", make_ros1_bag), (".db3", make_realsense), (".mkv", make_azure_mkv),
     (".npz", make_npz), (".h5", make_hdf5)],
)  # fmt: skip
def test_every_format_of_one_file_can_be_uploaded(uploads, tmp_path, ending, maker):
    made = maker(tmp_path / f"take{ending}", np.random.default_rng(3))
    stored = uploads.store(f"C:\\takes\\MY TAKE{ending.upper()}", made.path.read_bytes())
    session = open_shared(str(stored), None)
    np.testing.assert_array_equal(session.raw_depth(1), made.raw[1])


def test_the_button_takes_no_more_than_it_says(monkeypatch):
    monkeypatch.setattr("app.views.upload.LARGEST_UPLOAD", 1000)
    button = Upload()
    part = {"name": "x.mcap", "mime_type": "", "total_chunks": 3, "data": b"0" * 600}
    button._process_chunk(part | {"chunk": 1})
    with pytest.raises(ValueError, match="was refused"):
        button._process_chunk(part | {"chunk": 2})
    assert not button._file_buffer
