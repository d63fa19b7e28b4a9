"""Many pages, long hours: ``uv run python -m benchmarks.soak [--minutes 10] [--pages 8] [--json PATH]``.

Serves the dashboard and drives Chromium through it in three parts: pages that all step, for minutes; pages that are opened,
stepped and closed one after the other; and one page that tracks hundreds of frames while another one steps. Printed are the
memory of the server, of its renderer and of the browser, how long pages took from a press on Step to the new frame, how long
the server alone took to answer (browsers need most of a small machine), and every error in the server's log.
"""

from __future__ import annotations

import argparse
import json
import os
import re
import shutil
import socket
import subprocess
import sys
import tempfile
import threading
import time
import urllib.request
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import psutil
from playwright.sync_api import Browser, Page, sync_playwright

from spf.sessions import write_session
from spf.synthetic import SyntheticSettings, synthesise

__all__ = ["main"]

ROOT = Path(__file__).resolve().parent.parent
PATIENCE = 300_000  # ms: a first start compiles the kernels
ANSWER = 1.0  # s within which every page has to answer
FAR = 200  # frame that the long run goes to
GONE = 45.0  # s after which Bokeh has dropped the pages that were closed
TROUBLE = re.compile(r"Traceback|\bERROR\b|Exception|exception")

# One page's visitor: steps at a pace of its own that wavers by half, as nobody's visitors step in time with each other, from
# the end back to the start, and notes how long the page took to show each frame.
_VISIT = """([pace, seed]) => {
  let state = Math.imul(seed + 1, 2654435769) >>> 0;
  const even = () => { state = (Math.imul(state, 1664525) + 1013904223) >>> 0; return state / 2 ** 32; };
  const all = (root) => [...root.querySelectorAll('*')].flatMap((e) => [e, ...(e.shadowRoot ? all(e.shadowRoot) : [])]);
  const button = (name) => all(document).find((e) => e.tagName === 'BUTTON' && e.title?.startsWith(name) && !e.disabled);
  const frame = () => all(document).find((e) => e.ariaLabel === 'Frame' && e.role === 'slider')?.ariaValueNow;
  const nap = (ms) => new Promise((done) => setTimeout(done, ms));
  window.answers = []; window.visiting = true; window.steps = 0;
  (async () => {
    while (window.visiting) {
      const step = button('Step');
      const act = step ?? button('Restart');
      if (!act) { await nap(20); continue; }
      const before = frame(), began = performance.now();
      act.click();
      while (frame() === before && performance.now() - began < 30000) await nap(5);
      window.answers.push((performance.now() - began) / 1000);
      window.steps += 1;
      await nap(Math.max(0, pace * 1000 * (0.5 + even()) - (performance.now() - began)));
    }
  })();
}"""


class Probe(threading.Thread):
    """Asks the server for next to nothing, again and again: how long its event loop lets everybody wait."""

    def __init__(self, address: str) -> None:
        super().__init__(daemon=True)
        self._address, self._waits, self._ended = f"{address}/metadata", [0.0], threading.Event()

    def run(self) -> None:
        """Ask until it is stopped."""
        while not self._ended.wait(0.2):
            began = time.monotonic()
            with urllib.request.urlopen(self._address, timeout=120) as answer:
                answer.read()
            self._waits.append(time.monotonic() - began)

    def longest(self) -> float:
        """Take the longest wait, in s, since this was asked last."""
        waits, self._waits = self._waits, [0.0]
        return max(waits)

    def stop(self) -> None:
        """Ask no more."""
        self._ended.set()
        self.join()


class Server(NamedTuple):
    """A dashboard that is served: its address, its process and its log."""

    address: str
    process: psutil.Process
    log: Path
    probe: Probe

    def memory(self) -> dict[str, float]:
        """Memory of the server and of its renderer, and what the browser's processes have for themselves, MB."""
        renderers = [child for child in self.process.children() if "spf.render.worker" in child.cmdline()]
        return {
            "server_mb": self.process.memory_info().rss / 1e6,
            "renderer_mb": sum(child.memory_info().rss for child in renderers) / 1e6,
            "browser_mb": _browser_bytes() / 1e6,
        }

    def errors(self) -> list[str]:
        """Lines of the log that tell of an error."""
        return [line for line in self.log.read_text().splitlines() if TROUBLE.search(line)]


def _browser_bytes() -> int:
    """Memory that nothing else shares, of all processes of the browser; those that end meanwhile have none."""
    total = 0
    for child in psutil.Process().children(recursive=True):
        with suppress(psutil.NoSuchProcess):
            total += child.memory_full_info().uss if "chrom" in child.name() else 0
    return total


@contextmanager
def _served(folder: Path) -> Iterator[Server]:
    """A server of its own, whose runs go into a folder."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port = probe.getsockname()[1]
    command, log = [sys.executable, "-m", "panel", "serve", "app", "--port", str(port)], folder / "log"
    environment = os.environ | {"SPF_SESSIONS": str(folder), "SPF_RUNS": str(folder / "runs")}
    with log.open("w") as said:
        process = subprocess.Popen(command, cwd=ROOT, stdout=said, stderr=subprocess.STDOUT, env=environment)
        address = f"http://localhost:{port}/app"
        try:
            while process.poll() is None:
                try:
                    urllib.request.urlopen(address, timeout=120).close()
                    break
                except OSError:
                    time.sleep(0.2)
            probe = Probe(address)
            probe.start()
            yield Server(address, psutil.Process(process.pid), log, probe)
            probe.stop()
        finally:
            process.terminate()
            process.wait(60)


def _started(browser: Browser, server: Server, session: Path | None = None) -> Page:
    """A page that has started from the truth."""
    page = browser.new_page(viewport={"width": 1440, "height": 900})
    page.set_default_timeout(PATIENCE)
    page.add_init_script("localStorage.setItem('spf-tour', 'seen')")
    page.goto(server.address + (f"?session={session}" if session else ""))
    page.locator(".picture-frame[data-shown]").filter(has=page.get_by_alt_text("Depth image", exact=True)).wait_for()
    page.get_by_label("First pose").click()
    page.locator("li", has_text="Take it from the truth").click()
    page.get_by_role("button", name="Start", exact=True).click()
    page.get_by_role("button", name="Step", exact=True).and_(page.locator(":enabled")).wait_for()
    return page


def _answers(page: Page) -> list[float]:
    """Take the seconds that a page has taken to answer since this was asked last."""
    return page.evaluate("() => window.answers.splice(0)")  # type: ignore[no-any-return]


def _of(answers: list[float]) -> dict[str, float]:
    if not answers:
        return {"steps": 0, "p50_s": float("nan"), "p99_s": float("nan"), "longest_s": float("nan")}
    p50, p99 = np.percentile(answers, [50, 99])
    return {"steps": len(answers), "p50_s": float(p50), "p99_s": float(p99), "longest_s": max(answers)}


def stepping(browser: Browser, server: Server, pages: int, minutes: float, pace: float) -> list[dict[str, float]]:
    """Have pages step at once; memory and answers of each minute, the first being the one of warming up."""
    opened = [_started(browser, server) for _ in range(pages)]
    for number, page in enumerate(opened):
        page.evaluate(_VISIT, [pace, number])
    server.probe.longest()
    rows = []
    for minute in range(round(minutes)):
        opened[0].wait_for_timeout(60_000)
        answers = [answer for page in opened for answer in _answers(page)]
        rows.append(
            {"minute": minute + 1, **server.memory(), "server_longest_s": server.probe.longest(), **_of(answers)}
        )
        _print_row(rows[-1])
    for page in opened:
        page.close()
    return rows


def visits(browser: Browser, server: Server, count: int) -> list[dict[str, float]]:
    """Open pages one after the other, step a little and close them; memory after every fifth, and when all are gone."""
    rows = []
    for number in range(1, count + 1):
        page = _started(browser, server)
        page.evaluate(_VISIT, [0.0, number])
        page.wait_for_function("() => window.steps >= 3")
        page.close()
        if number % 5 == 0:
            rows.append({"visits": number, **server.memory()})
            _print_row(rows[-1])
    if count:
        time.sleep(GONE)
        rows.append({"visits": count, **server.memory()})
        _print_row(rows[-1])
    return rows


def long_run(browser: Browser, server: Server, session: Path, pace: float) -> dict[str, Any]:
    """Have one page track to a far frame while another steps; how the other answered meanwhile, and how long it took."""
    busy, other = _started(browser, server, session), _started(browser, server)
    slider = busy.get_by_role("slider", name="Frame", exact=True)
    slider.focus()
    for frame in range(10, FAR + 1, 10):
        busy.keyboard.press("Shift+ArrowRight")
        busy.wait_for_function(
            "([line, frame]) => line.ariaValueNow === frame", arg=[slider.element_handle(), str(frame)]
        )
    began = time.monotonic()
    busy.get_by_role("button", name="Track to here", exact=True).click()
    busy.get_by_text(re.compile(rf"Tracking to frame {FAR}")).first.wait_for()
    other.evaluate(_VISIT, [pace, 0])
    server.probe.longest()
    busy.get_by_text(re.compile(rf"tracked to {FAR}")).first.wait_for()
    took = time.monotonic() - began
    found = {"frames": FAR, "took_s": took, "server_longest_s": server.probe.longest(), **_of(_answers(other))}
    busy.close()
    other.close()
    return found


def measure(options: argparse.Namespace) -> dict[str, Any]:
    """Measure everything."""
    with tempfile.TemporaryDirectory() as name, sync_playwright() as playwright:
        folder = Path(name)
        session = folder / "long.mcap"
        write_session(
            synthesise(SyntheticSettings(motion="open_close", sensor="kinect2", frames=FAR + 20, seed=1)), session
        )
        chromium = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))))
        browser = playwright.chromium.launch(executable_path=chromium, args=["--no-sandbox", "--disable-gpu"])
        with _served(folder) as server:
            figures: dict[str, Any] = {"pages": options.pages, "pace_s": options.pace}
            print(f"{options.pages} pages step every {options.pace:g} s")
            figures["stepping"] = stepping(browser, server, options.pages, options.minutes, options.pace)
            print(f"\n{options.visits} pages are opened, stepped and closed one after the other")
            figures["visits"] = visits(browser, server, options.visits)
            print(f"\nOne page steps while another tracks {FAR} frames")
            figures["long_run"] = long_run(browser, server, session, options.pace)
            _print_row(figures["long_run"])
            figures["errors"] = server.errors()
        browser.close()
    return figures


def _print_row(row: dict[str, Any]) -> None:
    print("   ".join(f"{name} {value:.3g}" if name.endswith("_s") else f"{name} {value:.0f}" for name, value in row.items()),
          flush=True)  # fmt: skip


def _print_sum(figures: dict[str, Any]) -> None:
    longest = max(row["longest_s"] for row in [*figures["stepping"], figures["long_run"]])
    print(
        f"\nThe longest answer took {longest:.2f} s (bar: {ANSWER:g} s); errors in the server's log: {len(figures['errors'])}"
    )
    for line in figures["errors"]:
        print(f"   {line}")


def main() -> None:
    """Print what was measured and, when asked, write it as JSON; ends with 1 if the server's log tells of an error."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--json", type=Path, help="file that the figures are written to")
    parser.add_argument("--pages", type=int, default=8, help="that step at once")
    parser.add_argument("--minutes", type=float, default=10, help="that they step")
    parser.add_argument("--pace", type=float, default=4.0, help="mean seconds from one step of a page to its next")
    parser.add_argument("--visits", type=int, default=20, help="pages that are opened and closed")
    options = parser.parse_args()
    figures = measure(options)
    _print_sum(figures)
    if options.json is not None:
        options.json.write_text(json.dumps(figures, indent=1))
    sys.exit(bool(figures["errors"]))


if __name__ == "__main__":
    main()
