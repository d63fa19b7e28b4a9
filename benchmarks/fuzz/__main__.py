"""``python -m benchmarks.fuzz``: thousands of damaged recordings of every format, in processes that may crash or hang.

Each format's good recording is made by the tests' makers, that is by the format's own library. Cases run in child
processes with a limit of memory; a case that takes too long, kills its process or takes too much memory is a fault, and
is named with its seed so that ``--format F --seed N --cases 1`` repeats it.
"""

from __future__ import annotations

import argparse
import collections
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

from benchmarks.fuzz.case import read_recording
from benchmarks.fuzz.recordings import RECORDINGS
from benchmarks.fuzz.worker import Worker


def main() -> int:
    """Run the cases and print a table; the exit code is 1 when anything is wrong."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.fuzz", description=__doc__)
    parser.add_argument("--cases", type=int, default=700, help="cases of each format (700: more than 10 000 in all)")
    parser.add_argument("--format", choices=sorted(RECORDINGS), action="append", help="only these")
    parser.add_argument("--seed", type=int, default=0, help="of the first case")
    options = parser.parse_args()
    names = options.format or sorted(RECORDINGS)
    wrong: list[str] = []
    print(f"{'recording':<14}{'cases':>7}{'refused':>9}{'read':>7}{'wrong':>7}{'peak MB':>9}{'slowest s':>11}")
    with tempfile.TemporaryDirectory(prefix="spf-fuzz-") as folder:
        for name in names:
            wrong += _run(name, range(options.seed, options.seed + options.cases), Path(folder))
    print(f"{len(names) * options.cases} cases, {len(wrong)} wrong")
    print("\n".join(wrong))
    return bool(wrong)


def _run(name: str, seeds: range, folder: Path) -> list[str]:
    """Run the cases of one format, print its row and return what was wrong."""
    good = RECORDINGS[name](folder / name / "good", np.random.default_rng(0)).path
    whole = read_recording(good, "no damage")
    wrong = [] if whole.kind == "read" else [f"{name} without damage: {whole.text}"]
    counts = collections.Counter[str]()
    peak = slowest = 0.0
    worker = Worker(good, folder / "case")
    for seed in seeds:
        begun = time.perf_counter()
        outcome, used = worker.run(seed)
        slowest = max(slowest, time.perf_counter() - begun)
        peak = max(peak, used)
        counts[outcome.kind] += 1
        if outcome.kind == "WRONG":
            wrong.append(f"{name} seed {seed}: {outcome.text}")
    worker.close()
    print(
        f"{name:<14}{len(seeds):>7}{counts['refused']:>9}{counts['read']:>7}{counts['WRONG']:>7}"
        f"{peak / 2**20:>9.0f}{slowest:>11.1f}",
        flush=True,
    )
    return wrong


if __name__ == "__main__":
    sys.exit(main())
