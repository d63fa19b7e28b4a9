"""``spf mark``: marks in and out of a session on the command line."""

import json

import pytest

from spf.cli import execute
from spf.sessions import marks_in, open_session, write_session
from spf.sessions.marks import marks_file
from tests.made_runs import made_session

CSV = "frame,joint,x_m,y_m,z_m,offset_m,hidden\n1,wrist,0.01,0.02,0.4,0.015,0\n1,index_tip,,,,,1\n2,wrist,0.01,0.02,0.41,,\n"


@pytest.fixture
def native(tmp_path):
    path = tmp_path / "take.mcap"
    write_session(made_session(4), path)
    return path


def test_marks_go_in_and_out(native, tmp_path, capsys):
    given, taken = tmp_path / "in.csv", tmp_path / "out.csv"
    given.write_text(CSV)
    assert execute(["mark", str(native)]) == 0
    assert "0 joints of 0 frames" in capsys.readouterr().out
    assert execute(["mark", str(native), "--import", str(given)]) == 0
    assert "Took 2 joints of 2 frames" in capsys.readouterr().out
    assert execute(["mark", str(native), "--export", str(taken), "--list"]) == 0
    out = capsys.readouterr().out
    assert "frame     1   1 joints: wrist; hidden: index_tip" in out
    assert execute(["mark", str(native), "--json"]) == 0
    assert json.loads(capsys.readouterr().out)[0] == {"frame": 1, "marked": ["wrist"], "hidden": ["index_tip"]}
    assert taken.read_text().splitlines()[1] == "1,wrist,0.010000,0.020000,0.400000,0.015000,0"
    assert execute(["mark", str(native), "--export", str(taken)]) == 2
    assert execute(["mark", str(native), "--into-session"]) == 0
    assert not marks_file(native).exists()
    assert list(marks_in(open_session(native))) == [1, 2]
    assert execute(["info", str(native)]) == 0
    assert "marked by hand" in capsys.readouterr().out


def test_what_is_marked_already_is_replaced_only_when_allowed(native, tmp_path, capsys):
    given = tmp_path / "in.csv"
    given.write_text(CSV)
    assert execute(["mark", str(native), "--import", str(given)]) == 0
    given.write_text("frame,joint,x_m,y_m,z_m\n1,wrist,0.05,0.02,0.4\n3,wrist,0.05,0.02,0.4\n")
    before = marks_file(native).read_text()
    assert execute(["mark", str(native), "--import", str(given)]) == 2
    assert "wrist of frame 1, which is marked already" in capsys.readouterr().err
    assert marks_file(native).read_text() == before
    assert execute(["mark", str(native), "--import", str(given), "--force"]) == 0
    marks = marks_in(open_session(native))
    assert marks[1]["wrist"].point[0] == 0.05
    assert list(marks) == [1, 2, 3]


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--import", "none.csv"], "cannot be read"),
        (["--export", "out.csv"], "No joint of take is marked"),
    ],
)
def test_mistakes_are_one_sentence(native, tmp_path, capsys, monkeypatch, arguments, words):
    monkeypatch.chdir(tmp_path)
    assert execute(["mark", str(native), *arguments]) == 2
    told = capsys.readouterr().err
    assert words in told
    assert told.count("\n") == 1
