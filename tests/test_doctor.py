"""The doctor's checks: what is there, what is missing, and what to do about it."""

import re
import sys

import pytest

from spf import doctor
from spf.doctor import Check
from spf.errors import RenderUnavailableError
from spf.render import OpenGL


def test_this_python_and_these_packages_are_fine():
    assert doctor.check_python().ok
    packages = {check.name: check for check in doctor.check_packages()}
    assert {"numpy", "numba", "pyvista", "panel", "opencv-python-headless"} <= packages.keys()
    for check in packages.values():
        assert check.ok, check
        assert re.match(r"\d+\.", check.found)
        assert check.advice == ""


def test_another_python_is_refused(monkeypatch):
    monkeypatch.setattr(sys, "version_info", (3, 10, 0, "final", 0))
    check = doctor.check_python()
    assert not check.ok
    assert "3.11" in check.advice


def test_a_package_that_is_missing_is_named(monkeypatch):
    monkeypatch.setattr(doctor.importlib.metadata, "requires", lambda _: ["no-such-thing>=2", "x; extra == 'y'"])
    assert doctor.check_packages() == (Check("no-such-thing", False, "not installed", "run uv sync"),)


@pytest.mark.parametrize(("usable", "advised"), [({0}, True), ({0, 1, 2}, False)])
def test_the_processor_is_what_this_process_may_use(monkeypatch, usable, advised):
    monkeypatch.setattr(doctor.os, "sched_getaffinity", lambda _: usable, raising=False)
    check = doctor.check_processor()
    assert check.ok
    assert check.found.startswith(f"{len(usable)} of ")
    assert bool(check.advice) == advised


def test_numba_is_tried_for_real():
    assert doctor.check_numba() == Check("Compiled kernels", True, "numba compiles")


@pytest.mark.parametrize(
    ("program", "found"),
    [
        ("raise ImportError('no llvmlite')", "no llvmlite"),
        ("import os; os.abort()", "exit code -6"),
        ("import time; time.sleep(60)", "still compiling after 0.5 s"),
    ],
)
def test_a_numba_that_fails_crashes_or_hangs_is_a_failed_check(program, found):
    check = doctor.check_numba(program, timeout=0.5 if "sleep" in program else 60)
    assert not check.ok
    assert found in check.found
    assert "reinstall" in check.advice


def test_opengl_found_and_not_found(monkeypatch):
    monkeypatch.setattr(doctor, "probe_opengl", lambda _: OpenGL("vtkEGLRenderWindow", "llvmpipe"))
    assert doctor.check_opengl() == Check("Off-screen OpenGL", True, "llvmpipe through vtkEGLRenderWindow")

    def nothing(_):
        raise RenderUnavailableError("3-D view unavailable: install something.")

    monkeypatch.setattr(doctor, "probe_opengl", nothing)
    assert doctor.check_opengl() == Check(
        "Off-screen OpenGL", False, "none", "3-D view unavailable: install something."
    )


def test_optional_parts_that_are_absent_are_advice_not_failures(monkeypatch):
    monkeypatch.setattr(doctor.shutil, "which", lambda _: None)
    monkeypatch.setattr(doctor.importlib.util, "find_spec", lambda _: None)
    for check in (doctor.check_browser(), *doctor.check_sensors()):
        assert check.ok
        assert check.found == "not installed"
        assert check.advice


def test_optional_parts_that_are_there_are_named(monkeypatch):
    monkeypatch.setattr(doctor.shutil, "which", lambda name: "/bin/chromium" if name == "chromium" else None)
    monkeypatch.setattr(doctor.importlib.util, "find_spec", lambda name: name == "depthai" or None)
    assert doctor.check_browser() == Check("Browser for tests", True, "/bin/chromium")
    realsense, oak = doctor.check_sensors()
    assert realsense.advice
    assert oak.found.startswith("depthai is installed; connected: ")


def test_cameras_that_are_connected_are_listed_and_drivers_that_crash_are_told(monkeypatch):
    monkeypatch.setattr(doctor.importlib.util, "find_spec", lambda _: True)
    listing = "found = lambda: ['a note of the driver', 'realsense:?serial=7 (D435)']"
    crashing = "import os; os.abort()"
    monkeypatch.setattr(doctor, "SENSOR_LISTS", {"pyrealsense2": listing, "depthai": crashing})
    realsense, oak = doctor.check_sensors()
    assert realsense.found == "pyrealsense2 is installed; connected: realsense:?serial=7 (D435)"
    assert oak.ok
    assert "depthai fails" in oak.found
    assert "reinstall" in oak.advice


def test_sample_sessions(tmp_path):
    missing = doctor.check_sessions(tmp_path)
    assert not missing.ok
    assert missing.advice
    for name in ("wave.mcap", "fist.mcap", "notes.txt"):
        (tmp_path / name).touch()
    assert doctor.check_sessions(tmp_path) == Check("Sample sessions", True, "fist.mcap, wave.mcap")


def test_an_examination_holds_every_check_once(tmp_path, monkeypatch):
    monkeypatch.setattr(doctor, "probe_opengl", lambda _: OpenGL("vtkEGLRenderWindow", "llvmpipe"))
    monkeypatch.setattr(doctor, "check_numba", lambda: Check("Compiled kernels", True, "numba compiles"))
    names = [check.name for check in doctor.examine(tmp_path)]
    assert len(names) == len(set(names))
    for expected in ("Python", "numpy", "Processor", "Compiled kernels", "Off-screen OpenGL", "Sample sessions"):
        assert expected in names


def test_the_table_marks_what_works_what_is_optional_and_what_fails():
    text = doctor.table([Check("A", True, "1"), Check("Long", True, "none", "get it"), Check("B", False, "x", "do y")])
    assert text.splitlines() == ["ok    A     1", "note  Long  none: get it", "FAIL  B     x: do y"]
    assert doctor.table([]) == ""


def test_a_missing_network_is_told_with_what_to_do(monkeypatch: pytest.MonkeyPatch) -> None:
    assert doctor.check_network().ok
    monkeypatch.setattr(doctor, "available_network", lambda: (None, "The network is not there; install it."))
    assert doctor.check_network() == Check(
        "Learned proposal", False, "missing", "The network is not there; install it."
    )
