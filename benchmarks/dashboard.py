"""Speed of the dashboard in a browser: ``uv run python -m benchmarks.dashboard [--json PATH]``.

Serves the dashboard, makes a synthetic session of 640×480 pixels, and drives Chromium through it as a visitor would. What
is timed ends when the browser shows the picture, not when the server has sent it.
"""

from __future__ import annotations

import argparse
import json
import os
import shutil
import signal
import socket
import subprocess
import sys
import tempfile
import time
import urllib.request
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
from playwright.sync_api import Page, sync_playwright

from spf.sessions import write_session
from spf.synthetic import SyntheticSettings, synthesise

__all__ = ["main"]

ROOT = Path(__file__).resolve().parent.parent
TABS = {"Overview": "Reconstructed hand", "3-D scene": "Scene"}  # tab → the picture that is waited for
BARS = {"step": 150.0, "play": 12.0, "setting": 200.0}  # ms, pictures/s, ms
PATIENCE = 300_000  # ms: a first start compiles the kernels

# Pictures are inside shadow roots; `shown` counts those that the browser has put on the screen.
_WATCH = """() => {
  const all = (root) => [...root.querySelectorAll('*')].flatMap((e) => [e, ...(e.shadowRoot ? all(e.shadowRoot) : [])]);
  window.frameOf = (alt) => all(document).find(
    (e) => e.classList.contains('picture-frame') && e.querySelector('img').alt === alt);
  window.shown = (alt) => Number(window.frameOf(alt)?.dataset.shown || 0);
  window.until = async (wanted, ms) => {
    const begin = performance.now();
    while (!wanted()) {
      if (performance.now() - begin > ms) return NaN;
      await new Promise((done) => setTimeout(done, 1));
    }
    return performance.now() - begin;
  };
  window.plotted = (name) => JSON.stringify(Bokeh.documents.flatMap((doc) => [...doc._all_models.values()])
    .filter((model) => model.type === 'ColumnDataSource' && name in model.data)
    .map((model) => [...model.data[name]]));
}"""
_STEP = """async ([alt, label]) => {
  const all = (root) => [...root.querySelectorAll('*')].flatMap((e) => [e, ...(e.shadowRoot ? all(e.shadowRoot) : [])]);
  const button = all(document).find((e) => e.tagName === 'BUTTON' && e.innerText.trim().endsWith(label) && !e.disabled);
  if (!button) throw new Error(`no button ${label} can be pressed`);
  const before = window.shown(alt);
  button.click();
  return window.until(() => window.shown(alt) > before, 10000);
}"""


def measure(frames: int, steps: int, seconds: float) -> dict[str, Any]:
    """Measure everything: ms, pictures a second."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "benchmark.mcap"
        session = synthesise(SyntheticSettings(motion="open_close", sensor="realsense", frames=frames, seed=1))
        write_session(session, path)
        camera = session[0].camera
        with _served() as address, sync_playwright() as playwright:
            chromium = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))))
            browser = playwright.chromium.launch(executable_path=chromium, args=["--no-sandbox", "--disable-gpu"])
            page = browser.new_page(viewport={"width": 1440, "height": 900})
            page.set_default_timeout(PATIENCE)
            page.goto(address)
            _start(page, path)
            page.set_default_timeout(PATIENCE / 10)
            figures = {tab: _measured(page, tab, picture, steps, seconds) for tab, picture in TABS.items()}
            figures["setting"] = _setting(page)
            browser.close()
    return {"session": f"{camera.width}×{camera.height}", "particles": 4, **figures}


@contextmanager
def _served() -> Iterator[str]:
    """The address of a server of its own."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port = probe.getsockname()[1]
    command = [sys.executable, "-m", "panel", "serve", "app", "--port", str(port)]
    process = subprocess.Popen(
        command, cwd=ROOT, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
        env=os.environ | {"SPF_SESSIONS": tempfile.gettempdir()},
    )  # fmt: skip
    address = f"http://localhost:{port}/app"
    try:
        while process.poll() is None:
            try:
                urllib.request.urlopen(address, timeout=120).close()
                break
            except OSError:
                time.sleep(0.2)
        yield address
    finally:
        process.send_signal(signal.SIGINT)
        process.wait(60)


def _button(page: Page, name: str) -> Any:
    return page.get_by_role("button", name=name, exact=True).filter(visible=True)


def _start(page: Page, path: Path) -> None:
    """Open the session, start from its truth, and let everything warm up."""
    _button(page, "Open another session").click()
    page.get_by_label("Path of a file or folder").fill(str(path))
    _button(page, "Open").click()
    page.get_by_text("640×480", exact=False).first.wait_for()
    page.get_by_label("First pose").click()
    page.locator("li", has_text="Take it from the truth").click()
    _button(page, "Start").click()
    page.locator(".picture-frame[data-shown]").filter(has=page.get_by_alt_text("Reconstructed hand")).wait_for()
    _button(page, "Step").and_(page.locator(":enabled")).wait_for()
    page.evaluate(_WATCH)


def _measured(page: Page, tab: str, picture: str, steps: int, seconds: float) -> dict[str, float]:
    """Time from Step to the new picture, ms, and pictures a second while playing."""
    _button(page, tab).click()
    page.wait_for_timeout(3000)
    times = []
    for _ in range(steps + 3):
        times.append(page.evaluate(_STEP, [picture, "Step"]))
        page.wait_for_timeout(1500)  # the plots and the sharp picture have come
    page.evaluate(_STEP, [picture, "Play"])
    page.wait_for_timeout(1500)
    before = page.evaluate("(alt) => [window.shown(alt), performance.now()]", picture)
    page.wait_for_timeout(1000 * seconds)
    after = page.evaluate("(alt) => [window.shown(alt), performance.now()]", picture)
    _button(page, "Pause").click()
    _button(page, "Play").wait_for()
    kept = np.array(times[3:])  # the first ones warm up
    return {
        "step_p50_ms": float(np.median(kept)),
        "step_p90_ms": float(np.percentile(kept, 90)),
        "pictures_per_second": 1000 * (after[0] - before[0]) / (after[1] - before[1]),
    }


def _setting(page: Page) -> float:
    """Time from a change of h to new correction factors in the overview, ms; nan when the plot only follows a step."""
    _button(page, "Overview").click()
    page.wait_for_timeout(2000)
    times = []
    for _ in range(7):
        slider = page.get_by_role("slider").and_(page.get_by_label("window of the density", exact=False)).first
        slider.focus()
        page.evaluate(
            """() => { window.old = window.plotted('correction_right');
              document.addEventListener('keydown', () => { window.effect = window.until(
                () => window.plotted('correction_right') !== window.old, 3000); }, { once: true, capture: true }); }"""
        )
        page.keyboard.press("ArrowRight")
        times.append(page.evaluate("() => window.effect"))
        page.wait_for_timeout(500)
    return float(np.median(times))


def _print(figures: dict[str, Any]) -> None:
    print(f"Dashboard in Chromium, 1440×900; session {figures['session']}, {figures['particles']} particles\n")
    print(f"{'':44}{'measured':>12}{'bar':>10}")
    for tab in TABS:
        row = figures[tab]
        print(f"{tab + ': step → new picture, p50 (p90), ms':44}{row['step_p50_ms']:6.0f} ({row['step_p90_ms']:.0f})"
              f"{'≤ ' + format(BARS['step'], '.0f'):>10}")  # fmt: skip
        print(f"{tab + ': pictures/s while playing':44}{row['pictures_per_second']:12.1f}"
              f"{'≥ ' + format(BARS['play'], '.0f'):>10}")  # fmt: skip
    setting = figures["setting"]
    words = "none" if np.isnan(setting) else f"{setting:.0f}"
    print(f"{'h → correction factors of this frame, p50, ms':44}{words:>12}{'≤ ' + format(BARS['setting'], '.0f'):>10}")


def main() -> None:
    """Print a table and, when asked, write the figures as JSON."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--json", type=Path, help="file that the figures are written to")
    parser.add_argument("--frames", type=int, default=400, help="length of the session")
    parser.add_argument("--steps", type=int, default=15, help="steps that are timed in each tab")
    parser.add_argument("--seconds", type=float, default=8.0, help="of playing that are timed in each tab")
    options = parser.parse_args()
    figures = measure(options.frames, options.steps, options.seconds)
    _print(figures)
    if options.json is not None:
        options.json.write_text(json.dumps(figures, indent=1))


if __name__ == "__main__":
    main()
