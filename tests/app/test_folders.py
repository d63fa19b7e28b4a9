"""A page opens what is in the folders that the server was started with, and nothing else."""

import json
import os
import shutil
from pathlib import Path
from types import SimpleNamespace

import cv2
import pytest

from app.controller import Controller
from app.folders import SAMPLES, OutsideError, allowed, allowed_session, allowed_source
from app.keeper import Keeper
from app.live import Live
from app.marking import Marking
from app.posing import Posing
from app.runner import Runner
from app.server import bundled, open_shared
from app.shelf import Shelf
from app.state import State
from app.uploads import Uploads
from app.views.session_card import SessionCard
from spf.errors import RunError, SensorError, SessionError
from spf.live.tracking import Request
from spf.sessions import open_session
from spf.sessions.marks import marks_file
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


def test_what_a_page_writes_it_may_open_again(room, act, monkeypatch):
    inside, outside = room
    monkeypatch.setenv("SPF_RUNS", str(outside / "runs"))  # the folder of runs may always be opened
    shutil.copy(outside / "mine.mcap", inside / "take.mcap")
    state = State(init="truth")
    controller = Controller(state, Runner(), open_shared, keeper=Keeper(state, Shelf()), allowed=allowed)
    posing, marking = Posing(controller, Shelf().folder), Marking(controller)
    act(lambda: controller.open(str(inside / "take.mcap")), posing.begin)
    # a pose
    posing.use()
    act(controller.start, controller.step)
    assert state.error == ""
    assert Path(state.pose_file).is_relative_to(outside / "runs" / "poses")
    # marks beside the session, and within it
    wrist = marking.session.camera.project(marking.frame().truth.joints[0])
    marking.place(*wrist)
    assert state.error == ""
    act(lambda: controller.open(str(inside / "take.mcap")))
    assert marking.marks
    act(marking.embed, lambda: controller.open(str(inside / "take.mcap")))
    assert state.error == ""
    assert marking.marks
    # a run
    assert open_shared(Shelf().runs()[0].manifest["session"]["uri"], None)
    # where a live recording goes
    assert allowed(SAMPLES / "live-2026-01-01-120000.mcap")
    controller.close()


def test_marks_are_neither_read_nor_written_outside(room, act, monkeypatch):
    frames = room[1] / "frames"
    frames.mkdir()
    session = open_session(room[1] / "mine.mcap")
    for index in range(2):
        cv2.imwrite(str(frames / f"{index:04}.png"), session.raw_depth(index))
    camera = session.camera
    numbers = {name: getattr(camera, name) for name in ("fx", "fy", "cx", "cy")}
    (frames / "camera.json").write_text(json.dumps(numbers | {"depth_unit": session.depth_unit}))
    monkeypatch.setenv("SPF_SESSIONS", str(frames))  # the session is the folder: what is beside it lies outside
    state = State()
    controller = Controller(state, Runner(), open_shared, allowed=allowed)
    marking = Marking(controller)
    act(lambda: controller.open(str(frames)))
    assert state.error == ""
    marking.place(*camera.project(session[0].truth.joints[0]))
    assert "frames.marks.json is in none of the folders" in state.error
    assert not marks_file(frames).exists()
    marks_file(frames).write_text("{}")
    with pytest.raises(OutsideError, match=r"marks\.json is in none of the folders"):
        open_shared(str(frames), None)
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
