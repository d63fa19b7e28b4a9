"""A process that runs cases, with limits of time and memory, and is started again when it dies."""

from __future__ import annotations

import multiprocessing as mp
import os
import resource
import sys
from multiprocessing.connection import Connection
from pathlib import Path

from benchmarks.fuzz.case import Outcome, run_case

__all__ = ["Worker"]

_MEMORY = 3 * 2**30  # bytes of address space that a process may take beyond what it has when it starts
_RESIDENT = 1.0 * 2**30  # bytes that it may really use
_SLOW = 30.0  # s of a case


def _work(connection: Connection, good: Path, work: Path, said: Path) -> None:
    """Run the cases that are asked for; what the libraries say of each goes to a file, not among the results."""
    os.dup2(os.open(said, os.O_WRONLY | os.O_CREAT | os.O_APPEND), sys.stderr.fileno())
    used = int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
    resource.setrlimit(resource.RLIMIT_AS, (used + _MEMORY, used + _MEMORY))
    while True:
        seed = connection.recv()
        if seed is None:
            return
        os.ftruncate(sys.stderr.fileno(), 0)
        outcome = run_case(good, seed, work)
        peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024
        connection.send((outcome, peak))


class Worker:
    """A process that runs the cases of one recording, started again when it dies."""

    def __init__(self, good: Path, work: Path) -> None:
        self._said = work.with_name(f"{work.name}.log")
        self._arguments = (good, work, self._said)
        self._start()

    def _start(self) -> None:
        self._mine, theirs = mp.get_context("spawn").Pipe()
        self._process = mp.get_context("spawn").Process(target=_work, args=(theirs, *self._arguments), daemon=True)
        self._process.start()
        theirs.close()

    def run(self, seed: int) -> tuple[Outcome, float]:
        """Run a case; returns what came of it and the most memory, in bytes, that the process has used."""
        self._mine.send(seed)
        try:
            if not self._mine.poll(_SLOW):
                self._process.kill()
                raise EOFError
            outcome, peak = self._mine.recv()
        except (EOFError, ConnectionResetError):
            self._process.join()
            code, last = self._process.exitcode, self._said.read_text(errors="replace").strip().rpartition("\n")[2]
            self._start()
            crashed = f"crashed (exit code {code}) {last}".strip()
            return Outcome("WRONG", f"took more than {_SLOW:g} s" if code == -9 else crashed), 0.0
        if peak > _RESIDENT:
            return Outcome("WRONG", f"took {peak / 2**20:.0f} MB"), peak
        return outcome, peak

    def close(self) -> None:
        """End the process."""
        self._mine.send(None)
        self._process.join()
