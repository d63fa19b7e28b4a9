"""Live commands and sensors that give nothing, or come back as others: ended in time, in one sentence, with a failure."""

from __future__ import annotations

import re
import time

import pytest

from spf.cli import execute, live, live_track
from spf.errors import SensorError
from spf.live import network
from spf.sessions import open_session
from tests.live.sources import ABOUT, CAMERA, Scripted


def endless():
    while True:
        yield 0.01
        yield None


class Silent(Scripted):
    """It is there, and gives no frame."""

    warm_up = 0.0

    def __init__(self) -> None:
        super().__init__(endless())


class Exchanged(Scripted):
    """It is lost after ten frames, and comes back with another image size."""

    def __init__(self) -> None:
        super().__init__([*range(10), SensorError("Unplugged.")])

    def open(self, stopped=lambda: False):
        about = super().open(stopped)
        return about if self.opened == 1 else ABOUT._replace(camera=CAMERA._replace(width=64))


def use(monkeypatch, source) -> None:
    for module in (live, live_track):
        monkeypatch.setattr(module, "open_live", lambda _uri: source)


@pytest.mark.parametrize("command", ["record", "track"])
@pytest.mark.parametrize("uri", ["zmq://127.0.0.1:9", "realsense:"])
def test_a_sensor_that_gives_no_frame_ends_the_command_with_its_time(tmp_path, capsys, monkeypatch, command, uri):
    if uri == "realsense:":
        use(monkeypatch, Silent())
    else:
        monkeypatch.setattr(network.NetworkSource, "warm_up", 0.0)
        monkeypatch.setattr(network, "_FIRST", 1e6)  # its own patience is not what ends it
    assert execute([command, uri, "-o", str(tmp_path / "out.mcap"), "--seconds", "0.3"]) == 2
    said = capsys.readouterr().err
    assert re.search(rf"No frame came from {uri} within 0\.3 s: (start 'spf stream|unplug the sensor)", said)
    assert list(tmp_path.iterdir()) == []


def test_a_silent_sensor_without_a_time_is_given_up_too(tmp_path, capsys, monkeypatch):
    use(monkeypatch, Silent())
    monkeypatch.setattr("spf.cli.live_status._PATIENCE", 0.2)
    assert execute(["record", "realsense:", "-o", str(tmp_path / "r.mcap")]) == 2
    assert "No frame came from realsense: within 0.2 s" in capsys.readouterr().err


def test_nothing_sent_is_a_failure(capsys, monkeypatch):
    use(monkeypatch, Silent())
    assert execute(["stream", "realsense:", "--to", "tcp://127.0.0.1:*", "--seconds", "0.3"]) == 2
    assert "fake № 7 gave no frame, so that nothing was sent: unplug the sensor" in capsys.readouterr().err


def test_why_a_sensor_is_waited_for_is_told_once_and_its_time_counts_from_its_first_frame(
    tmp_path, capsys, monkeypatch
):
    away = SensorError("There is no camera.")
    use(monkeypatch, Scripted(away, away, range(5)))
    assert execute(["record", "realsense:", "-o", str(tmp_path / "r.mcap"), "--wait", "--seconds", "0.1"]) == 0
    assert capsys.readouterr().err.count("spf: warning: There is no camera.") == 1
    assert len(open_session(tmp_path / "r.mcap")) == 5


@pytest.mark.parametrize("command", ["record", "track", "stream"])
def test_a_sensor_that_comes_back_as_another_one_fails_the_command_and_keeps_what_was_recorded(
    tmp_path, capsys, monkeypatch, command
):
    def find(feed, request, progress, stop):
        while not feed.state.ended:
            time.sleep(0.01)

    monkeypatch.setattr(live_track, "find_live_start", find)
    use(monkeypatch, Exchanged())
    out = tmp_path / "out.mcap"
    file = out if command == "record" else out / "session.mcap"
    to = ["--to", "tcp://127.0.0.1:*"] if command == "stream" else ["-o", str(out)]
    assert execute([command, "realsense:", *to]) == 2
    said = capsys.readouterr()
    assert said.err.count("The sensor came back with another image size or camera: begin anew with it.") == 1
    if command == "stream":
        assert "Sent 10 frames" in said.out
        return
    assert f"begin anew with it. What was recorded until then is kept in {file}." in said.err
    assert "Recorded 10 frames" in said.out
    assert len(open_session(file)) == 10
