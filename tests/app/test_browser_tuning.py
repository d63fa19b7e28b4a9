"""The time line, tuning and runs as a visitor meets them, in one page: every step leaves a picture among the artefacts."""

import re

import pytest
from playwright.sync_api import expect

from tests.app.test_browser import (  # noqa: F401 - the fixture
    ARTEFACTS,
    CHROMIUM,
    at_frame,
    button,
    columns,
    nudge,
    page,
    picture,
    settled,
    start_from_truth,
)

pytestmark = pytest.mark.skipif(CHROMIUM is None, reason="no chromium on this machine")


def picture_of(page, name):  # noqa: F811
    page.screenshot(path=ARTEFACTS / f"tuning-{name}.png")


def keyed(page, key, frame):  # noqa: F811
    page.keyboard.press(key)
    at_frame(page, frame)


def test_time_line_tuning_and_runs(page, server):  # noqa: F811
    start_from_truth(page)
    # the time line
    for frame in (1, 2, 3, 4):
        keyed(page, "ArrowRight", frame)
    keyed(page, "ArrowLeft", 3)
    keyed(page, "Home", 0)
    keyed(page, "End", 4)
    keyed(page, "Shift+ArrowRight", 14)
    expect(button(page, "Track to here")).to_be_visible()
    page.keyboard.press("?")
    expect(page.get_by_role("dialog", name="List of keys")).to_be_visible()
    picture_of(page, "keys")
    page.keyboard.press("Escape")
    line = page.get_by_role("slider", name="Frame", exact=True)
    box = line.bounding_box()
    page.mouse.click(box["x"] + box["width"] / 2, box["y"] + 20)
    page.wait_for_function(
        "(line) => Math.abs(Number(line.getAttribute('aria-valuenow')) - 59) < 5", arg=line.element_handle()
    )
    keyed(page, "End", 4)
    keyed(page, "Home", 0)
    page.keyboard.press("w")
    expect(line).not_to_have_attribute("aria-valuenow", "0")
    keyed(page, "End", 4)
    page.keyboard.press("p")  # a loop stays among what was tracked
    page.keyboard.press(" ")
    button(page, "Pause").wait_for()
    at_frame(page, 1)
    page.keyboard.press(" ")
    button(page, "Play").wait_for()
    page.keyboard.press("p")
    # a setting is seen at once
    keyed(page, "End", 4)
    settled(page)
    corrections = columns(page, "correction_right")
    costs = columns(page, "cost")
    nudge(page, "^h", 20)
    nudge(page, "^k", 20)
    page.get_by_text(re.compile("This frame with these settings: ESS")).wait_for()
    page.wait_for_timeout(1500)
    assert columns(page, "correction_right") != corrections
    assert columns(page, "cost") != costs
    picture_of(page, "preview")
    button(page, "Undo").click()
    page.get_by_text(re.compile(r"Differs from the preset: h 4 →")).wait_for()
    button(page, "Save as a preset").click()
    page.get_by_label("Name of a new preset").fill("wide")
    button(page, "Save").click()
    page.get_by_text("As in the preset.").wait_for()
    # again, and the runs
    button(page, "Re-run all").click()
    page.get_by_text("Frame 4 of").wait_for()
    button(page, "Re-run all").and_(page.locator(":enabled")).wait_for()
    page.wait_for_url(re.compile("run="))
    page.wait_for_timeout(2500)
    button(page, "Runs").click()
    button(page, "Compare run").and_(page.locator(":enabled")).wait_for()
    address = page.url
    picture_of(page, "runs")
    with page.expect_download() as download:
        button(page, "Export run").click()
    assert download.value.suggested_filename.endswith(".zip")
    # the address, opened elsewhere in another size
    other = page.context.browser.new_page(viewport={"width": 1024, "height": 768})
    other.goto(address)
    at_frame(other, 4)
    picture(other, "Reconstructed hand").wait_for()
    settled(other)
    other.screenshot(path=ARTEFACTS / "tuning-elsewhere.png")
    assert columns(other, "after") == columns(page, "after")
    other.close()
    # compared, and dark
    button(page, "Compare run").click()
    picture(page, "Hand 2").wait_for()
    settled(page)
    assert [len(line) for line in columns(page, "apart") if line] == [5]
    picture_of(page, "compared")
    page.get_by_label("Toggle theme").click()
    page.wait_for_timeout(3000)
    picture_of(page, "dark")
    page.set_viewport_size({"width": 1024, "height": 768})
    page.wait_for_timeout(1500)
    picture_of(page, "dark-small")
    assert page.evaluate("document.documentElement.scrollWidth") <= 1024
