"""kill -9 at random moments while recording: is every acknowledged frame readable?

A child process records ``replay:SESSION`` and writes the index of each frame that was acknowledged; it is killed after a
random time, the file is opened, and each acknowledged frame is compared with what the source gave, bit by bit.

    uv run python -m benchmarks.kills
"""

from __future__ import annotations

import argparse
import os
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import NamedTuple

import numpy as np

from spf.live import Feed, open_live
from spf.sessions import open_session

_LONGEST = 3.0  # s of recording after which it is killed at the latest
_SPEED = 4  # times the session's own pace: more frames a second, more chances to tear one


class Kill(NamedTuple):
    """What a killed recording left.

    Attributes:
        seconds: after the first frame until the kill.
        acknowledged: frames that the recorder said were safe.
        readable: frames that the file has.
        wrong: acknowledged frames that are missing or differ from the source.
        told: what opening the file says.
    """

    seconds: float
    acknowledged: int
    readable: int
    wrong: int
    told: str


def record_until_killed(source: str, path: Path) -> None:
    """Record for ever and write each acknowledged index on stdout."""

    def acknowledge(index: int) -> None:
        os.write(1, f"{index}\n".encode())  # unbuffered: what was said before the kill was said

    feed = Feed(open_live(f"replay:{source}?loop=1&speed={_SPEED}"))
    feed.record(path, acknowledge=acknowledge)  # before it starts: from the very first frame on
    with feed:
        while True:
            time.sleep(1)


def kill_once(source: str, path: Path, seconds: float) -> Kill:
    """Start a recording, kill it some seconds after its first frame, and look at what is left."""
    command = [sys.executable, "-m", "benchmarks.kills", source, "--record-to", str(path)]
    with subprocess.Popen(command, stdout=subprocess.PIPE) as child:
        assert child.stdout is not None
        first = child.stdout.readline()
        time.sleep(seconds)
        os.kill(child.pid, signal.SIGKILL)
        said = first + child.stdout.read()
    acknowledged = [int(line) for line in said.split(b"\n")[:-1]]
    made, left = open_session(source), open_session(path)
    wrong = sum(
        index >= len(left) or not np.array_equal(left.raw_depth(index), made.raw_depth(index % len(made)))
        for index in acknowledged
    )
    return Kill(seconds, len(acknowledged), len(left), wrong, left.warnings[0] if left.warnings else "")


def main() -> int:
    """Run the benchmark; exit code 1 if an acknowledged frame was lost."""
    parser = argparse.ArgumentParser(description="kill -9 while recording: is every acknowledged frame readable?")
    parser.add_argument("source", nargs="?", default="sessions/open-close.mcap", help="session that is replayed")
    parser.add_argument("--kills", type=int, default=20)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--record-to", type=Path, help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.record_to is not None:
        record_until_killed(options.source, options.record_to)
    rng = np.random.default_rng(options.seed)
    print(f"{'kill':>4} {'after s':>8} {'acknowledged':>13} {'readable':>9} {'wrong':>6}")
    lost = 0
    with tempfile.TemporaryDirectory() as folder:
        for number in range(options.kills):
            path = Path(folder) / f"{number}.mcap"
            kill = kill_once(options.source, path, float(rng.uniform(0, _LONGEST)))
            lost += kill.wrong
            print(
                f"{number:>4} {kill.seconds:>8.2f} {kill.acknowledged:>13} {kill.readable:>9} {kill.wrong:>6}  {kill.told}"
            )
            path.unlink()
    print(f"{lost} acknowledged frames were lost in {options.kills} kills.")
    return int(lost > 0)


if __name__ == "__main__":
    sys.exit(main())
