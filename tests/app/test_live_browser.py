"""A live sensor as a visitor uses it in a real browser: connected, tracked, recorded, marked, opened."""

import re

from spf.sessions import open_session
from tests.app.test_browser import ARTEFACTS, REPOSITORY, button, page, picture  # the fixture is used by name
from tests.app.test_browser import pytestmark as pytestmark

__all__ = ["page"]


def test_a_live_sensor_is_tracked_recorded_and_opened(page):
    button(page, "Live sensor").click()
    uri = page.get_by_label("Live sensor", exact=True).last
    uri.fill("replay:sessions/open-close.mcap?loop=1")
    uri.press("Enter")
    button(page, "Connect").click()
    picture(page, "Live depth image").wait_for()
    assert not picture(page, "Depth image").is_visible()
    button(page, "Record").click()
    name = re.compile(r"live-[\d-]+\.mcap")
    line = page.get_by_text(re.compile(r"Recording live-[\d-]+\.mcap: \d+ frames"))
    line.wait_for()
    path = REPOSITORY / "sessions" / name.search(line.inner_text()).group()
    try:
        page.get_by_label("Note (empty: a marker)").fill("thumb hidden")
        button(page, "Mark").click()
        page.get_by_text(re.compile(r"latency \d+ ms, 95 % under \d+ ms")).wait_for(timeout=180_000)
        page.screenshot(path=ARTEFACTS / "live.png")
        button(page, "Stop recording").click()
        button(page, "Open the recording").click()
        picture(page, "Depth image").wait_for()
        page.get_by_text(path.stem).filter(visible=True).first.wait_for()
        session = open_session(path)
        assert [note.text for note in session.notes] == ["thumb hidden"]
        assert (session.warnings, len(session) > 30) == ((), True)
    finally:
        path.unlink(missing_ok=True)
