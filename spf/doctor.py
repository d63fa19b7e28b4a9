"""What of this machine works for the project, and what to install: one check a function, each a value to print.

What may crash (OpenGL, compiled code) is tried in a process of its own.
"""

from __future__ import annotations

import importlib.metadata
import importlib.util
import os
import platform
import re
import shutil
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

from spf.errors import RenderUnavailableError
from spf.learned.network import available_network
from spf.render import probe_opengl

__all__ = [
    "Check",
    "check_browser",
    "check_numba",
    "check_opengl",
    "check_packages",
    "check_processor",
    "check_python",
    "check_sensors",
    "check_sessions",
    "examine",
    "table",
]

DISTRIBUTION = "smart-particle-filter"
BROWSERS = ("chromium", "chromium-browser", "google-chrome", "chrome")
SENSORS = (("RealSense cameras", "pyrealsense2", "pyrealsense2 libusb-package"), ("OAK cameras", "depthai", "depthai"))
#: What makes ``found()``, the URIs of the cameras that a driver sees.
SENSOR_LISTS = {
    "pyrealsense2": "from spf.live.realsense import list_realsense as found",
    "depthai": "from spf.live.oak import list_oak as found",
}

#: Compiles one function and compares it with Python's own answer.
NUMBA_TRIAL = """
from numba import njit
def root(x):
    return x ** 0.5 + 1
assert njit(nogil=True)(root)(9.0) == root(9.0) == 4.0
"""


class Check(NamedTuple):
    """One finding.

    Attributes:
        name: what was looked at.
        ok: False when something the project needs is missing or broken; optional parts that are absent are ok.
        found: what there is.
        advice: what to do, or "".
    """

    name: str
    ok: bool
    found: str
    advice: str = ""


def check_python() -> Check:
    """Return whether this Python is one that the project supports (3.11 to 3.13)."""
    supported = (3, 11) <= sys.version_info[:2] <= (3, 13)
    found = f"{platform.python_version()} on {platform.system()} {platform.machine()}"
    return Check("Python", supported, found, "" if supported else "use Python 3.11, 3.12 or 3.13")


def check_packages(distribution: str = DISTRIBUTION) -> tuple[Check, ...]:
    """Return one check for each package that the distribution depends on, extras left out."""
    requirements = importlib.metadata.requires(distribution) or []
    names = sorted(re.split(r"[^\w.-]", text)[0] for text in requirements if "extra ==" not in text)
    return tuple(_package(name) for name in names)


def check_processor() -> Check:
    """Return how many cores particles can be spread over."""
    threads = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    found = f"{threads} of {os.cpu_count()} threads usable"
    return Check("Processor", True, found, "" if threads > 1 else "particles run one after the other on a single core")


def check_numba(program: str = NUMBA_TRIAL, timeout: float = 120.0) -> Check:
    """Return whether numba compiles on this machine, tried in a child process.

    Args:
        program: Python source that fails when numba does not work.
        timeout: seconds.
    """
    advice = "reinstall numba and llvmlite (uv sync --reinstall-package numba --reinstall-package llvmlite)"
    try:
        trial = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, timeout=timeout)
    except subprocess.TimeoutExpired:
        return Check("Compiled kernels", False, f"numba was still compiling after {timeout:g} s", advice)
    if trial.returncode == 0:
        return Check("Compiled kernels", True, "numba compiles")
    last = (trial.stderr.strip() or f"exit code {trial.returncode}").splitlines()[-1]
    return Check("Compiled kernels", False, f"numba fails: {last}", advice)


def check_network() -> Check:
    """Return whether the learned proposal is there and runs."""
    network, missing = available_network()
    if network is None:
        return Check("Learned proposal", False, "missing", missing)
    return Check("Learned proposal", True, f"{network.about.get('samples_seen', 0) / 1e6:.1f} million samples")


def check_opengl(timeout: float = 60.0) -> Check:
    """Return what draws three-dimensional pictures off-screen, tried in a child process: EGL, then OSMesa."""
    try:
        opengl = probe_opengl(timeout)
    except RenderUnavailableError as error:
        return Check("Off-screen OpenGL", False, "none", str(error))
    return Check("Off-screen OpenGL", True, f"{opengl.driver} through {opengl.window}")


def check_browser() -> Check:
    """Return the browser that the dashboard's tests drive; only tests need one."""
    path = next(filter(None, map(shutil.which, BROWSERS)), None)
    if path is None:
        return Check("Browser for tests", True, "not installed", "only for the dashboard's tests: install chromium")
    return Check("Browser for tests", True, path)


def check_sensors(timeout: float = 30.0) -> tuple[Check, ...]:
    """Return one check a family of live sensors: whether its package is there, and which cameras it sees; all optional.

    Drivers are asked in a child process, which they may crash.

    Args:
        timeout: seconds.
    """
    return tuple(
        _cameras(name, module, timeout)
        if importlib.util.find_spec(module)
        else Check(name, True, "not installed", f"only for live capture: uv pip install {packages}")
        for name, module, packages in SENSORS
    )


def _cameras(name: str, module: str, timeout: float) -> Check:
    program = f"{SENSOR_LISTS[module]}; print('\\n'.join(found()))"
    try:
        trial = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, timeout=timeout)
    except subprocess.TimeoutExpired:
        return Check(name, True, f"{module} did not answer within {timeout:g} s", "unplug the cameras and plug them in")
    if trial.returncode != 0:
        last = (trial.stderr.strip() or f"exit code {trial.returncode}").splitlines()[-1]
        return Check(name, True, f"{module} fails: {last}", "reinstall it; live capture with it does not work")
    found = [line for line in trial.stdout.splitlines() if ":?serial=" in line]
    return Check(name, True, f"{module} is installed; connected: {'; '.join(found) or 'none'}")


def check_sessions(folder: Path | None = None) -> Check:
    """Return the sample sessions that come with the project.

    Args:
        folder: where they are; by default ``sessions`` of the checkout.
    """
    where = Path(__file__).resolve().parent.parent / "sessions" if folder is None else folder
    names = sorted(path.name for path in where.glob("*.mcap"))
    if not names:
        advice = "run from a checkout of the project, or name a session of your own"
        return Check("Sample sessions", False, "none", advice)
    return Check("Sample sessions", True, ", ".join(names))


def examine(sessions: Path | None = None) -> tuple[Check, ...]:
    """Return all checks; takes some seconds.

    Args:
        sessions: folder of the sample sessions; by default that of the checkout.
    """
    return (
        check_python(),
        *check_packages(),
        check_processor(),
        check_numba(),
        check_network(),
        check_opengl(),
        check_sessions(sessions),
        check_browser(),
        *check_sensors(),
    )


def table(checks: Sequence[Check]) -> str:
    """Return checks as lines of plain text: ``ok`` works, ``note`` is optional and absent, ``FAIL`` is needed."""
    width = max((len(check.name) for check in checks), default=0)
    lines = []
    for check in checks:
        mark = "FAIL" if not check.ok else "note" if check.advice else "ok"
        lines.append(f"{mark:<4}  {check.name:<{width}}  {check.found}" + (f": {check.advice}" if check.advice else ""))
    return "\n".join(lines)


def _package(name: str) -> Check:
    try:
        return Check(name, True, importlib.metadata.version(name))
    except importlib.metadata.PackageNotFoundError:
        return Check(name, False, "not installed", "run uv sync")
