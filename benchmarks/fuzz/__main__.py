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

from benchmarks.fuzz.worker import Worker
from tests.sessions.file_makers import FILE_MAKERS, make_hdf5
from tests.sessions.makers import MAKERS
from tests.sessions.ros_makers import ROS_MAKERS

_RECORDINGS = {**MAKERS, **ROS_MAKERS, **FILE_MAKERS, "arrays-hdf5": make_hdf5}


def main() -> int:
    """Run the cases and print a table; the exit code is 1 when anything is wrong."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.fuzz", description=__doc__)
    parser.add_argument("--cases", type=int, default=700, help="cases of each format (700: more than 10 000 in all)")
    parser.add_argument("--format", choices=sorted(_RECORDINGS), action="append", help="only these")
    parser.add_argument("--seed", type=int, default=0, help="of the first case")
    options = parser.parse_args()
    wrong, total = [], 0
    print(f"{'recording':<14}{'cases':>7}{'refused':>9}{'read':>7}{'wrong':>7}{'peak MB':>9}{'s':>7}")
    with tempfile.TemporaryDirectory(prefix="spf-fuzz-") as folder:
        for name in options.format or sorted(_RECORDINGS):
            good = _RECORDINGS[name](Path(folder) / name / "good", np.random.default_rng(0)).path
            worker, counts, peak, begun = (
                Worker(good, Path(folder) / "case"),
                collections.Counter[str](),
                0.0,
                time.time(),
            )
            for seed in range(options.seed, options.seed + options.cases):
                outcome, used = worker.run(seed)
                counts[outcome.kind] += 1
                peak = max(peak, used)
                if outcome.kind == "WRONG":
                    wrong.append(f"{name} seed {seed}: {outcome.text}")
            worker.close()
            total += options.cases
            print(
                f"{name:<14}{options.cases:>7}{counts['refused']:>9}{counts['read']:>7}{counts['WRONG']:>7}"
                f"{peak / 2**20:>9.0f}{time.time() - begun:>7.0f}",
                flush=True,
            )
    print(f"{total} cases, {len(wrong)} wrong")
    print("\n".join(wrong))
    return bool(wrong)


if __name__ == "__main__":
    sys.exit(main())
