"""Uploads: stored, unpacked, and refused when they are not what they should be."""

import io
import stat
import zipfile
from pathlib import Path

import pytest

from app.server import bundled
from app.uploads import Uploads
from spf.errors import SessionError
from spf.sessions import open_session


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
        ("notes.txt", b"x", "neither"),
        ("", b"x", "neither"),
        ("torn.zip", b"PK\x03\x04 torn", "cannot be unpacked"),
        ("empty.zip", zipped({}), "holds no file"),
    ],
)
def test_what_is_no_session_is_refused_in_one_sentence(uploads, name, content, says):
    with pytest.raises(SessionError, match=says):
        uploads.store(name, content)


def test_a_zip_that_unpacks_to_too_much_is_refused(uploads, monkeypatch):
    monkeypatch.setattr("app.uploads._LARGEST_CONTENT", 1000)
    with pytest.raises(SessionError, match="unpacks to more"):
        uploads.store("bomb.zip", zipped({"a.png": b"0" * 600, "b.png": b"0" * 600}))
