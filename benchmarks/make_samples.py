"""Make the bundled sample sessions again: ``uv run python -m benchmarks.make_samples [NAME …] [-o FOLDER]``.

Each is a row of :data:`SAMPLES`; the same row gives the same file content.
"""

from __future__ import annotations

import argparse
from pathlib import Path

from spf.sessions import write_session
from spf.synthetic import SyntheticSettings, synthesise

__all__ = ["SAMPLES", "main"]

#: Settings of the bundled sessions by file name.
SAMPLES: dict[str, SyntheticSettings] = {
    "open-close": SyntheticSettings(
        motion="open_close", sensor="senz3d", clutter="forearm", side="right", speed_mm=9.0, frames=120, seed=1
    ),
    "fast-wave": SyntheticSettings(
        motion="wave", sensor="senz3d", clutter="forearm", side="right", speed_mm=40.0, frames=120, seed=4
    ),
    "turn-and-bend-left": SyntheticSettings(
        motion="turn_and_bend", sensor="kinect2", clutter="body", side="left", speed_mm=9.0, frames=90, seed=3
    ),
}

_BUNDLED = Path(__file__).resolve().parent.parent / "sessions"


def main(arguments: list[str] | None = None) -> None:
    """Write the named samples, or all of them, and print their sizes."""
    parser = argparse.ArgumentParser(description="Make the bundled sample sessions.")
    parser.add_argument("names", nargs="*", metavar="NAME", help=f"which ones: {', '.join(SAMPLES)} (all)")
    parser.add_argument("-o", "--output", type=Path, default=_BUNDLED, help="folder (sessions/)")
    options = parser.parse_args(arguments)
    unknown = [name for name in options.names if name not in SAMPLES]
    if unknown:
        parser.error(f"there is no sample {', '.join(unknown)}; the samples are {', '.join(SAMPLES)}")
    for name in options.names or SAMPLES:
        path = options.output / f"{name}.mcap"
        write_session(synthesise(SAMPLES[name]), path, overwrite=True)
        print(f"{path.name}  {path.stat().st_size / 1e6:.1f} MB")


if __name__ == "__main__":
    main()
