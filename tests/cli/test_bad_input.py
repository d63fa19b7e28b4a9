"""Whatever is wrong with the input: one sentence on stderr that says so, an exit code, and no traceback."""

import json
import shutil

import cv2
import numpy as np
import pytest

from spf.cli import execute
from spf.sessions import open_session, write_session
from spf.synthetic import SyntheticSettings, synthesise
from tests.made_runs import kept_run

POSE = {"format": "spf-pose", "side": "right", "pose": [0.0] * 26}
CAMERA = {"fx": 224.5, "fy": 230.5, "cx": 160.0, "cy": 120.0}


def png_folder(folder, images, camera=None):
    folder.mkdir()
    for number, image in enumerate(images):
        cv2.imwrite(str(folder / f"depth_{number}.png"), image)
    (folder / "camera.json").write_text(json.dumps(camera or CAMERA))


@pytest.fixture(scope="module")
def place(tmp_path_factory):
    """A folder with all that may be wrong."""
    place = tmp_path_factory.mktemp("bad")
    made = synthesise(SyntheticSettings(frames=5, clutter="none"))
    write_session(made, place / "good.mcap")
    write_session(
        synthesise(SyntheticSettings(frames=4, clutter="none", absent_from=0, absent_frames=4)), place / "empty.mcap"
    )
    kept_run(open_session(place / "good.mcap"), place / "run")
    shutil.copytree(place / "run", place / "moved")
    manifest = json.loads((place / "run" / "manifest.json").read_text())
    manifest["session"]["uri"] = str(place / "gone.mcap")
    (place / "moved" / "manifest.json").write_text(json.dumps(manifest))
    (place / "torn.mcap").write_bytes((place / "good.mcap").read_bytes()[:300])
    (place / "nothing").mkdir()
    (place / "text.txt").write_text("hello")
    raw = np.stack([made.raw_depth(i) for i in range(3)])
    png_folder(place / "unit", raw, {**CAMERA, "depth_unit": 1e-5})
    png_folder(place / "damaged", raw)
    whole = (place / "damaged" / "depth_1.png").read_bytes()
    (place / "damaged" / "depth_1.png").write_bytes(whole[: len(whole) // 2])
    png_folder(place / "cameraless", raw)
    (place / "cameraless" / "camera.json").unlink()
    (place / "left.json").write_text(json.dumps({**POSE, "side": "left"}))
    (place / "dofs.json").write_text(json.dumps({**POSE, "pose": [0.0] * 30}))
    (place / "tornpose.json").write_text('{"format": "spf-p')
    (place / "lefthand.json").write_text(json.dumps({"format": "spf-hand-shape", "side": "left", "scale": 1.0}))
    (place / "giant.json").write_text(json.dumps({"format": "spf-hand-shape", "side": "right", "scale": 9.0}))
    return place


TRACK = "track good.mcap -o new --init truth"

CASES = {
    "no session": ("info missing", "no file or folder"),
    "no sensor": ("track leap: -o new", "leap: is no live sensor; there are realsense:"),
    "empty folder": ("info nothing", "an empty folder"),
    "no session file": ("info text.txt", "no reader knows"),
    "torn MCAP": ("info torn.mcap", "torn"),
    "wrong unit": ("track unit -o new", "wrong unit"),
    "torn PNG": ("track damaged -o new", "damaged"),
    "no camera": ("info cameraless", "camera file"),
    "camera of its own": ("info good.mcap --camera left.json", "brings its own camera"),
    "no hand": ("track empty.mcap -o new", "No frame shows anything"),
    "no hand to calibrate": ("calibrate empty.mcap -o hand.json", "No frame shows anything"),
    "no truth in view": ("track empty.mcap -o new --init truth", "truth"),
    "NaN setting": (f"{TRACK} --set h=nan", "finite number"),
    "no particles": (f"{TRACK} --set n=0", "outside its range"),
    "no number": (f"{TRACK} --set n=many", "whole number"),
    "unknown setting": (f"{TRACK} --set zeal=3", "There is no setting 'zeal'"),
    "no assignment": (f"{TRACK} --set n", "name=value"),
    "set twice": (f"{TRACK} --set n=3 --set n=4", "twice"),
    "unknown tracker": (f"{TRACK} --tracker kalman", "There is no tracker"),
    "unknown preset": (f"{TRACK} --preset best", "There is no preset"),
    "frames beyond the end": (f"{TRACK} --frames 2:9", "outside the session"),
    "frames backwards": (f"{TRACK} --frames 3:2", "outside the session"),
    "frames no range": (f"{TRACK} --frames 3", "like 0:100, 50: or :100"),
    "seed no number": (f"{TRACK} --seed one", "--seed"),
    "pose of the other side": ("track good.mcap -o new --init left.json", "left hand"),
    "pose of another hand": ("track good.mcap -o new --init dofs.json", "30 entries"),
    "torn pose": ("track good.mcap -o new --init tornpose.json", "torn or not JSON"),
    "no pose file": ("track good.mcap -o new --init pose.json", "cannot be read"),
    "hand of the other side": (f"{TRACK} --hand lefthand.json", "left hand"),
    "no human hand": (f"{TRACK} --hand giant.json", "no human hand"),
    "output is a file": ("track good.mcap -o text.txt", "is a file"),
    "output holds other things": ("track good.mcap -o .", "holds other things"),
    "nothing to track": ("track -o new", "nothing to track"),
    "no output": ("track good.mcap", "--output"),
    "unknown command": ("trak good.mcap", "No such command"),
    "unknown option": ("info good.mcap --loud", "--loud"),
    "no run": ("evaluate nothing", "is no run"),
    "no run to report": ("report nothing -o new.html", "is no run"),
    "report of another kind": ("report run -o new.pdf", "is an HTML file"),
    "report of another session": ("report run -o new.html --session empty.mcap", "not the recording of this run"),
    "report of a session that is gone": ("report run -o new.html --session gone.mcap", "no file or folder"),
    "report without its session": ("report moved -o new.html", "--no-session"),
    "export of another kind": ("export run -o new.txt", "ending says what is written"),
    "export of a frame that is not there": ("export run -o new.png --frame 40", "was not tracked"),
    "export of an unknown view": ("export run -o new.png --view below", "There is no view"),
    "no run to repeat": ("track --repeat nothing -o new", "is no run"),
    "repeat with changes": ("track --repeat nothing -o new --seed 3", "leave out --seed"),
    "no overwriting": ("convert good.mcap empty.mcap", "exists already"),
    "no such folder": ("convert good.mcap away/a.mcap", "no folder"),
    "convert a damaged folder": ("convert damaged new.mcap", "damaged"),
    "unknown motion": ("synth new.mcap --motion dance", "motion"),
    "no frames": ("synth new.mcap --frames 0", "outside its range"),
    "too far for the sensor": ("synth new.mcap --set distance=2.9", "out of the range"),
}


@pytest.mark.parametrize("name", CASES)
def test_one_sentence(name, place, monkeypatch, capfd):
    monkeypatch.chdir(place)
    before = sorted(place.rglob("*"))
    arguments, words = CASES[name]
    assert execute(arguments.split()) == 2
    captured = capfd.readouterr()
    assert captured.out == ""
    assert captured.err.startswith("spf: ")
    assert captured.err.count("\n") == 1
    assert words in captured.err
    assert "Traceback" not in captured.err
    assert sorted(place.rglob("*")) == before  # and nothing is left behind
