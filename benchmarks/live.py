"""A virtual RealSense camera, tracked and recorded at once: frames lost from the recording, memory, latency.

librealsense's software device gives a synthetic hand at 30 frames a second, there and back again for ever; it goes through the
live source, the sensor thread, the recorder and the tracker as a camera's frames do. What is stated is what the recorder, the
system and the clocks say; the recording is opened afterwards and its frames are compared with the source.

    uv run python -m benchmarks.live
"""

from __future__ import annotations

import argparse
import json
import os
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.virtual_realsense import VirtualRealSense
from spf.live import Feed
from spf.live.tracking import Request, find_live_start, follow
from spf.sessions import Session, open_session
from spf.synthetic import SyntheticSettings, synthesise
from spf.trackers import make_settings

_RATE = 30
_SAMPLED_EVERY = 1.0  # s between looks at the memory


def resident_mb() -> float:
    """Return the memory of this process, MB."""
    pages = int(Path("/proc/self/statm").read_text().split()[1])
    return pages * os.sysconf("SC_PAGE_SIZE") / 1e6


def measure(seconds: float, session: Session, raw: list[Any], path: Path, preset: str) -> dict[str, Any]:
    """Track and record the virtual camera from when its hand was found on, and return the figures."""
    request = Request("spf", preset, make_settings("spf", preset, {}), side=session.side)
    latencies, memory, lost, dropped = [], [], 0, 0
    with VirtualRealSense(session.camera, _RATE, depth_unit=session.depth_unit) as camera:
        feed = Feed(camera.play(raw).source())
        feed.record(path)
        with feed:
            feed.recording_began()
            began = time.monotonic()
            start = find_live_start(feed, request, lambda text, _share: print(text, file=sys.stderr))
            assert start is not None
            found = time.monotonic()
            looked = 0.0
            for tracked in follow(feed, request, start, lambda: time.monotonic() - found > seconds):
                latencies.append(tracked.latency)
                dropped += tracked.dropped
                lost += tracked.result.lost
                now = time.monotonic()
                if now - looked > _SAMPLED_EVERY:
                    looked = now
                    memory.append((now - found, resident_mb()))
            state = feed.state
            recording = feed.stop_recording()
    assert recording is not None
    ms = np.array(latencies) * 1e3
    half = len(memory) // 4  # the first quarter warms up: caches, the network's buffers
    slope = np.polyfit(*np.array(memory[half:]).T, 1)[0] * 60 if len(memory) > 8 else float("nan")
    return {
        "seconds": round(time.monotonic() - found, 1),
        "start_found_after_s": round(found - began, 1),
        "captured": state.taken,
        "missing_from_sensor": state.missing,
        "recorded": recording.frames,
        "lost_from_recording": state.taken - recording.frames,
        "recording_wrong": wrong_frames(path, raw),
        "tracked": len(ms),
        "dropped_by_tracker": dropped,
        "hand_lost_in": int(lost),
        "latency_ms": {f"p{p}": round(float(np.percentile(ms, p)), 1) for p in (50, 90, 95, 99)},
        "latency_ms_max": round(float(ms.max()), 1),
        "memory_mb": {
            "first": round(memory[0][1]),
            "last": round(memory[-1][1]),
            "most": round(max(m for _, m in memory)),
        },
        "memory_growth_mb_per_minute": round(float(slope), 2),
    }


def wrong_frames(path: Path, raw: list[Any]) -> int:
    """Return how many frames of the recording are not the source's, in the source's order."""
    there_and_back = [*raw, *raw[-2:0:-1]]
    with open_session(path) as recorded:
        first = recorded.raw_depth(0)
        shift = next(i for i, image in enumerate(there_and_back) if np.array_equal(first, image))
        return sum(
            not np.array_equal(recorded.raw_depth(i), there_and_back[(i + shift) % len(there_and_back)])
            for i in range(len(recorded))
        )


def main() -> int:
    """Run the benchmark; exit code 1 if a frame is missing from the recording or differs."""
    parser = argparse.ArgumentParser(description="A virtual RealSense, tracked and recorded at once.")
    parser.add_argument("--seconds", type=float, default=180.0, help="of tracking, after the hand was found")
    parser.add_argument("--sensor", default="senz3d", help="model of the virtual camera's depth")
    parser.add_argument("--speed", type=float, default=4.0, help="mean motion of the joints a frame, mm")
    parser.add_argument("--preset", default="default")
    parser.add_argument("--json", type=Path, help="write the figures there")
    options = parser.parse_args()
    settings = SyntheticSettings().replace(frames=150, speed_mm=options.speed, sensor=options.sensor)
    session = synthesise(settings)
    raw = [session.raw_depth(index) for index in range(len(session))]
    with tempfile.TemporaryDirectory() as folder:
        figures = measure(options.seconds, session, raw, Path(folder) / "live.mcap", options.preset)
    figures = {"image": [session.camera.width, session.camera.height], "frames_per_second": _RATE, **figures}
    for name, value in figures.items():
        print(f"{name:<28} {value}")
    if options.json is not None:
        options.json.write_text(json.dumps(figures, indent=2) + "\n", encoding="utf-8")
    return int(figures["lost_from_recording"] > 0 or figures["recording_wrong"] > 0)


if __name__ == "__main__":
    sys.exit(main())
