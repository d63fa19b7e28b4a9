"""While frames are played, the time line says the frame that the pictures show."""

from collections import defaultdict

from tests.app.test_browser import at_frame, button, page, play_past, settled, start_from_truth
from tests.app.test_browser import pytestmark as pytestmark

__all__ = ["page"]  # the fixture is used by name

WATCH = """() => {
    const found = (root, fits) => {
        for (const node of root.querySelectorAll('*')) {
            if (fits(node)) return node;
            const inside = node.shadowRoot && found(node.shadowRoot, fits);
            if (inside) return inside;
        }
    };
    const image = (alt) => found(document, (node) => node.tagName === 'IMG' && node.alt === alt);
    const images = [image('Depth image'), image('Reconstructed hand')];
    const readout = found(document, (node) => node.classList.contains('readout'));
    window.shown = [];
    const look = () => {
        window.shown.push([readout.textContent.match(/Frame (\\d+)/)[1], ...images.map((node) => node.src)]);
        window.looking = requestAnimationFrame(look);
    };
    look();
}"""


def test_the_time_line_says_the_frame_that_the_pictures_show(page):
    start_from_truth(page)
    play_past(page, 9)
    page.keyboard.press("Home")
    at_frame(page, 0)
    settled(page)
    page.evaluate(WATCH)
    button(page, "Play").click()
    page.wait_for_function("() => new Set(window.shown.map((entry) => entry[0])).size > 8")
    shown = page.evaluate("() => { cancelAnimationFrame(window.looking); return window.shown; }")
    button(page, "Pause").click()
    for column in (1, 2):
        frames = defaultdict(set)
        for entry in shown:
            frames[entry[column]].add(entry[0])
        assert len(frames) > 6
        assert [said for said in frames.values() if len(said) > 1] == []
