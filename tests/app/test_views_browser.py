"""What the filter thinks and the 3-D scene, as a visitor uses them in a real browser, light and dark, large and small."""

import re

import numpy as np

from tests.app.test_browser import (  # the fixture is used by name
    ARTEFACTS,
    at_frame,
    button,
    columns,
    page,
    picture,
    pixels,
    play_past,
    plotted,
    settled,
    start_from_truth,
)
from tests.app.test_browser import pytestmark as pytestmark

__all__ = ["page"]


def visible(page, name):
    """The button of a name in the tab that is seen."""
    return page.get_by_role("button", name=name, exact=True).filter(visible=True)


def look_from(page, name):
    page.get_by_role("button", name=re.compile(f"^{name}:")).click()
    page.mouse.move(5, 5)  # no tooltip over the picture
    page.wait_for_timeout(800)
    settled(page)


def choose(page, label, option):
    page.get_by_label(label, exact=True).filter(visible=True).click()
    page.locator("li").get_by_text(option, exact=True).click()


def shot(page, name):
    page.screenshot(path=ARTEFACTS / f"{name}.png")


def test_a_switch_shows_how_far_off_each_joint_may_be(page):
    start_from_truth(page)
    depth = page.locator(".picture-frame").filter(has=page.get_by_alt_text("Depth image", exact=True))
    settled(page)
    without = depth.screenshot()
    page.get_by_label("± 90 %").filter(visible=True).click()
    page.mouse.move(5, 5)
    for _ in range(40):
        page.wait_for_timeout(250)
        if depth.screenshot() != without:
            break
    assert depth.screenshot() != without
    shot(page, "spread")


def test_particles_are_seen_in_any_two_entries_and_picked(page):
    start_from_truth(page)
    for index in (1, 2):
        button(page, "Step").click()
        at_frame(page, index)
    assert columns(page, "x0") == []  # the tab costs nothing before it is asked for
    button(page, "What the filter thinks").click()
    picture(page, "Scene").filter(visible=True).wait_for()
    settled(page)
    count = len(plotted(page, "x0"))
    assert count in (4, 5)
    rows = page.locator(".tabulator-row")
    assert rows.count() == count
    assert len(plotted(page, "image")) == 1
    shot(page, "thinking")
    before, all_of_them = plotted(page, "x0"), pixels_of_scene(page)
    choose(page, "Across", "Index MP flexion, °")
    page.wait_for_timeout(1500)
    assert plotted(page, "x0") != before
    visible(page, "g").click()
    rows.nth(1).click()
    page.get_by_text("1 particle picked: show all").wait_for()
    settled(page)
    picked = "() => Bokeh.documents.flatMap((d) => [...d._all_models.values()])"
    picked += ".filter((m) => m.type === 'ColumnDataSource' && 'x0' in m.data).map((m) => m.selected.indices)"
    assert page.evaluate(picked) == [[1]]
    assert np.abs(pixels_of_scene(page) - all_of_them).mean() > 0.5
    shot(page, "thinking-picked")
    page.get_by_text("1 particle picked: show all").click()
    page.get_by_text("1 particle picked: show all").wait_for(state="hidden")
    page.get_by_role("button", name="Toggle theme").click()
    page.wait_for_timeout(1500)
    shot(page, "thinking-dark")
    page.set_viewport_size({"width": 1024, "height": 768})
    page.wait_for_timeout(1500)
    shot(page, "thinking-small-dark")
    assert page.evaluate("document.documentElement.scrollWidth <= window.innerWidth")


def pixels_of_scene(page):
    return pixels(page, "Scene")


def test_the_scene_has_layers_colours_views_and_residuals(page):
    start_from_truth(page)
    button(page, "Step").click()
    at_frame(page, 1)
    button(page, "3-D scene").click()
    picture(page, "Scene").wait_for()
    settled(page)
    seen = {"all": pixels(page, "Scene")}
    shot(page, "scene")

    def changed(name, least=0.3):
        settled(page)
        seen[name] = pixels(page, "Scene")
        shot(page, f"scene-{name}")
        last = list(seen.values())[-2]
        assert np.abs(seen[name] - last).mean() > least, name

    for layer in ("Predicted", "Paths", "Hand"):
        visible(page, layer).click()
        changed(layer.lower(), 0.05)
    choose(page, "Colour by", "distance")
    page.get_by_text("median distance of the points").wait_for()
    changed("distance", 0.05)
    for view in ("Front", "Side", "Top"):
        look_from(page, view)
        changed(view.lower())
    look_from(page, "Sensor")
    visible(page, "Optimised").click()
    visible(page, "Residuals").click()
    page.get_by_text("point to hand").wait_for()
    changed("residuals")
    box = picture(page, "Scene").bounding_box()
    x, y = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2
    page.keyboard.down("Shift")
    page.mouse.move(x, y)
    page.mouse.down()
    page.mouse.move(x + 120, y + 40, steps=6)
    page.mouse.up()
    page.keyboard.up("Shift")
    changed("panned")
    page.mouse.wheel(0, -300)
    changed("zoomed")
    picture(page, "Scene").dblclick()
    settled(page)
    assert np.abs(pixels(page, "Scene") - seen["residuals"]).mean() < 1.0
    play_past(page, 6)
    changed("played")
