"""Tabs and modes: a line says that one is laid out for the first time, and each mode is found again where it was left."""

import pytest

from tests.app.test_browser import ARTEFACTS, button, page, picture, start_from_truth
from tests.app.test_browser import pytestmark as pytestmark

__all__ = ["page"]

FIND = """const all = (root, wanted) => [...root.querySelectorAll('*')].flatMap(
    (it) => [...(it.matches(wanted) ? [it] : []), ...(it.shadowRoot ? all(it.shadowRoot, wanted) : [])]);"""
#: Notes what each line that is laid out says while it is seen.
WATCH = f"""() => {{ {FIND}
  window.said = new Set(), window.room = 0;
  const look = () => {{
    for (const it of all(document, 'p.laying-out')) if (it.getClientRects().length) {{
      window.said.add(it.textContent);
      window.room = Math.max(window.room, it.getRootNode().host.getBoundingClientRect().height);
    }}
  }};
  for (const it of all(document, 'p.laying-out')) new MutationObserver(look).observe(it, {{ attributes: true, childList: true }});
}}"""
SCROLLED = f"() => {{ {FIND} return Math.round(all(document, '.main-content')[0].scrollTop); }}"
SCROLL = f"(to) => {{ {FIND} all(document, '.main-content')[0].scrollTop = to; }}"
NEAR = f"(wanted) => {{ {FIND} return Math.abs(all(document, '.main-content')[0].scrollTop - wanted) < 10; }}"


def said(page, words):
    """Wait until a line has said it and is gone again."""
    page.wait_for_function("(words) => window.said.has(words)", arg=words)
    page.get_by_text(words).wait_for(state="hidden")


def test_a_part_that_is_laid_out_the_first_time_is_announced(page):
    start_from_truth(page)
    page.evaluate(WATCH)
    for tab in ("3-D scene", "Mark joints"):
        page.get_by_role("button", name=tab, exact=True).filter(visible=True).click()
        said(page, f"Laying out “{tab}” …")
    assert page.evaluate("window.room") == 0, "what is below moves when the line goes"
    page.evaluate("window.said.clear()")
    for tab, shown in (("Overview", "Reconstructed hand"), ("3-D scene", "Scene")):  # made already
        page.get_by_role("button", name=tab, exact=True).filter(visible=True).click()
        picture(page, shown).filter(visible=True).wait_for()
    assert page.evaluate("window.said.size") == 0
    button(page, "Help").click()
    said(page, "Laying out the help …")
    page.screenshot(path=ARTEFACTS / "laid-out.png")


@pytest.mark.parametrize("mode", ["Help", "Compare"])
def test_a_mode_begins_at_its_top_and_is_found_where_it_was_left(page, mode):
    page.set_viewport_size({"width": 1024, "height": 768})
    start_from_truth(page)
    shown = {"Help": "Help: Reconstructed hand", "Compare": "Hand 2", "One tracker": "Reconstructed hand"}
    page.evaluate(SCROLL, 300)
    assert page.evaluate(SCROLLED) == 300
    button(page, mode).click()
    picture(page, shown[mode]).wait_for()
    assert page.evaluate(SCROLLED) == 0
    page.evaluate(SCROLL, 200)
    button(page, "One tracker").click()
    page.wait_for_function(NEAR, arg=300)
    picture(page, shown["One tracker"]).wait_for()
    button(page, mode).click()
    page.wait_for_function(NEAR, arg=200)
    picture(page, shown[mode]).wait_for()
    assert page.evaluate(NEAR, 200)
