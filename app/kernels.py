"""The kernels of a server, compiled in a process of their own, so that no page has to wait that needs none."""

from __future__ import annotations

import logging
import subprocess
import sys
import threading
import time

from spf.progress import Report

__all__ = ["Kernels"]

_COMMAND = (sys.executable, "-m", "spf.compiling")
_LOOK = 0.2  # s between two reports while waiting
_log = logging.getLogger(__name__)


class Kernels:
    """Compiles at once, in the background; numba's cache on disk hands the result over.

    Args:
        command: compiles the kernels; tests give another.
    """

    def __init__(self, command: tuple[str, ...] = _COMMAND) -> None:
        self._began = time.monotonic()
        self._done = threading.Event()
        self._closed = False
        # A session of its own: Ctrl-C in the server's terminal is not for it, `close` ends it.
        self._process = subprocess.Popen(
            command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True, start_new_session=True
        )
        threading.Thread(target=self._watch, name="spf-kernels", daemon=True).start()

    def _watch(self) -> None:
        _, said = self._process.communicate()
        if self._process.returncode and not self._closed:
            _log.error("The kernels could not be compiled ahead; the first start will try again:\n%s", said)
        self._done.set()

    @property
    def progress(self) -> str:
        """What is going on, in one line; nothing once the kernels are ready."""
        if self._done.is_set():
            return ""
        return (
            "Loading the kernels; the first time they are compiled, about a minute "
            f"({time.monotonic() - self._began:.0f} s)"
        )

    def wait(self, report: Report) -> None:
        """Return when the kernels are ready; the report may end the waiting by an exception."""
        while not self._done.wait(_LOOK):
            report(self.progress, 0.0)

    def close(self) -> None:
        """End the compiling, if it still goes on."""
        self._closed = True
        self._process.kill()
        self._done.wait()
