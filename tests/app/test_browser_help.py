"""Tour, help, exports and accessibility, as a visitor meets them in a real browser; no request leaves the machine."""

import re

import pytest
from axe_playwright_python.sync_playwright import Axe

from app.views.help import STAGES
from app.views.tour import STEPS
from tests.app.test_browser import (  # the fixture is used by name
    ARTEFACTS,
    button,
    page,
    picture,
    pixels,
    settled,
    start_from_truth,
)
from tests.app.test_browser import pytestmark as pytestmark

__all__ = ["page"]


def serious(page):
    """What axe-core finds wrong and calls serious or critical: rule and elements."""
    found = Axe().run(page, options={"resultTypes": ["violations"]}).response["violations"]
    return {
        finding["id"]: [node["html"][:160] for node in finding["nodes"]]
        for finding in found
        if finding["impact"] in ("serious", "critical")
    }


FRAMED = """() => {
  const framed = (root) => {
    for (const it of root.querySelectorAll('*')) {
      if (getComputedStyle(it).outlineColor === 'rgb(230, 159, 0)' && getComputedStyle(it).outlineWidth === '3px') return it;
      const inside = it.shadowRoot && framed(it.shadowRoot);
      if (inside) return inside;
    }
    return null;
  };
  return framed(document)?.getBoundingClientRect().top;
}"""


def test_the_tour_s_frame_keeps_clear_of_labels(page):
    button(page, "Tour").click()
    for label in ("Session", "First pose"):
        page.wait_for_timeout(500)
        words = page.locator("label", has_text=re.compile(f"^{label}$")).filter(visible=True).first.bounding_box()
        assert words["y"] >= page.evaluate(FRAMED) + 3 + 1  # the frame's width, and air
        button(page, "Next").click()


def test_the_first_visit_gets_a_tour_and_the_second_none(page):
    assert page.get_by_role("dialog", name="Tour").is_hidden()
    page.evaluate("localStorage.setItem('spf-tour', 'not yet')")
    page.reload()
    tour = page.get_by_role("dialog", name="Tour")
    for number, step in enumerate(STEPS, 1):
        tour.get_by_text(f"Step {number} of {len(STEPS)}").wait_for()
        assert tour.get_by_role("heading").text_content() == step.title
        page.wait_for_timeout(300)
        page.screenshot(path=ARTEFACTS / f"tour-{number}.png")
        button(page, "Next" if number < len(STEPS) else "Done").click()
    tour.wait_for(state="hidden")
    page.reload()
    picture(page, "Depth image").wait_for()
    page.wait_for_timeout(1000)
    assert page.get_by_role("dialog", name="Tour").is_hidden()
    button(page, "Tour").click()
    page.get_by_text(f"Step 1 of {len(STEPS)}").wait_for()
    page.keyboard.press("Escape")
    page.get_by_role("dialog", name="Tour").wait_for(state="hidden")


def test_the_help_explains_beside_the_live_pictures(page):
    start_from_truth(page)
    button(page, "Help").click()
    for stage in STAGES:
        page.get_by_text(stage.title, exact=True).wait_for()
    reconstructed = "Help: Reconstructed hand"
    picture(page, reconstructed).wait_for()
    settled(page)
    page.screenshot(path=ARTEFACTS / "help.png")
    before = pixels(page, reconstructed)
    assert before.std() > 5
    for _ in range(3):
        button(page, "Step").and_(page.locator(":enabled")).click()
    settled(page)
    assert (pixels(page, reconstructed) != before).any()
    button(page, "One tracker").click()
    picture(page, "Reconstructed hand").wait_for()


@pytest.mark.parametrize("kind", ["Report", "Track CSV"])
def test_a_run_is_exported_as_a_download(page, kind, tmp_path):
    start_from_truth(page)
    button(page, "Export").click()
    with page.expect_download() as download:
        button(page, kind).click()
    path = tmp_path / download.value.suggested_filename
    download.value.save_as(path)
    text = path.read_text()
    assert text.startswith("<!doctype html>" if kind == "Report" else '"frame","time"')
    assert "http" not in text
    page.screenshot(path=ARTEFACTS / "export.png")


def test_the_page_has_no_serious_finding_of_axe(page):
    assert serious(page) == {}
    start_from_truth(page)
    settled(page)
    assert serious(page) == {}
    button(page, "Help").click()
    picture(page, "Help: Reconstructed hand").wait_for()
    assert serious(page) == {}
