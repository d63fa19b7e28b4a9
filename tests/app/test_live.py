"""A live sensor behind the page, without a browser."""

from __future__ import annotations

import asyncio
import time
from pathlib import Path

import pytest

from app.live import Live, LiveFacts
from app.state import State
from app.views.live_card import LiveCard, told
from spf.errors import SensorError, SessionError
from spf.live import FeedState, Recording
from spf.live.tracking import Request
from spf.prepare import prepare
from spf.sessions import open_session
from spf.trackers import make_settings

REQUEST = Request("spf", "default", make_settings("spf", "default", {"n": "2"}))


@pytest.fixture
def live(sample):
    made = Live(f"replay:{sample}?loop=1", REQUEST)
    yield made
    made.close()


def wait_for(condition):
    until = time.monotonic() + 120
    while not condition():
        assert time.monotonic() < until, "it never came"
        time.sleep(0.01)


def test_it_is_seen_tracked_and_recorded(live, tmp_path):
    wait_for(lambda: live.picture is not None)
    assert live.picture.joints is None
    live.record(tmp_path / "new" / "r.mcap")
    assert live.note("")
    assert live.note("thumb")
    with pytest.raises(SessionError, match="is already there"):
        live.record(tmp_path / "new" / "r.mcap")
    wait_for(lambda: live.facts.latency_ms is not None)
    facts = live.facts
    assert facts.doing in ("Tracking", "Lost, searching")
    assert "latency" in told(facts)
    wait_for(lambda: live.picture.joints is not None)
    assert live.picture.joints.shape == (21, 3)
    recording = live.close()
    session = open_session(recording.path)
    assert (len(session), recording.lost, session.warnings) == (recording.frames, 0, ())
    assert [(note.kind, note.text) for note in session.notes] == [("marker", ""), ("note", "thumb")]


def test_a_start_that_may_be_wrong_is_said_while_it_is_tracked(sample, monkeypatch):
    start = prepare(open_session(sample), init="truth")
    doubtful = start._replace(margin=0.0, shape=start.shape._replace(lens=1.3))
    monkeypatch.setattr("app.live.find_live_start", lambda *_asked: doubtful)
    live = Live(f"replay:{sample}?loop=1", REQUEST)
    wait_for(lambda: live.facts.warning)
    text = told(live.facts)
    live.close()
    assert "The side may be wrong" in text
    assert "choose it under Hand shown" in text
    assert "check the camera file" in text


def test_a_sensor_that_is_missing_is_told_and_waited_for():
    live = Live("replay:nowhere.mcap", REQUEST)
    wait_for(lambda: "There is no file or folder nowhere.mcap" in told(live.facts))
    assert live.facts.doing == "Connecting"
    with pytest.raises(SessionError, match="before the sensor is connected"):
        live.record(None)
    live.close()
    with pytest.raises(SensorError, match="is no live sensor"):
        Live("leap:", REQUEST)


def test_a_sensor_that_came_back_as_another_one_is_told_as_the_end(sample):
    live = Live(f"replay:{sample}?loop=1", REQUEST)
    wait_for(lambda: live.facts.feed.connected)
    live._feed._update(message="The sensor came back with another image size.", failed=True, connected=False)
    text = told(live.facts)
    live.close()
    assert "<b>Stopped</b>" in text
    assert "another image size" in text


def test_what_is_told():
    state = FeedState(None, False, "Unplugged. <Trying> again.", 100, 3, 0, 29.7, 2, False, False)
    recording = Recording(
        Path("r.mcap"), 90, 1, 4, 2, 3.0, 2_500_000, 60.0, "The disk is full in about 60 s: make room.", ""
    )
    text = told(LiveFacts("Tracking", state, recording, 28.0, (31.4, 58.8), 7, 2, "The side may be wrong", ""))
    for part in (
        "30 frames/s", "tracked 28/s", "latency 31 ms, 95 % under 59 ms", "7 dropped for newer ones", "hand lost in 2",
        "3 lost before this computer", "connected again 2×", "90 frames, 3 s, 2.5 MB", "4 not recorded",
        "2 markers and notes not kept",
        "The disk is full in about 60 s", "&lt;Trying&gt;", "The side may be wrong",
    ):  # fmt: skip
        assert part in text


def test_the_card_connects_records_and_opens_what_was_recorded(sample, tmp_path):
    opened = []

    async def open_(path, camera):
        opened.append(path)

    async def use():
        state = State()
        card = LiveCard(state, open_, tmp_path, lambda _report: None)
        card._uri.value = "leap:"
        await card._toggle(None)
        assert "is no live sensor" in state.error
        card._uri.value = card._uri.value_input = f"replay:{sample}?loop=1"
        await card._toggle(None)
        assert (state.error, card.view.visible, card._connect.label) == ("", True, "Disconnect")
        while card.live.picture is None:
            await asyncio.sleep(0.01)
        await card._toggle_recording(None)
        assert card._record.label == "Stop recording"
        card._note.value = card._note.value_input = "a note"
        card._set_mark(None)
        assert card._note.value == ""
        await asyncio.sleep(0.3)
        assert card._picture.source.startswith("data:image/jpeg;base64,/9j/")
        await card._toggle_recording(None)
        assert card._reopen.visible
        await card._open_recorded(None)
        assert card.live is None
        assert not card.view.visible

    asyncio.run(use())
    (path,) = opened
    assert [note.text for note in open_session(path).notes] == ["a note"]


def test_a_page_that_is_left_ends_its_recording_whole(sample, tmp_path):
    async def use():
        card = LiveCard(State(), None, tmp_path, lambda _report: None)
        card._uri.value = card._uri.value_input = f"replay:{sample}?loop=1"
        await card._toggle(None)
        while card.live.picture is None:
            await asyncio.sleep(0.01)
        await card._toggle_recording(None)
        await asyncio.sleep(0.2)
        card.close()

    asyncio.run(use())
    (path,) = tmp_path.glob("*.mcap")
    assert open_session(path).warnings == ()
