"""The dashboard as a visitor meets it: served as the README says, in a real browser."""

import io
import os
import re
import shutil
import socket
import subprocess
import sys
import time
import urllib.request
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from playwright.sync_api import sync_playwright

REPOSITORY = Path(__file__).resolve().parent.parent.parent
ARTEFACTS = REPOSITORY / "tests" / "artefacts"
CHROMIUM = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)
PATIENCE = 120_000  # ms: a machine may be busy
COMPILING = 300_000  # ms that a first start may take, for it compiles the kernels
QUIET = [
    *("--no-sandbox", "--disable-gpu", "--disable-background-networking", "--disable-component-update"),
    *("--disable-sync", "--no-first-run", "--disable-default-apps"),
]
TROUBLE = re.compile(r"Traceback|\bERROR\b|Error running|Exception|exception")

pytestmark = pytest.mark.skipif(CHROMIUM is None, reason="no chromium on this machine")


@contextmanager
def serving(log, runs, *options, **variables):
    """Serve the dashboard with options of ``panel serve`` and environment variables; yields its address.

    Its runs and its presets go into a folder of the test's, where nobody's are.
    """
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port = probe.getsockname()[1]
    with log.open("w") as file:
        command = [sys.executable, "-m", "panel", "serve", "app", "--port", str(port), *options]
        environment = os.environ | {"SPF_RUNS": str(runs), "SPF_PRESETS": f"{runs}-presets"} | variables
        process = subprocess.Popen(command, cwd=REPOSITORY, stdout=file, stderr=subprocess.STDOUT, env=environment)
        try:
            _wait_for(f"http://localhost:{port}/app", process)
            yield f"http://localhost:{port}/app"
        finally:
            process.terminate()
            process.wait(60)


def make_shelf(tmp_path_factory):
    """The folder of a server's runs."""
    return tmp_path_factory.mktemp("runs")


def make_server(tmp_path_factory, shelf):
    """The address of a server, and its log so far."""
    log = tmp_path_factory.mktemp("server") / "log"
    with serving(log, shelf) as address:
        yield address, log


def _wait_for(address, process):
    for _ in range(600):
        assert process.poll() is None, "the server ended"
        try:
            with urllib.request.urlopen(address, timeout=120):
                return
        except OSError:
            time.sleep(0.2)
    pytest.fail("the server did not come up")


@contextmanager
def visiting(address, log):
    """A page; at the end, it has asked no other host for anything, and neither side has complained."""
    ARTEFACTS.mkdir(exist_ok=True)
    elsewhere, complaints, before = [], [], len(log.read_text())
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=CHROMIUM, args=QUIET)
        page = browser.new_page(viewport={"width": 1440, "height": 900})
        page.set_default_timeout(PATIENCE)
        page.on("request", lambda request: elsewhere.append(request.url) if _is_elsewhere(request.url) else None)
        page.on("console", lambda message: complaints.append(message.text) if message.type == "error" else None)
        page.on("pageerror", lambda error: complaints.append(str(error)))
        page.add_init_script("localStorage.setItem('spf-tour', localStorage.getItem('spf-tour') ?? 'seen')")
        page.goto(address)
        try:
            yield page
        finally:
            page.screenshot(path=ARTEFACTS / "last.png")
        page.wait_for_timeout(500)  # whatever is under way arrives before the page goes
        browser.close()
    assert elsewhere == []
    assert complaints == []
    assert not [line for line in log.read_text()[before:].splitlines() if TROUBLE.search(line)]


@pytest.fixture
def page(server):
    """A loaded page, as :func:`visiting` has it."""
    with visiting(*server) as page:
        picture(page, "Depth image").wait_for()
        yield page


def _is_elsewhere(url):
    return not url.startswith(("http://localhost:", "ws://localhost:", "data:", "blob:"))


def picture(page, name):
    """The frame around a picture that has been shown."""
    return page.locator(".picture-frame[data-shown]").filter(has=page.get_by_alt_text(name, exact=True))


def pixels(page, name):
    return np.asarray(Image.open(io.BytesIO(picture(page, name).screenshot())).convert("RGB")).astype(int)


def button(page, name):
    return page.get_by_role("button", name=name, exact=True)


def at_frame(page, index):
    page.get_by_text(f"Frame {index} of", exact=False).filter(visible=True).first.wait_for()


def past_frame(page, index):
    """Wait while it plays, faster than it can be looked at, until a frame below 10 or a later one is shown."""
    words = re.compile(rf"Frame ([{index}-9]|\d\d+) of")
    page.get_by_text(words).filter(visible=True).first.wait_for()


def play_past(page, index):
    """Play until a frame from ``index`` on is shown, and pause."""
    button(page, "Play").click()
    past_frame(page, index)
    button(page, "Pause").click()
    button(page, "Play").wait_for()


def settled(page):
    """Wait until no new picture comes: the sharp one is there."""

    before = None
    while (now := [f.get_attribute("data-shown") for f in page.locator(".picture-frame").all()]) != before:
        before = now
        page.wait_for_timeout(1200)


def start_from_truth(page):
    page.get_by_label("First pose").click()
    page.locator("li", has_text="Take it from the truth").click()
    button(page, "Start").click()
    picture(page, "Reconstructed hand").wait_for(timeout=COMPILING)
    button(page, "Step").and_(page.locator(":enabled")).wait_for()


def nudge(page, name, presses):
    """Move a slider with the keyboard."""
    page.get_by_role("slider", name=re.compile(name)).focus()
    for _ in range(presses):
        page.keyboard.press("ArrowRight")


def columns(page, name):
    """The values of a column in every data source of the page that has it."""
    script = """(name) => Bokeh.documents.flatMap((doc) => [...doc._all_models.values()])
        .filter((model) => model.type === 'ColumnDataSource' && name in model.data)
        .map((model) => [...model.data[name]])"""
    return page.evaluate(script, name)


def plotted(page, name):
    """The values of a column in all data sources together."""
    return [value for values in columns(page, name) for value in values]


PICTURES = (
    "Particles before and after optimisation",
    "Trajectories of optimisation",
    "Reconstructed hand",
    "Depth image",
)


def test_a_bundled_session_is_tracked_and_tuned(page):
    page.screenshot(path=ARTEFACTS / "first.png")
    assert pixels(page, "Depth image").std() > 5
    start_from_truth(page)
    settled(page)
    before = {name: pixels(page, name) for name in PICTURES}
    page.screenshot(path=ARTEFACTS / "started.png")
    nudge(page, "N", 4)
    nudge(page, "h", 10)
    page.get_by_text("Differs from the preset").wait_for()
    for index in range(1, 11):
        button(page, "Step").click()
        at_frame(page, index)
    settled(page)
    page.wait_for_function("Bokeh.documents.length > 0")
    for name in PICTURES:
        after = pixels(page, name)
        assert after.std() > 5, f"{name} is blank"
        assert np.abs(after - before[name]).mean() > 0.5, f"{name} did not change"
    page.screenshot(path=ARTEFACTS / "stepped.png")
    particles = len(plotted(page, "before"))
    assert particles in (8, 9)  # N, and the network's particle in the frames that it is asked in
    assert len(plotted(page, "after")) == particles
    assert len(plotted(page, "ess")) == len(plotted(page, "golden")) == len(plotted(page, "error")) == 11
    assert sum(plotted(page, "predicted")) + sum(plotted(page, "optimised")) == pytest.approx(100)


def test_playing_pausing_jumping_and_orbiting(page):
    start_from_truth(page)
    play_past(page, 3)
    settled(page)
    before = pixels(page, "Reconstructed hand")
    box = picture(page, "Reconstructed hand").bounding_box()
    x, y = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2
    page.mouse.move(x, y)
    page.mouse.down()
    page.mouse.move(x + 90, y + 30, steps=6)
    page.mouse.up()
    settled(page)
    page.screenshot(path=ARTEFACTS / "orbited.png")
    turned = pixels(page, "Reconstructed hand")
    assert np.abs(turned - before).mean() > 1
    picture(page, "Trajectories of optimisation").dblclick()
    settled(page)
    assert np.abs(pixels(page, "Reconstructed hand") - before).mean() < np.abs(turned - before).mean() / 4
    page.get_by_role("slider", name="Frame", exact=True).focus()
    page.keyboard.press("Home")
    at_frame(page, 0)


def test_trackers_are_compared_at_the_same_frame(page):
    start_from_truth(page)
    button(page, "Compare").click()
    page.get_by_text("So far", exact=True).wait_for()
    button(page, "Add a tracker").click()
    hands = ("Hand 1", "Hand 2", "Hand 3")
    picture(page, hands[2]).wait_for()
    settled(page)
    before = {name: pixels(page, name) for name in hands}
    nudge(page, "k", 5)
    for index in range(1, 4):
        button(page, "Step").click()
        at_frame(page, index)
    settled(page)
    page.screenshot(path=ARTEFACTS / "compared.png")
    for name in hands:
        after = pixels(page, name)
        assert after.std() > 5, f"{name} is blank"
        assert np.abs(after - before[name]).mean() > 0.5, f"{name} did not change"
    lines = [line for line in columns(page, "ms") if line]  # each lane's, and none of the lane that is not there
    assert [len(line) for line in lines] == [4, 4, 4]
    assert all(0 < value < 100 for line in columns(page, "error") for value in line)
    page.get_by_text("the settings were changed on the way", exact=False).wait_for()
    page.get_by_text("Frames 0 to 3", exact=False).wait_for()
    button(page, "One tracker").click()
    picture(page, "Particles before and after optimisation").wait_for()


def test_a_bad_path_is_one_sentence_in_the_page(page):
    button(page, "Open another session").click()
    page.get_by_label("Path of a file or folder").fill("sessions/none.mcap")
    button(page, "Open").click()
    page.get_by_text("There is no file or folder").wait_for()
    page.get_by_label("Path of a file or folder").fill("/etc/hosts")
    button(page, "Open").click()
    page.get_by_text("/etc/hosts is in none of the folders that this page may open").wait_for()
    page.screenshot(path=ARTEFACTS / "bad-path.png")
    assert os.linesep + "Traceback" not in page.content()
