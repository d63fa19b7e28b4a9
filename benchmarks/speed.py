"""Speed of the parts and of a whole frame: ``uv run python -m benchmarks.speed [--json PATH]``.

Runs on a synthetic frame, so it needs no data. Times are the least of several repeats in one run; a slope over the number
of iterations leaves out what is paid once per SMD run.
"""

from __future__ import annotations

import argparse
import json
import os
import resource
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from spf.cost.problem import Problem, golden, make_problem
from spf.cost.spheres import digit_spheres
from spf.filters import smart
from spf.filters.step import start_at
from spf.locate import reach_of
from spf.observation import observe
from spf.optimisers.smd import optimise
from spf.parallel import threads
from spf.synthetic import SyntheticSession, SyntheticSettings, synthesise

__all__ = ["main"]


def _best(work: Callable[[], object], repeats: int) -> float:
    """Least time of a piece of work, s, after one run to warm up."""
    work()
    times = []
    for _ in range(repeats):
        began = time.perf_counter()
        work()
        times.append(time.perf_counter() - began)
    return min(times)


def _iteration(problem: Problem, settings: smart.SpfSettings, pose: np.ndarray) -> float:
    """Time of one SMD iteration, s, from the slope between a short and a long run of one round."""
    times = []
    for iterations in (20, 200):
        run = settings.replace(rounds=1, iterations=iterations)
        times.append(_best(partial(optimise, problem, run, np.random.default_rng(0), pose), 30))
    short, long = times
    return (long - short) / 180


def _frame(session: SyntheticSession, settings: smart.SpfSettings, frames: int) -> tuple[float, dict[str, float]]:
    """Median time of a whole frame, s, and of its stages."""
    first = session[0]
    assert first.truth is not None
    assert first.truth.pose is not None
    assert first.truth.orientation is not None
    state = start_at(session.hand, first.truth.pose, first.truth.orientation, -1 / 30, settings.n)
    spheres = digit_spheres(session.hand)
    totals, stages = [], []
    for frame in [session[index] for index in range(frames)]:
        began = time.perf_counter()
        observation = observe(frame, state.estimate[:3], reach_of(session.hand))
        observed = time.perf_counter() - began
        rng = np.random.default_rng(frame.index)
        state, info = smart.step(rng, state, observation, session.hand, settings, spheres=spheres)
        totals.append(time.perf_counter() - began)
        stages.append({"observe": observed, **info.timings})
    return float(np.median(totals)), {name: float(np.median([s[name] for s in stages])) for name in stages[0]}


def measure() -> dict[str, Any]:
    """Measure everything; times in seconds."""
    session = synthesise(SyntheticSettings(motion="open_close", sensor="senz3d", frames=40, seed=1))
    large = synthesise(SyntheticSettings(motion="open_close", sensor="realsense", frames=2, seed=1))
    frame, hand = session[0], session.hand
    assert frame.truth is not None
    assert frame.truth.pose is not None
    place = frame.truth.pose[:3]
    observation = observe(frame, place, reach_of(hand))
    rng = np.random.default_rng(0)
    paper = smart.SpfSettings(points=45, coverage=0.0, data_points=0, collision=0.0)
    default = smart.SpfSettings()
    bare = make_problem(hand, observation, paper, frame.truth.orientation, rng)
    full = make_problem(hand, observation, default, frame.truth.orientation, rng)
    poses = np.repeat(frame.truth.pose[None], 100, axis=0)
    large_frame = large[0]
    assert large_frame.truth is not None
    assert large_frame.truth.pose is not None
    large_place = large_frame.truth.pose[:3]
    whole, stages = _frame(session, default, 40)
    return {
        "smd_iteration_45_points": _iteration(bare, paper, frame.truth.pose),
        "smd_iteration_default": _iteration(full, default, frame.truth.pose),
        "particle": _best(lambda: optimise(full, default, np.random.default_rng(0), frame.truth.pose), 20),
        "golden_comparison": _best(lambda: golden(full, poses), 20) / len(poses),
        "observation_320x240": _best(lambda: observe(frame, place, reach_of(hand)), 20),
        "observation_640x480": _best(lambda: observe(large_frame, large_place, reach_of(large.hand)), 20),
        "frame_n4": whole,
        "stages_n4": stages,
        "frame_by_n": {n: _frame(session, default.replace(n=n), 6)[0] for n in (1, 4, 16, 64, 256)},
        "threads": threads(),
        "peak_memory_mb": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024,
    }


def main() -> None:
    """Print the table; write JSON when asked."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n", maxsplit=1)[0])
    parser.add_argument("--json", type=Path, help="write the figures here")
    parser.add_argument("--threads", type=int, help="threads to use; all cores otherwise")
    arguments = parser.parse_args()
    if arguments.threads:
        os.environ["SPF_THREADS"] = str(arguments.threads)
    figures = measure()
    for name, value in figures.items():
        if isinstance(value, dict):
            print(f"{name}: " + ", ".join(f"{key} {1e3 * part:.2f} ms" for key, part in value.items()))
        elif name in ("threads", "peak_memory_mb"):
            print(f"{name}: {value:.0f}")
        else:
            print(f"{name}: {1e6 * value:.1f} µs" if value < 1e-3 else f"{name}: {1e3 * value:.2f} ms")
    if arguments.json:
        arguments.json.write_text(json.dumps(figures, indent=2) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
