"""What a page says when something is missing: each state says what to do, in words that can be seen."""

from pathlib import Path
from urllib.parse import quote

import numpy as np
import pytest

from app.server import bundled
from spf.sessions import write_session
from spf.synthetic import SyntheticSettings, synthesise
from tests.app.test_browser import (
    ARTEFACTS,
    at_frame,
    button,
    picture,
    serving,
    start_from_truth,
    visiting,
)
from tests.app.test_browser import pytestmark as pytestmark
from tests.sessions.file_makers import make_npz


@pytest.fixture(scope="module")
def recordings(tmp_path_factory):
    """Recordings that lack something."""
    folder = tmp_path_factory.mktemp("recordings")
    whole = Path(bundled()["open-close"]).read_bytes()
    (folder / "torn.mcap").write_bytes(whole[: len(whole) // 3])
    (folder / "noise.bag").write_bytes(bytes(range(256)) * 8)
    made = make_npz(folder / "no-truth", np.random.default_rng(5))
    with np.load(made.path) as arrays:
        kept = {name: arrays[name] for name in arrays.files if name != "joints"}
    np.savez(made.path, **kept)
    away = SyntheticSettings(frames=24, seed=3, absent_from=6, absent_frames=8, clutter="none", speed_mm=4)
    write_session(synthesise(away), folder / "away.mcap")
    return folder


@pytest.fixture(scope="module")
def room(tmp_path_factory, shelf, recordings):
    """The address of a server that may open them, and its log."""
    log = tmp_path_factory.mktemp("room") / "log"
    with serving(log, shelf, SPF_SESSIONS=str(recordings)) as address:
        yield address, log


def shot(page, name):
    page.screenshot(path=ARTEFACTS / f"state-{name}.png")


def says(page, text, count=1):
    """Wait until so many places that can be seen say it."""
    found = page.get_by_text(text).filter(visible=True)
    found.nth(count - 1).wait_for()
    return found


def test_without_a_session_the_page_says_to_choose_one(room, recordings):
    address, log = room
    with visiting(f"{address}?session={quote(str(recordings / 'noise.bag'))}", log) as page:
        says(page, "is no session: it is a file of 2048 bytes that no reader knows")
        says(page, "No session is open.")
        says(page, "Choose a session on the left", count=3)
        says(page, "Choose a session to see its depth images.")
        assert button(page, "Start").is_disabled()
        shot(page, "no-session")
        page.get_by_label("Session", exact=True).click()
        page.locator("li", has_text="fast-wave").click()
        picture(page, "Depth image").wait_for()
        says(page, "Press Start", count=3)
        page.get_by_text("is no session").wait_for(state="hidden")
        shot(page, "no-start")


def test_a_torn_session_says_what_is_left_and_one_without_truth_offers_none(room, recordings):
    address, log = room
    with visiting(f"{address}?session={quote(str(recordings / 'torn.mcap'))}", log) as page:
        picture(page, "Depth image").wait_for()
        says(page, "recovered")
        shot(page, "torn")
        button(page, "Open another session").click()
        page.get_by_label("Path of a file or folder").fill(str(recordings / "no-truth.npz"))
        button(page, "Open").click()
        says(page, "no truth in this session")
        says(page, "no truth")
        page.get_by_label("First pose").click()
        assert page.locator("li", has_text="Take it from the truth").get_attribute("aria-disabled") == "true"
        shot(page, "no-truth")


def test_a_start_that_finds_nothing_and_a_missing_file_say_what_to_do(room, recordings):
    address, log = room
    with visiting(f"{address}?session=open-close", log) as page:
        picture(page, "Depth image").wait_for()
        page.get_by_label("First pose").click()
        page.locator("li", has_text="Read a pose file").click()
        button(page, "Start").click()
        says(page, "Type the path of a pose file first.")
        page.get_by_label("Path of the pose file").fill(str(recordings / "none.json"))
        button(page, "Start").click()
        says(page, "There is no pose file")
        shot(page, "no-pose-file")
        button(page, "Close").click()
        page.get_by_text("There is no pose file").wait_for(state="hidden")


def test_a_lost_hand_says_since_when_and_what_to_do(room, recordings):
    address, log = room
    with visiting(f"{address}?session={quote(str(recordings / 'away.mcap'))}", log) as page:
        picture(page, "Depth image").wait_for()
        start_from_truth(page)
        for frame in range(1, 10):
            page.keyboard.press("ArrowRight")
            at_frame(page, frame)
        says(page, "re-run from a frame before", count=3)
        says(page, "Hand lost at frame")
        shot(page, "lost")


def test_without_opengl_everything_else_works_and_the_pictures_say_what_to_install(shelf, tmp_path):
    for name in ("libOSMesa.so", "libOSMesa.so.6", "libOSMesa.so.8"):
        (tmp_path / name).touch()  # not a library: hides the real one
    hidden = {"LD_LIBRARY_PATH": str(tmp_path), "__EGL_VENDOR_LIBRARY_DIRS": str(tmp_path), "DISPLAY": ""}
    log = tmp_path / "log"
    with serving(log, shelf, **hidden) as address, visiting(address, log) as page:
        picture(page, "Depth image").wait_for()
        page.get_by_label("First pose").click()
        page.locator("li", has_text="Take it from the truth").click()
        button(page, "Start").click()
        says(page, "3-D view unavailable: install", count=3)
        for frame in (1, 2):
            button(page, "Step").and_(page.locator(":enabled")).click()
            at_frame(page, frame)
        says(page, "everything else on this page works", count=3)
        shot(page, "no-3d")
        button(page, "What the filter thinks").click()
        says(page, "3-D view unavailable: install")
        button(page, "3-D scene").click()
        says(page, "3-D view unavailable: install")
        shot(page, "no-3d-scene")
        button(page, "Compare").click()
        says(page, "So far")
        says(page, "3-D view unavailable: install", count=2)
        shot(page, "no-3d-compare")
