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

FRAMES_BY_N = {1: 40, 4: 40, 16: 12, 64: 6, 256: 3}  # frames whose median is taken, for every number of particles


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
    assert frame.truth.orientation is not None
    pose, orientation = frame.truth.pose, frame.truth.orientation
    place = pose[:3]
    observation = observe(frame, place, reach_of(hand))
    rng = np.random.default_rng(0)
    paper = smart.SpfSettings(points=45, coverage=0.0, data_points=0, collision=0.0)
    default = smart.SpfSettings()
    bare = make_problem(hand, observation, paper, orientation, rng)
    full = make_problem(hand, observation, default, orientation, rng)
    poses = np.repeat(pose[None], 100, axis=0)
    large_frame = large[0]
    assert large_frame.truth is not None
    assert large_frame.truth.pose is not None
    large_place = large_frame.truth.pose[:3]
    figures = {
        "smd_iteration_45_points": _iteration(bare, paper, pose),
        "smd_iteration_default": _iteration(full, default, pose),
        "particle": _best(lambda: optimise(full, default, np.random.default_rng(0), pose), 20),
        "golden_comparison": _best(lambda: golden(full, poses), 20) / len(poses),
        "observation_320x240": _best(lambda: observe(frame, place, reach_of(hand)), 20),
        "observation_640x480": _best(lambda: observe(large_frame, large_place, reach_of(large.hand)), 20),
    }
    return {
        **figures,
        "frames": _scaling(session, default),
        "peak_memory_mb": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024,
    }


def _scaling(session: SyntheticSession, settings: smart.SpfSettings) -> list[dict[str, Any]]:
    """Time of a frame and of its stages, s, in all numbers of threads and of particles."""
    rows = []
    most = threads()
    for count in range(1, most + 1):
        os.environ["SPF_THREADS"] = str(count)
        for n, frames in FRAMES_BY_N.items():
            whole, stages = _frame(session, settings.replace(n=n), frames)
            rows.append({"threads": count, "n": n, "frame": whole, "per_particle": whole / n, "stages": stages})
    return rows


def _table(figures: dict[str, Any]) -> str:
    """Lay the figures out: the parts, then a row of milliseconds for every number of threads and particles."""
    lines = [f"{'part':<26}{'µs':>11}"]
    parts = {name: value for name, value in figures.items() if name not in ("frames", "peak_memory_mb")}
    lines += [f"{name:<26}{1e6 * value:>11.1f}" for name, value in parts.items()]
    stages = list(figures["frames"][0]["stages"])
    lines += ["", "ms     threads    N    frame  a particle" + "".join(f"{name:>10}" for name in stages)]
    for row in figures["frames"]:
        cells = "".join(f"{1e3 * row['stages'][name]:>10.2f}" for name in stages)
        lines.append(
            f"{row['threads']:>14}{row['n']:>5}{1e3 * row['frame']:>9.2f}{1e3 * row['per_particle']:>12.2f}{cells}"
        )
    return "\n".join([*lines, "", f"peak memory {figures['peak_memory_mb']:.0f} MB"])


def main() -> None:
    """Print the tables and write JSON."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n", maxsplit=1)[0])
    parser.add_argument("--json", type=Path, default=Path("benchmarks/results/speed.json"), help="file of the figures")
    parser.add_argument("--threads", type=int, help="most threads to use; all cores otherwise")
    arguments = parser.parse_args()
    if arguments.threads:
        os.environ["SPF_THREADS"] = str(arguments.threads)
    figures = measure()
    print(_table(figures))
    arguments.json.parent.mkdir(parents=True, exist_ok=True)
    arguments.json.write_text(json.dumps(figures, indent=2) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
