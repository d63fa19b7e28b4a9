"""The renderer's own process: it may die, hang or find no OpenGL, and the user reads one sentence."""

import os
import signal
import subprocess
import sys

import psutil
import pytest
from numpy.testing import assert_allclose

from spf.errors import RenderError, RenderUnavailableError
from spf.render import Renderer, Scene, probe_opengl
from spf.render.process import RenderProcess
from spf.render.protocol import Request
from tests.render.conftest import METRES_A_PIXEL, SIZE, VIEW, centre_of, drawn, sphere

posix = pytest.mark.skipif(os.name != "posix", reason="stops a process with POSIX signals")
SCENE = Scene(meshes=(sphere((0.02, 0.0, 0.5)),))


def workers():
    """The renderers' processes that this one has started."""
    children = psutil.Process().children()
    return {child for child in children if any("spf.render.worker" in part for part in child.cmdline())}


@posix
def test_the_process_is_killed_and_the_renderer_goes_on(renderer, caplog):
    others = workers()
    with Renderer() as mortal:
        assert drawn(mortal.picture(SCENE, VIEW, SIZE)).any()

        (worker,) = workers() - others
        worker.suspend()
        lost = mortal.submit(SCENE, VIEW, SIZE)
        worker.kill()
        sentence = (
            r"^This 3-D picture is lost, its process ended with exit code -9; the next one starts a new process\.$"
        )
        with pytest.raises(RenderError, match=sentence):
            lost.result()
        assert_allclose(centre_of(mortal.picture(SCENE, VIEW, SIZE)), [0.02, 0], atol=METRES_A_PIXEL)

        (worker,) = workers() - others
        worker.kill()
        worker.wait()
        assert drawn(mortal.picture(SCENE, VIEW, SIZE)).any()
        assert "ended between two pictures; starting a new one" in caplog.text

        (worker,) = workers() - others
        mortal.close()
        mortal.close()
        assert not worker.is_running()
        with pytest.raises(RenderError, match="closed"):
            mortal.submit(SCENE, VIEW, SIZE)
    assert workers() == others


@posix
def test_ctrl_c_does_not_reach_the_process(renderer):
    renderer.picture(SCENE, VIEW, SIZE)
    before = workers()
    assert before
    for worker in before:
        worker.send_signal(signal.SIGINT)
    assert drawn(renderer.picture(SCENE, VIEW, SIZE)).any()
    assert workers() == before


@posix
def test_a_process_that_hangs_is_ended(renderer):
    others = workers()
    process = RenderProcess.start(timeout=60)
    (worker,) = workers() - others
    worker.suspend()
    with pytest.raises(RenderError, match=r"its process was silent for 0\.2 s"):
        process.ask(Request(SCENE, VIEW, SIZE, "rgb", 80, False), timeout=0.2)
    assert not process.alive
    assert workers() == others


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="hides Linux's OpenGL libraries")
def test_without_opengl_every_picture_fails_with_the_same_sentence(tmp_path, monkeypatch):
    for name in ("libOSMesa.so", "libOSMesa.so.6", "libOSMesa.so.8"):
        (tmp_path / name).touch()  # not a library: hides the real one
    monkeypatch.setenv("LD_LIBRARY_PATH", str(tmp_path))
    monkeypatch.setenv("__EGL_VENDOR_LIBRARY_DIRS", str(tmp_path))
    monkeypatch.delenv("DISPLAY", raising=False)
    sentence = "3-D view unavailable: install libegl1 and libgl1-mesa-dri."
    others = workers()
    with Renderer() as blind:
        for ask in (blind.picture, blind.jpeg):
            with pytest.raises(RenderUnavailableError) as error:
                ask(SCENE, VIEW, SIZE)
            assert str(error.value) == sentence
            assert "vtkOSOpenGLRenderWindow" in "".join(error.value.__notes__)
        with pytest.raises(RenderUnavailableError, match="3-D view unavailable"):
            blind.opengl().result()
        assert workers() == others


def test_the_probe_names_what_draws_and_leaves_nothing_running(renderer):
    before = workers()
    opengl = probe_opengl()
    assert opengl == renderer.opengl().result()
    assert opengl.window.startswith("vtk")
    assert opengl.driver != "unknown"
    assert workers() == before


def test_the_server_s_own_process_never_loads_vtk():
    program = "import sys, spf.render; print([n for n in sys.modules if n.split('.')[0] in ('pyvista', 'vtkmodules')])"
    run = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert run.stdout.strip() == "[]"
