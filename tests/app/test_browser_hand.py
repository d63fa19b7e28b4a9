"""A hand posed and joints marked as a visitor does it, in one page: every step leaves a picture among the artefacts."""

import json
import re
import shutil

import numpy as np
import pytest
from playwright.sync_api import expect

from app.server import bundled
from spf.hand import read_pose
from spf.sessions import marks_in, open_session
from tests.app.test_browser import (  # noqa: F401 - the fixture
    ARTEFACTS,
    CHROMIUM,
    COMPILING,
    at_frame,
    button,
    page,
    picture,
)

pytestmark = pytest.mark.skipif(CHROMIUM is None, reason="no chromium on this machine")

POSED, MARKED = "The hand over the depth image", "The depth image with the joints marked"
OVERLAP = re.compile(r"overlap by (\d+) %")


def picture_of(page, name):  # noqa: F811
    page.screenshot(path=ARTEFACTS / f"hand-{name}.png")


def everywhere(page, name):  # noqa: F811
    """Pictures in the dark and on a small screen, where nothing is cut off."""
    page.get_by_label("Toggle theme").click()
    page.set_viewport_size({"width": 1024, "height": 768})
    page.wait_for_timeout(4000)  # the colours change slowly
    picture_of(page, f"{name}-dark-small")
    assert page.evaluate("document.documentElement.scrollWidth") <= 1024
    page.get_by_label("Toggle theme").click()
    page.set_viewport_size({"width": 1440, "height": 900})
    page.wait_for_timeout(1500)


def sheet(page, name):  # noqa: F811
    return page.get_by_role("application", name=name)


def middle(page, handle):  # noqa: F811
    circle, box = page.locator(f".handle[data-name={handle}] circle").filter(visible=True), None
    while box is None:  # each drawing makes the handles anew
        box = circle.bounding_box()
    return np.array([box["x"] + box["width"] / 2, box["y"] + box["height"] / 2])


def until(page, condition):  # noqa: F811
    """Wait until something holds: the server may be busy."""
    for _ in range(100):
        if condition():
            return
        page.wait_for_timeout(100)
    assert condition()


def drag(page, handle, right, down, within):  # noqa: F811
    """Drag a handle, and wait until it is there, within so many pixels."""
    begin = middle(page, handle)
    page.mouse.move(*begin)
    page.mouse.down()
    page.mouse.move(*np.add(begin, (right, down)), steps=6)
    page.mouse.up()
    page.wait_for_timeout(800)
    until(page, lambda: np.abs(middle(page, handle) - begin - (right, down)).max() <= within)


def overlap(page):  # noqa: F811
    found = OVERLAP.search(page.locator(".pose-told").inner_text())
    return int(found.group(1)) if found else 0


def opened(page, path):  # noqa: F811
    button(page, "Open another session").click()
    page.get_by_label("Path of a file or folder").fill(str(path))
    button(page, "Open").click()
    page.locator("b", has_text=path.stem).first.wait_for()


def test_a_hand_is_posed_fitted_and_tracked_from(page, shelf, tmp_path):  # noqa: F811
    button(page, "Pose the hand").click()
    page.locator(".handle").first.wait_for()
    page.get_by_text("Placed where a hand is likely.").wait_for(timeout=COMPILING)
    button(page, "Fit from here").click()
    page.get_by_text("Fitted to this frame.").wait_for(timeout=COMPILING)
    fitted = overlap(page)
    assert fitted > 75
    picture_of(page, "fitted")
    begun = {"palm": middle(page, "palm")}
    drag(page, "palm", -40, 24, within=3)
    begun["middle_tip"] = middle(page, "middle_tip")
    drag(page, "middle_tip", 0, 50, within=6)
    until(page, lambda: overlap(page) < fitted - 10)
    picture_of(page, "dragged")
    for handle in ("middle_tip", "palm"):
        button(page, "Undo pose").click()
        until(page, lambda handle=handle: np.abs(middle(page, handle) - begun[handle]).max() < 1)
    until(page, lambda: overlap(page) == fitted)
    button(page, "Index").click()
    slider = page.get_by_role("slider", name=re.compile("Index PIP flexion"))
    slider.focus()
    tip = middle(page, "index_tip")
    for _ in range(30):
        page.keyboard.press("ArrowRight")
    until(page, lambda: np.linalg.norm(middle(page, "index_tip") - tip) > 2)
    button(page, "Fit from here").click()
    page.get_by_text("Fitted to this frame.").wait_for(timeout=COMPILING)
    assert overlap(page) >= fitted - 6
    button(page, "Fit shape").click()
    page.locator(".shape-change").wait_for(timeout=COMPILING)
    picture_of(page, "shape")
    everywhere(page, "pose")
    with page.expect_download() as download:
        button(page, "Save pose").click()
    download.value.save_as(tmp_path / "pose.json")
    saved = read_pose(tmp_path / "pose.json")
    with page.expect_download() as download:
        button(page, "Save hand").click()
    download.value.save_as(tmp_path / "hand.json")
    assert json.loads((tmp_path / "hand.json").read_text())["scale"] == pytest.approx(saved.shape.scale)
    button(page, "Use as first pose").click()
    page.get_by_text("press Start.", exact=False).wait_for()
    assert len(list((shelf / "poses").iterdir())) == 1
    button(page, "Start").click()
    button(page, "Step").and_(page.locator(":enabled")).wait_for(timeout=COMPILING)
    button(page, "Overview").click()
    picture(page, "Reconstructed hand").wait_for()
    page.wait_for_timeout(2000)
    picture_of(page, "started")


def test_joints_are_marked_and_kept(page, shelf):  # noqa: F811
    folder = shelf / "takes"  # a page opens only what lies in the server's folders
    folder.mkdir()
    path = folder / "take.mcap"
    shutil.copy(bundled()["open-close"], path)
    recorded = open_session(path)
    pixels = recorded.camera.project(recorded[0].truth.joints)
    opened(page, path)
    button(page, "Mark joints").click()
    sheet(page, MARKED).wait_for()
    expect(sheet(page, MARKED)).to_have_attribute("data-drawn", re.compile(r"\d+"))
    page.wait_for_timeout(1500)

    def click(joint):
        left, top, width, height = map(float, sheet(page, MARKED).get_attribute("data-box").split())
        box = sheet(page, MARKED).bounding_box()
        per = min(box["width"] / width, box["height"] / height)
        u, v = pixels[joint]
        page.mouse.click(
            box["x"] + box["width"] / 2 + (u - left - width / 2) * per,
            box["y"] + box["height"] / 2 + (v - top - height / 2) * per,
        )
        page.wait_for_timeout(700)

    for joint in range(6):
        click(joint)
    page.get_by_text("6 joints in 1 frame, kept", exact=False).wait_for()
    marks = marks_in(open_session(path))[0]
    names = ["wrist", "thumb_tm", "thumb_mp", "thumb_ip", "thumb_tip", "index_mcp"]
    assert list(marks) == names
    for joint, name in enumerate(names):
        assert recorded.camera.project(marks[name].point) == pytest.approx(pixels[joint], abs=1.0)
    picture_of(page, "marked")
    before = middle(page, "thumb_tip")
    drag(page, "thumb_tip", 12, 0, within=4)
    page.keyboard.press("ArrowRight")  # moves the mark, not the time line
    page.keyboard.press("]")
    page.wait_for_timeout(1000)
    at_frame(page, 0)
    assert middle(page, "thumb_tip")[0] > before[0] + 12
    moved = marks_in(open_session(path))[0]["thumb_tip"]
    assert moved.offset == pytest.approx(marks["thumb_tip"].offset + 0.001)
    page.keyboard.press(".")
    page.keyboard.press("h")
    page.wait_for_timeout(1000)
    assert marks_in(open_session(path))[0]["index_mcp"].point is None
    button(page, "Next frame with these").click()
    at_frame(page, 1)
    page.get_by_text("Taken over from the frame before", exact=False).wait_for()
    everywhere(page, "marks")
    assert list(marks_in(open_session(path))) == [0]
    button(page, "Keep suggested").click()
    page.get_by_text("10 joints in 2 frames, kept", exact=False).wait_for()
    with page.expect_download() as download:
        button(page, "Marks CSV").click()
    assert download.value.suggested_filename == "take-marks.csv"
    button(page, "Write into session").click()
    page.get_by_text("all that was recorded is as it was", exact=False).wait_for()
    assert sorted(file.name for file in folder.iterdir()) == ["take.mcap"]
    assert list(marks_in(open_session(path))) == [0, 1]
    assert open_session(path).fingerprint() == recorded.fingerprint()
