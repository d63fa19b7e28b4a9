"""A page opens what is in the folders that the server was started with, and nothing else."""

import os
import shutil
from pathlib import Path
from types import SimpleNamespace

import pytest

from app.controller import Controller
from app.folders import OutsideError, allowed, allowed_session, allowed_source
from app.live import Live
from app.runner import Runner
from app.server import bundled, open_shared
from app.shelf import Shelf
from app.state import State
from app.uploads import Uploads
from app.views.session_card import SessionCard
from spf.errors import RunError, SensorError, SessionError
from spf.live.tracking import Request
from spf.trackers import make_settings


@pytest.fixture
def room(tmp_path, monkeypatch):
    """Two folders, of which the first may be opened."""
    inside, outside = tmp_path / "in side", tmp_path / "in side-not"  # one name begins like the other
    inside.mkdir()
    outside.mkdir()
    monkeypatch.setenv("SPF_SESSIONS", str(inside))
    shutil.copy(bundled()["open-close"], outside / "mine.mcap")
    return inside, outside


def test_several_folders_and_the_own_ones_may_be_opened(room, monkeypatch):
    inside, outside = room
    with pytest.raises(OutsideError, match="SPF_SESSIONS="):
        open_shared(str(outside / "mine.mcap"), None)
    monkeypatch.setenv("SPF_SESSIONS", f"{inside}{os.pathsep}{outside}")
    assert len(open_shared(str(outside / "mine.mcap"), None)) == 120
    assert len(open_shared(bundled()["fast-wave"], None)) > 0
    assert Shelf().folder.resolve() in {path.resolve() for path in [Path("runs"), Shelf().folder]}
    assert allowed(Shelf().folder / "some" / "hand.json")


def test_an_upload_may_be_opened(room):
    uploads = Uploads()
    path = uploads.store("mine.mcap", (room[1] / "mine.mcap").read_bytes())
    assert len(open_shared(str(path), None)) == 120
    uploads.close()


def test_without_the_variable_it_is_the_working_directory(room, monkeypatch):
    monkeypatch.delenv("SPF_SESSIONS")
    monkeypatch.chdir(room[1])
    assert len(open_shared("mine.mcap", None)) == 120
    with pytest.raises(OutsideError):
        open_shared("/etc/hosts", None)
    monkeypatch.setenv("SPF_SESSIONS", "")
    with pytest.raises(OutsideError):
        open_shared("mine.mcap", None)


@pytest.mark.parametrize(
    "path", ["{out}/mine.mcap", "{in}/../in side-not/mine.mcap", "{in}/link.mcap", "{in}/away/mine.mcap", "/", "",
             "{in}/round", "~nobody-of-this-name/x", "x\0y", "{out}/mine.mcap?topic=/depth"],
)  # fmt: skip
def test_no_way_leads_out(room, path):
    inside, outside = room
    (inside / "link.mcap").symlink_to(outside / "mine.mcap")
    (inside / "away").symlink_to(outside)
    (inside / "round").symlink_to(inside / "round")
    with pytest.raises((OutsideError, SessionError)) as refused:
        open_shared(path.replace("{in}", str(inside)).replace("{out}", str(outside)), None)
    assert "\n" not in str(refused.value)
    if "round" not in path:
        assert isinstance(refused.value, OutsideError)


def test_a_camera_file_is_confined_too_beside_and_in_the_uri(room):
    inside, outside = room
    with pytest.raises(OutsideError):
        open_shared(str(inside), str(outside / "camera.json"))
    with pytest.raises(OutsideError):
        open_shared(f"{inside}?camera={outside}/camera.json", None)
    uri, camera = allowed_session(f"{inside}/a.bag?topic=/depth&unit=0.001", str(inside / "camera.json"))
    assert (uri, camera) == (f"{inside}/a.bag?topic=/depth&unit=0.001", str(inside / "camera.json"))


def test_a_replayed_recording_is_confined_too(room):
    inside, outside = room
    request = Request("spf", "default", make_settings("spf"))
    for uri in (f"replay:{outside}/mine.mcap?loop=1", f"replay://{outside}/mine.mcap", "replay:/etc",
                f"replay:{inside}?camera={outside}/camera.json"):  # fmt: skip
        with pytest.raises(OutsideError):
            Live(uri, request)
    assert allowed_source("realsense:?rate=30") == "realsense:?rate=30"
    with pytest.raises(SensorError):
        allowed_source("replay:x?loop=1&loop=0")


def test_pose_and_hand_files_are_confined_too(room, act):
    (room[1] / "pose.json").write_text("{}")
    for choice in ({"init": "file", "pose_file": f"{room[1]}/pose.json"},
                   {"shape": "file", "hand_file": f"{room[0]}/../in side-not/pose.json"}):  # fmt: skip
        state = State()
        controller = Controller(state, Runner(), open_shared, allowed=allowed)
        act(lambda c=controller: c.open(bundled()["open-close"]))
        state.param.update(**choice)
        act(controller.start)
        assert "none of the folders" in state.error
        controller.close()


@pytest.mark.parametrize("run", ["..", ".", "", "../x", "/etc"])
def test_a_run_is_one_of_the_shelf(tmp_path, run):
    (tmp_path / "runs").mkdir()
    (tmp_path / "manifest.json").write_text("{}")
    with pytest.raises(RunError):
        Shelf(tmp_path / "runs").path(run)


def test_a_session_that_could_not_be_opened_can_be_chosen_again(room, act):
    state = State()
    controller = Controller(state, Runner(), open_shared, allowed=allowed)
    refused = str(room[1] / "mine.mcap")
    card = SessionCard(state, controller.open, bundled() | {"mine": refused}, Uploads())
    assert card._choice.value == ""  # nothing is open, and nothing is shown as if it were
    for before in ("", bundled()["open-close"]):
        act(lambda uri=before: card._open_choice(SimpleNamespace(new=uri)))
        card._choice.value = refused
        act(lambda: card._open_choice(SimpleNamespace(new=refused)))
        assert "none of the folders" in state.error
        assert card._choice.value == before
    controller.close()
