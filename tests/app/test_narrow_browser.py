"""A narrow page: what is needed now stays in sight."""

from app.look import TABS
from tests.app.test_browser import ARTEFACTS, button, page
from tests.app.test_browser import pytestmark as pytestmark

__all__ = ["page"]


def test_cancel_stays_in_sight_however_narrow_and_scrolled_the_page_is(page):
    button(page, "Start").click()
    cancel = button(page, "Cancel")
    cancel.wait_for()
    for width, height in ((1024, 768), (800, 600), (640, 600)):
        page.set_viewport_size({"width": width, "height": height})
        page.mouse.move(0.8 * width, 0.8 * height)
        page.mouse.wheel(0, 2000)
        page.wait_for_timeout(500)
        page.screenshot(path=ARTEFACTS / f"cancel-{width}.png")
        box = cancel.bounding_box()
        assert box["x"] >= 0
        assert box["x"] + box["width"] <= width
        assert 0 <= box["y"] < box["y"] + box["height"] <= height
    cancel.click()
    cancel.wait_for(state="hidden")


def test_every_tab_is_in_sight_on_a_narrow_page(page):
    for width in (1024, 820, 640):
        page.set_viewport_size({"width": width, "height": 900})
        page.wait_for_timeout(500)
        page.screenshot(path=ARTEFACTS / f"tabs-{width}.png")
        for name in TABS:
            box = button(page, name).bounding_box()
            assert box["x"] >= 0
            assert box["x"] + box["width"] <= width
