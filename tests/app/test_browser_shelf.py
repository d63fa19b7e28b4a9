"""Cancel, runs and presets as a visitor meets them, and the page's address opened elsewhere."""

import re

from playwright.sync_api import expect

from tests.app.test_browser import (  # the fixture is used by name
    ARTEFACTS,
    at_frame,
    button,
    nudge,
    page,
    picture,
    pixels,
    settled,
    start_from_truth,
)
from tests.app.test_browser import pytestmark as pytestmark
from tests.app.test_browser_runs import count_of_kept, kept, server, shelf

__all__ = ["page", "server", "shelf"]


def at_rest(page):
    button(page, "Re-run all").and_(page.locator(":enabled")).wait_for()
    expect(button(page, "Cancel")).to_be_hidden()


def tracked_to(page):
    """The last frame that was tracked, as the head of the time line says."""
    return int(re.search(r"tracked to (\d+)", page.get_by_text(re.compile(r"tracked to \d+")).first.inner_text())[1])


def track_to(page, tens):
    for frame in range(10, 10 * tens + 1, 10):
        page.keyboard.press("Shift+ArrowRight")
        at_frame(page, frame)
    button(page, "Track to here").click()


def test_a_long_run_and_a_rerun_are_cancelled_and_runs_are_kept_named_opened_and_deleted(page, shelf):
    before = set(kept(shelf))
    start_from_truth(page)
    track_to(page, 11)
    page.get_by_text(re.compile("Tracking to frame 110")).first.wait_for()
    page.get_by_text(re.compile(r"tracked to [2-9]\d")).first.wait_for()
    button(page, "Cancel").click()
    at_rest(page)
    reached = tracked_to(page)
    assert 19 < reached < 110
    page.wait_for_timeout(1500)
    assert tracked_to(page) == reached  # it has ended, not only been hidden
    count_of_kept(page, shelf, len(before) + 1)
    # a re-run is cancelled: what it has tracked is a run of its own, the one before it stays whole
    button(page, "Re-run all").click()
    page.get_by_text(re.compile(rf"Tracking to frame {reached}")).first.wait_for()
    page.get_by_text(re.compile(r"tracked to ([2-9]|1\d)\b")).first.wait_for()
    button(page, "Cancel").click()
    at_rest(page)
    again = tracked_to(page)
    assert 1 < again < reached
    page.wait_for_timeout(1500)
    assert tracked_to(page) == again
    count_of_kept(page, shelf, len(before) + 2)
    # the shelf: named, opened again, deleted with two clicks
    button(page, "Runs").click()
    page.get_by_label("Name of the run").fill("the first try")
    button(page, "Rename").click()
    page.get_by_label("Run", exact=True).filter(has_text="the first try").wait_for()
    page.screenshot(path=ARTEFACTS / "shelf-named.png")
    page.get_by_label("Run", exact=True).click()
    page.locator("li", has_text=re.compile(rf"· {reached + 1} frames")).click()
    button(page, "Open run").click()
    page.get_by_text(f"tracked to {reached}").first.wait_for()
    at_rest(page)
    button(page, "Delete run").click()
    button(page, "Really delete?").click()
    page.get_by_text("the first try").first.wait_for()
    assert len(kept(shelf)) == len(before) + 1


def test_a_preset_is_saved_chosen_and_deleted(page):
    nudge(page, "^k", 5)
    page.get_by_text(re.compile("Differs from the preset: k")).wait_for()
    button(page, "Save as a preset").click()
    page.get_by_label("Name of a new preset").fill("mine")
    button(page, "Save").click()
    page.get_by_text("As in the preset.").wait_for()
    page.screenshot(path=ARTEFACTS / "preset-saved.png")
    button(page, "Delete the preset mine").click()
    button(page, "Really delete?").click()
    page.get_by_text(re.compile("Differs from the preset: k")).wait_for()
    page.get_by_label("Preset", exact=True).click()
    page.locator("li", has_text="paper").wait_for()
    assert page.locator("li", has_text="mine").count() == 0


def test_the_address_opened_elsewhere_shows_the_same_look(page):
    start_from_truth(page)
    for frame in (1, 2, 3):
        page.keyboard.press("ArrowRight")
        at_frame(page, frame)
    page.get_by_role("button", name="3-D scene", exact=True).click()
    picture(page, "Scene").filter(visible=True).wait_for()
    button(page, "Hand").click()
    button(page, "Paths").click()
    page.get_by_label("Follow").click()
    page.get_by_role("button", name=re.compile("^Side:")).click()
    page.wait_for_url(re.compile(r"run=.*tab=scene.*layers=points,predicted,optimised,hand.*stay="))
    page.mouse.move(5, 5)
    settled(page)
    elsewhere = page.context.browser.new_page(viewport={"width": 1440, "height": 900})
    elsewhere.add_init_script("localStorage.setItem('spf-tour', 'seen')")
    elsewhere.goto(page.url)
    at_frame(elsewhere, 3)
    picture(elsewhere, "Scene").filter(visible=True).wait_for()
    settled(elsewhere)
    assert not elsewhere.get_by_label("Follow").is_checked()
    here, there = pixels(page, "Scene"), pixels(elsewhere, "Scene")
    elsewhere.screenshot(path=ARTEFACTS / "elsewhere.png")
    assert here.shape == there.shape
    assert abs(here - there).mean() < 1.0
    elsewhere.close()
