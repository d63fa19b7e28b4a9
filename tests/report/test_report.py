"""The report of a run: what it says is true, it needs no network, and it says what is missing."""

import json
import re
import shutil
from dataclasses import replace

import numpy as np
import pytest
from playwright.sync_api import sync_playwright

from spf.errors import RenderUnavailableError, RunError
from spf.render import Renderer
from spf.render.process import UNAVAILABLE
from spf.report import report_html, write_report
from spf.report.keyframes import key_frames
from spf.trackfile import track_of
from tests.made_runs import LOST, WORST, made_run, made_session

CHROMIUM = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)


@pytest.fixture(scope="module")
def session():
    return made_session()


@pytest.fixture(scope="module")
def html(session, renderer):
    return report_html(made_run(session, h="9"), session, renderer, directory="runs/a b")


def _words(html):
    return " ".join(re.sub(r"<[^>]*>", " ", html).split())


def test_nothing_in_it_points_to_another_place(html):
    assert "http" not in html
    assert "//" not in re.sub(r"base64,[A-Za-z0-9+/=]+|// A pointer[^\n]*", "", html)
    assert not re.search(r"""(src|href)=["'](?!data:|#)""", html)
    assert "@import" not in html


def test_it_says_what_was_run_and_how_to_repeat_it(html):
    words = _words(html)
    for text in ("Smart Particle Filter on", "seed 7", "with 1 setting changed", "Frames 0 to 7 of 8"):
        assert text in words
    assert "spf track --repeat &#39;runs/a b&#39; -o again" in words
    assert "spf track &#39;a session.mcap&#39; -o runs/a" in words
    differing = html[html.index("What differs") : html.index("All settings")]
    assert re.findall(r'<tr class="differs"><th scope="row">(\w+)', differing) == ["h"]


def test_the_frames_shown_are_the_first_the_worst_and_the_loss(html):
    shown = re.findall(r"<b>Frame (\d+)</b>.*?(?:<mark[^>]*>([^<]*)</mark>)?</figcaption>", html)
    reasons = {int(frame): why for frame, why in shown if why}
    assert reasons == {0: "first", WORST: "worst", LOST[0]: "loss 1: given up", LOST[-1] + 1: "loss 1: found again"}
    assert html.count("data:image/jpeg") == 3 * len(shown)


def test_its_numbers_are_those_of_the_run(html):
    words = _words(html)
    assert "Losses 1 2 of 8 frames without a hand" in words
    error = float(re.search(r"Mean joint error ([\d.]+) mm", words).group(1))
    assert error == pytest.approx(30 / 8, abs=0.06)
    assert "4 5 2 found again" in words
    hover = [json.loads(text.replace("&#34;", '"')) for text in re.findall(r'data-hover="([^"]*)"', html)]
    errors = next(line["values"] for plot in hover for line in plot["lines"] if line["name"] == "mean over the joints")
    assert errors[WORST] == pytest.approx(30, abs=0.1)
    assert max(errors[:WORST] + errors[WORST + 1 :]) < 0.1


def test_without_the_session_it_says_so_and_shows_what_the_track_says(session):
    html = report_html(made_run(session, complete=False), None, None)
    words = _words(html)
    assert "Written without the session" in words
    assert "The run was stopped: 8 of its 8 frames" in words
    assert "data:image/jpeg" not in html
    assert "Effective samples 2.5" in words


def test_without_opengl_it_says_so_and_shows_the_depth(session, monkeypatch):
    def start(timeout):
        error = RenderUnavailableError(UNAVAILABLE)
        error.add_note("no library")
        raise error

    monkeypatch.setattr("spf.render.renderer.RenderProcess.start", start)
    with Renderer() as blind:
        html = report_html(made_run(session), session, blind)
    assert "3-D view unavailable" in _words(html)
    assert html.count("data:image/jpeg") == len(re.findall(r"<b>Frame \d+</b>", html)) > 4


def test_a_run_without_frames_is_one_sentence(session, tmp_path):
    run = made_run(session)
    with pytest.raises(RunError, match="nothing to report"):
        write_report(run._replace(track=track_of([], run.track.dof_names)), session, tmp_path / "a.html", None)
    assert list(tmp_path.iterdir()) == []


def test_a_session_without_a_held_hand_has_key_frames_too(session):
    track = made_run(session).track
    nothing = replace(track, lost=np.ones(len(track), bool))
    assert key_frames(nothing, nothing.golden) == []
    always = replace(track, lost=np.zeros(len(track), bool))
    assert key_frames(always, np.full(len(track), np.nan))[0].row == 0


@pytest.mark.skipif(CHROMIUM is None, reason="no chromium on this machine")
@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_it_opens_offline_and_is_accessible(html, tmp_path, scheme):
    from axe_playwright_python.sync_playwright import Axe

    path = tmp_path / "report.html"
    path.write_text(html, encoding="utf-8")
    asked, complaints = [], []
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=CHROMIUM, args=["--no-sandbox", "--disable-gpu"])
        context = browser.new_context(offline=True, color_scheme=scheme, viewport={"width": 1024, "height": 768})
        page = context.new_page()
        page.on("request", lambda request: asked.append(request.url))
        page.on("console", lambda message: complaints.append(message.text) if message.type == "error" else None)
        page.on("pageerror", lambda error: complaints.append(str(error)))
        page.goto(path.as_uri())
        page.locator("[data-hover] .canvas").first.hover()
        values = page.locator(".values").all_text_contents()
        wide = page.evaluate("document.documentElement.scrollWidth")
        found = Axe().run(page).response["violations"]
        browser.close()
    assert complaints == []
    assert [url for url in asked if not url.startswith(("file:", "data:"))] == []
    assert len(values) >= 5
    assert all(text.startswith("frame ") for text in values)
    assert wide <= 1024
    serious = [
        (v["id"], [node["html"][:120] for node in v["nodes"]][:3])
        for v in found
        if v["impact"] in ("serious", "critical")
    ]
    assert serious == []
