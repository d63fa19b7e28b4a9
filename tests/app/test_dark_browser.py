"""Light and large, dark and small: every tab and card can be read (axe-core's contrast) and nothing is cut off."""

from tests.app.test_browser import ARTEFACTS, at_frame, button, page, picture, settled, start_from_truth
from tests.app.test_browser import pytestmark as pytestmark
from tests.app.test_browser_help import serious

__all__ = ["page"]

CARDS = ("Open another session", "Live sensor", "All other settings", "Save as a preset", "Runs", "Export")
TABS = ("Overview", "What the filter thinks", "3-D scene", "Pose the hand", "Mark joints")


def looked_at(page, name, width):
    """What axe-core finds in a page that has come to rest; a picture of it is kept."""
    settled(page)
    page.screenshot(path=ARTEFACTS / f"{name}-{width}.png")
    assert page.evaluate("document.documentElement.scrollWidth") <= width
    if not serious(page):
        return {}
    page.wait_for_timeout(3000)  # a table that is being drawn has no rows for a moment
    return serious(page)


def test_every_tab_and_card_can_be_read(page):
    start_from_truth(page)
    for frame in (1, 2):
        page.keyboard.press("ArrowRight")
        at_frame(page, frame)
    for card in CARDS:
        button(page, card).click()
    page.get_by_label("Path of a file or folder").fill("/etc/hosts")
    button(page, "Open").click()
    page.get_by_text("none of the folders").wait_for()
    found = {}
    for theme, width, height in (("light", 1440, 900), ("dark", 1024, 768)):
        page.set_viewport_size({"width": width, "height": height})
        for tab in TABS:
            page.get_by_role("button", name=tab, exact=True).filter(visible=True).click()
            page.wait_for_timeout(1500)
            found |= looked_at(page, f"{theme}-{tab.split()[-1]}", width)
        button(page, "Compare").click()
        picture(page, "Hand 2").wait_for()
        found |= looked_at(page, f"{theme}-compare", width)
        button(page, "Help").click()
        picture(page, "Help: Reconstructed hand").wait_for()
        found |= looked_at(page, f"{theme}-help", width)
        button(page, "One tracker").click()
        page.get_by_label("Toggle theme").click()
        page.wait_for_timeout(1000)
    assert found == {}
