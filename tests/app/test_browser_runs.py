"""Frames tracked again as a visitor meets it, in one page: from here, one frame with another seed; what was there is kept."""

import re

import pytest

from tests.app.test_browser import (  # noqa: F401 - the fixture
    ARTEFACTS,
    CHROMIUM,
    at_frame,
    button,
    columns,
    make_server,
    make_shelf,
    nudge,
    page,
    settled,
    start_from_truth,
)

pytestmark = pytest.mark.skipif(CHROMIUM is None, reason="no chromium on this machine")


# No other test adds to these runs.
shelf = pytest.fixture(scope="module", name="shelf")(make_shelf)
server = pytest.fixture(scope="module", name="server")(make_server)


def kept(shelf):
    return sorted(path.name for path in shelf.iterdir())


def count_of_kept(page, shelf, count):  # noqa: F811
    """Wait until so many runs are kept."""
    for _ in range(100):
        if len(kept(shelf)) == count and all((shelf / run / "manifest.json").is_file() for run in kept(shelf)):
            return
        page.wait_for_timeout(200)
    pytest.fail(f"{len(kept(shelf))} runs were kept, not {count}")


def again(page, name):  # noqa: F811
    """Have frames tracked again, and wait until the page is at rest."""
    button(page, name).and_(page.locator(":enabled")).click()
    page.wait_for_timeout(300)
    button(page, "Re-run all").and_(page.locator(":enabled")).wait_for()
    settled(page)


def test_frames_are_tracked_again_and_runs_kept(page, shelf):  # noqa: F811
    start_from_truth(page)
    for frame in range(1, 6):
        page.keyboard.press("ArrowRight")
        at_frame(page, frame)
    count_of_kept(page, shelf, 1)
    settled(page)
    error = columns(page, "error")
    # from here, with another setting: what comes before stays, the rest is another run
    page.keyboard.press("ArrowLeft")
    page.keyboard.press("ArrowLeft")
    at_frame(page, 3)
    nudge(page, "^k", 20)
    page.get_by_text(re.compile("This frame with these settings: ESS")).wait_for()
    again(page, "Re-run from here")
    at_frame(page, 5)
    count_of_kept(page, shelf, 2)
    assert columns(page, "error") != error
    page.screenshot(path=ARTEFACTS / "again-from-here.png")
    # this frame with the next seed, and then with its own
    again(page, "… with the next seed")
    other_seed = columns(page, "after")
    again(page, "This frame again")
    assert columns(page, "after") != other_seed
