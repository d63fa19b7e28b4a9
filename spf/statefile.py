"""States of a run at some of its frames, in one file beside its track: from the nearest one, any frame is tracked again.

The file holds plain arrays only (``numpy.load`` without pickles).
"""

from __future__ import annotations

import os
import zipfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from spf.errors import RunError
from spf.filters.particles import ParticleSet
from spf.filters.step import State
from spf.refine import Refinement
from spf.track import TrackState

__all__ = ["read_states", "write_states"]

_NUMBERS = ("time", "lost", "bad", "fresh", "golden", "missing", "doubts")
_REFINED = ("change", "information", "vector", "candidate", "share", "waited")


def write_states(states: Mapping[int, TrackState], path: Path) -> None:
    """Write the states after some frames (frame → state); a reader sees the old file or the whole new one.

    Raises:
        RunError: the file cannot be written.
    """
    kept = [states[frame] for frame in sorted(states)]
    particles = [state.filter.particles for state in kept]
    arrays: dict[str, NDArray[Any]] = {
        "frame": np.array(sorted(states), dtype=np.int64),
        "count": np.array([len(part.log_weights) for part in particles], dtype=np.int64),
        "histories": np.array([len(state.history) for state in kept], dtype=np.int64),
        "history": np.array([golden for state in kept for golden in state.history], dtype=np.float64),
        "reference": np.array([state.filter.reference for state in kept]),
        "estimate": np.array([state.filter.estimate for state in kept]),
        "time": np.array([state.filter.time for state in kept]),
        "held": np.array([state.held for state in kept]),
    }
    arrays |= {name: np.array([getattr(state, name) for state in kept]) for name in _NUMBERS[1:]}
    arrays |= {name: np.array([getattr(state.refinement, name) for state in kept]) for name in _REFINED}
    arrays["judged"] = np.array([len(state.refinement.gains) for state in kept], dtype=np.int64)
    arrays["gains"] = np.array([gain for state in kept for gain in state.refinement.gains], dtype=np.float64)
    for name in ParticleSet._fields:
        arrays[name] = np.concatenate([getattr(part, name) for part in particles]) if kept else np.empty(0)
    part_file = path.with_name(path.name + ".part")
    try:
        with part_file.open("wb") as file:
            np.savez(file, **arrays)  # type: ignore[arg-type]  # its stub takes them for its own options
        os.replace(part_file, path)
    except OSError as error:
        raise RunError(f"The states {path} cannot be written: {error.strerror or error}.") from None


def read_states(path: Path) -> dict[int, TrackState]:
    """Read the states after some frames (frame → state); none when there is no such file.

    Raises:
        RunError: the file is torn or something else.
    """
    if not path.exists():
        return {}
    try:
        with np.load(path, allow_pickle=False) as file:
            arrays = {name: file[name] for name in file.files}
        return _states_of(arrays)
    except (OSError, ValueError, KeyError, EOFError, zipfile.BadZipFile) as error:
        raise RunError(
            f"The states {path} cannot be read ({error}): delete the file, the track is whole without."
        ) from None


def _states_of(arrays: dict[str, NDArray[Any]]) -> dict[int, TrackState]:
    ends = np.cumsum(arrays["count"])
    histories, gains = _parted(arrays, "history", "histories"), _parted(arrays, "gains", "judged")
    states: dict[int, TrackState] = {}
    for i, frame in enumerate(arrays["frame"]):
        of = slice(int(ends[i] - arrays["count"][i]), int(ends[i]))
        time, lost, bad, fresh, golden, missing, doubts = (arrays[name][i] for name in _NUMBERS)
        particles = ParticleSet(*(arrays[name][of] for name in ParticleSet._fields))
        filter_state = State(particles, arrays["reference"][i], arrays["estimate"][i], float(time))
        change, information, vector, candidate, share, waited = (arrays[name][i] for name in _REFINED)
        refinement = Refinement(change, information, vector, candidate, gains[i], float(share), int(waited))
        states[int(frame)] = TrackState(
            filter_state, bool(lost), histories[i], int(bad), bool(fresh), float(golden), int(missing), arrays["held"][i],
            refinement, int(doubts),
        )  # fmt: skip
    return states


def _parted(arrays: dict[str, NDArray[Any]], values: str, counts: str) -> list[tuple[float, ...]]:
    """Numbers of which each state has so many, one after the other: those of each state."""
    ends = np.cumsum(arrays[counts])[:-1]
    return [tuple(part.tolist()) for part in np.split(arrays[values], ends)]
