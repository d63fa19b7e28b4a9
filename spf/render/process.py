"""Starting, asking and stopping the renderer's own process."""

from __future__ import annotations

import contextlib
import pickle
import re
import subprocess
import sys
import threading
import weakref
from collections import deque
from typing import IO, Any, Self

from spf.errors import RenderError, RenderUnavailableError
from spf.render.protocol import OpenGL, Reply, Request

__all__ = ["UNAVAILABLE", "RenderProcess", "probe_opengl"]

LINUX = sys.platform.startswith("linux")

#: What a user reads where a three-dimensional picture should be.
UNAVAILABLE = f"3-D view unavailable: install {'libegl1 and libgl1-mesa-dri' if LINUX else 'an OpenGL driver'}."

#: VTK's window classes to try, in order; "" is the platform's own.
WINDOW_CLASSES = ("vtkEGLRenderWindow", "vtkOSOpenGLRenderWindow") if LINUX else ("",)

TERMINAL_COLOURS = re.compile(r"\x1b\[[0-9;]*m")


class RenderProcess:
    """One running worker; belongs to the thread that asks it.

    Attributes:
        opengl: what draws in it.
    """

    opengl: OpenGL

    def __init__(self, window_class: str) -> None:
        self._popen = subprocess.Popen(
            [sys.executable, "-m", "spf.render.worker", window_class],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
        )
        self._requests, self._replies, complaints = _pipes(self._popen)
        self._complaints: deque[bytes] = deque(maxlen=20)
        listener = threading.Thread(target=self._complaints.extend, args=(complaints,), daemon=True)
        listener.start()
        pipes = (self._requests, self._replies, complaints)
        self._finalizer = weakref.finalize(self, _stop, self._popen, listener, pipes)

    @classmethod
    def start(cls, timeout: float) -> Self:
        """Start a worker with the first window class that draws.

        Args:
            timeout: seconds after which a silent worker is ended.

        Raises:
            RenderUnavailableError: none draws; the note on the error says what VTK said.
        """
        unavailable = RenderUnavailableError(UNAVAILABLE)
        for window_class in WINDOW_CLASSES:
            process = cls(window_class)
            try:
                process.opengl = process._exchange(None, timeout)
                return process
            except _EndedError as end:
                unavailable.add_note("\n".join((f"{window_class}: the process {end}", *end.said)))
        raise unavailable

    @property
    def alive(self) -> bool:
        """Whether the process is running."""
        return self._popen.poll() is None

    def ask(self, request: Request, timeout: float) -> Reply:
        """Return the reply to a request.

        Args:
            request: the picture.
            timeout: seconds after which a silent worker is ended.

        Raises:
            RenderError: the process died, or was silent for too long and was ended.
        """
        try:
            reply: Reply = self._exchange(request, timeout)
        except _EndedError as end:
            lost = RenderError(f"This 3-D picture is lost, its process {end}; the next one starts a new process.")
            for line in end.said:
                lost.add_note(line)
            raise lost from None
        return reply

    def stop(self) -> None:
        """End the process; it is gone when this returns."""
        self._finalizer()

    def _exchange(self, request: Request | None, timeout: float) -> Any:
        watchdog = threading.Timer(timeout, self._popen.kill)
        watchdog.start()
        try:
            if request is not None:
                pickle.dump(request, self._requests, protocol=pickle.HIGHEST_PROTOCOL)
                self._requests.flush()
            return pickle.load(self._replies)
        except (EOFError, OSError, pickle.UnpicklingError):
            silent = watchdog.finished.is_set()
            cause = f"was silent for {timeout:g} s" if silent else f"ended with exit code {self._exit_code()}"
            self.stop()
            said = (TERMINAL_COLOURS.sub("", line.decode(errors="replace")).rstrip() for line in self._complaints)
            raise _EndedError(cause, tuple(said)) from None
        finally:
            watchdog.cancel()

    def _exit_code(self) -> int:
        with contextlib.suppress(subprocess.TimeoutExpired):
            self._popen.wait(1.0)  # it closed its pipes: let it end with the exit code that says why
        self.stop()
        return self._popen.returncode


class _EndedError(Exception):
    """The worker is gone: in half a sentence why, and what it had written to stderr."""

    def __init__(self, cause: str, said: tuple[str, ...]) -> None:
        super().__init__(cause)
        self.said = said


def probe_opengl(timeout: float = 60.0) -> OpenGL:
    """Return what can draw off-screen on this machine, found out in a process of its own.

    Args:
        timeout: seconds.

    Raises:
        RenderUnavailableError: nothing can; the message says what to install.
    """
    process = RenderProcess.start(timeout)
    process.stop()
    return process.opengl


def _pipes(popen: subprocess.Popen[bytes]) -> tuple[IO[bytes], IO[bytes], IO[bytes]]:
    assert popen.stdin is not None
    assert popen.stdout is not None
    assert popen.stderr is not None
    return popen.stdin, popen.stdout, popen.stderr


def _stop(popen: subprocess.Popen[bytes], listener: threading.Thread, pipes: tuple[IO[bytes], ...]) -> None:
    popen.kill()  # it holds nothing that could be lost
    popen.wait()
    listener.join()
    for pipe in pipes:
        # Closing flushes what is left of a request that nobody will read any more; the pipe is closed all the same.
        with contextlib.suppress(BrokenPipeError):
            pipe.close()
