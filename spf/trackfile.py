"""The track of a run as a Parquet file: one row a frame, poses and joints as named columns."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from numpy.typing import NDArray

from spf.errors import RunError
from spf.frame import JOINT_NAMES
from spf.hand.shape import SHAPE_PARAMETERS
from spf.track import TrackedFrame

__all__ = ["Track", "TrackRow", "joined", "read_track", "row_of", "rows_of", "table_of", "track_of", "write_track"]

Array = NDArray[np.float64]

_JOINTS = tuple(f"joint_{name}_{axis}" for name in JOINT_NAMES for axis in "xyz")
_REFERENCE = tuple(f"reference_{row}{column}" for row in range(3) for column in range(3))
_NUMBERS = ("log_likelihood", "ess", "golden", "overlap", "optimised_share", "evaluations", "seconds")
_SHAPE = tuple(f"shape_{name}" for name in SHAPE_PARAMETERS)
_POSE, _STAGE = "pose_", "seconds_"


@dataclass(frozen=True, eq=False)  # no tuple: its length is the number of frames, not of fields
class Track:
    """What a run found, N frames.

    Attributes:
        frame: (N,) int64 index in the session.
        time: (N,) s since the session's first frame.
        poses: (N, D), metres and radians, relative to ``references``; the last one known while the hand is lost.
        references: (N, 3, 3) R_ref.
        joints: (N, 21, 3) m, of the hand model.
        shape_changes: (N, 9) of the hand in each frame, from the start's shape: see :func:`spf.hand.shape.varied`.
        lost, recovered: (N,) whether the hand is lost in a frame, and whether it was found again in it.
        log_likelihood, ess, golden, overlap, optimised_share, evaluations: (N,) NaN where no filter step was made.
        winner: (N,) proposal that the heaviest particle came from; "" where no filter step was made.
        seconds: (N,) spent on the frame; 0 for frames before the first pose, which no tracker looked at.
        dof_names: D names of the entries of a pose.
        timings: stage → (N,) seconds; NaN in frames without that stage.
    """

    frame: NDArray[np.int64]
    time: Array
    poses: Array
    references: Array
    joints: Array
    shape_changes: Array
    lost: NDArray[np.bool_]
    recovered: NDArray[np.bool_]
    log_likelihood: Array
    ess: Array
    golden: Array
    overlap: Array
    optimised_share: Array
    evaluations: Array
    winner: NDArray[np.str_]
    seconds: Array
    dof_names: tuple[str, ...]
    timings: dict[str, Array]

    def __len__(self) -> int:
        return len(self.frame)


class TrackRow(NamedTuple):
    """What a track keeps of a frame: without the filter's internals, which take up to megabytes.

    Attributes:
        result: of the frame, its info and observation left out.
        optimised_share, evaluations: of its info; NaN where there is none.
        winner: of its info; "" where there is none.
    """

    result: TrackedFrame
    optimised_share: float
    evaluations: float
    winner: str = ""


def row_of(result: TrackedFrame) -> TrackRow:
    """Return what a track keeps of a frame."""
    bare = result._replace(info=None, observation=None)
    if result.info is None:
        return TrackRow(bare, float("nan"), float("nan"))
    return TrackRow(bare, result.info.optimised_share, float(result.info.evaluations), result.info.winner)


def track_of(rows: Sequence[TrackRow], dof_names: tuple[str, ...]) -> Track:
    """Gather the frames of a run."""

    def numbers(values: list[Any]) -> Array:
        return np.array(values, dtype=np.float64)

    results = [row.result for row in rows]
    nan = float("nan")
    stages = sorted({stage for result in results for stage in result.timings})
    count = len(results)
    return Track(
        frame=np.array([result.index for result in results], dtype=np.int64),
        time=numbers([result.time for result in results]),
        poses=numbers([result.pose for result in results]).reshape(count, len(dof_names)),
        references=numbers([result.reference for result in results]).reshape(count, 3, 3),
        joints=numbers([result.joints for result in results]).reshape(count, len(JOINT_NAMES), 3),
        shape_changes=numbers([result.shape_change for result in results]).reshape(count, len(SHAPE_PARAMETERS)),
        lost=np.array([result.lost for result in results], dtype=bool),
        recovered=np.array([result.recovered for result in results], dtype=bool),
        log_likelihood=numbers([result.log_likelihood for result in results]),
        ess=numbers([result.ess for result in results]),
        golden=numbers([result.golden for result in results]),
        overlap=numbers([result.overlap for result in results]),
        optimised_share=numbers([row.optimised_share for row in rows]),
        evaluations=numbers([row.evaluations for row in rows]),
        winner=np.array([row.winner for row in rows], dtype=np.str_),
        seconds=numbers([result.seconds for result in results]),
        dof_names=dof_names,
        timings={stage: numbers([result.timings.get(stage, nan) for result in results]) for stage in stages},
    )


def joined(tracks: Sequence[Track]) -> Track:
    """Return parts of a run, one after the other, as one track; there has to be one at least."""
    stages = sorted({stage for track in tracks for stage in track.timings})

    def stage_of(track: Track, stage: str) -> Array:
        return track.timings.get(stage, np.full(len(track), np.nan))

    arrays = {
        name: np.concatenate([getattr(track, name) for track in tracks])
        for name in (field.name for field in fields(Track))
        if name not in ("dof_names", "timings")
    }
    timings = {stage: np.concatenate([stage_of(track, stage) for track in tracks]) for stage in stages}
    return Track(**arrays, dof_names=tracks[0].dof_names, timings=timings)


def rows_of(track: Track) -> list[TrackRow]:
    """Return the frames of a track: the inverse of :func:`track_of`."""
    rows = []
    for i in range(len(track)):
        timings = {stage: float(values[i]) for stage, values in track.timings.items() if np.isfinite(values[i])}
        likelihood, ess, golden, overlap, seconds = (
            float(getattr(track, name)[i]) for name in ("log_likelihood", "ess", "golden", "overlap", "seconds")
        )
        result = TrackedFrame(
            int(track.frame[i]), float(track.time[i]), track.poses[i], track.references[i], track.joints[i],
            bool(track.lost[i]), bool(track.recovered[i]), likelihood, ess, golden, overlap, seconds, timings, None, None,
            None, track.shape_changes[i],
        )  # fmt: skip
        rows.append(
            TrackRow(result, float(track.optimised_share[i]), float(track.evaluations[i]), str(track.winner[i]))
        )
    return rows


def table_of(track: Track) -> pa.Table:
    """Return a track as a table with named columns, one row a frame."""
    columns: dict[str, Any] = {"frame": track.frame, "time": track.time}
    columns |= {"lost": track.lost, "recovered": track.recovered, "winner": track.winner.tolist()}
    columns |= {name: getattr(track, name) for name in _NUMBERS}
    columns |= {_POSE + name: track.poses[:, i] for i, name in enumerate(track.dof_names)}
    columns |= (
        _split(_REFERENCE, track.references) | _split(_JOINTS, track.joints) | _split(_SHAPE, track.shape_changes)
    )
    columns |= {_STAGE + stage: values for stage, values in track.timings.items()}
    return pa.table(columns)


def write_track(track: Track, path: Path) -> None:
    """Write a track; a reader sees the old file or the whole new one, never a part.

    Raises:
        RunError: the file cannot be written.
    """
    part = path.with_name(path.name + ".part")
    try:
        pq.write_table(table_of(track), part)
        os.replace(part, path)
    except OSError as error:
        raise RunError(f"The track {path} cannot be written: {error.strerror or error}.") from None


def _split(names: tuple[str, ...], values: Array) -> dict[str, Array]:
    flat = values.reshape(len(values), len(names))
    return {name: flat[:, i] for i, name in enumerate(names)}


def read_track(path: Path) -> Track:
    """Read a track.

    Raises:
        RunError: the file is missing, torn or no track.
    """
    try:
        # Read by Python, whose errors carry the system's words, and decoded in this thread: a thread of Arrow's that still
        # holds an object of Python's when the program ends aborts it.
        with pq.ParquetFile(pa.BufferReader(path.read_bytes()), pre_buffer=False) as file:
            table = file.read(use_threads=False)
    except pa.ArrowInvalid:
        raise RunError(f"The track {path} is torn or no Parquet file: track the session again.") from None
    except OSError as error:
        raise RunError(f"The track {path} cannot be read: {error.strerror or error}.") from None
    found = {name: table.column(name).to_numpy() for name in table.column_names}
    dof_names = tuple(name.removeprefix(_POSE) for name in found if name.startswith(_POSE))
    missing = [name for name in ("frame", "time", "lost", *_NUMBERS, *_REFERENCE, *_JOINTS) if name not in found]
    if missing or not dof_names:
        raise RunError(f"The file {path} is no track: it lacks the columns {', '.join(missing[:4]) or _POSE + '…'}.")

    def stacked(names: Sequence[str], *shape: int) -> Array:
        return np.stack([found[name] for name in names], axis=1).reshape(len(table), *shape)

    # Tracks that were written before shapes were refined lack these columns, and those before proposals were counted winners.
    found |= {name: np.zeros(len(table)) for name in _SHAPE if name not in found}
    return Track(
        frame=found["frame"],
        time=found["time"],
        poses=stacked([_POSE + name for name in dof_names], len(dof_names)),
        references=stacked(_REFERENCE, 3, 3),
        joints=stacked(_JOINTS, len(JOINT_NAMES), 3),
        shape_changes=stacked(_SHAPE, len(_SHAPE)),
        lost=found["lost"],
        recovered=found["recovered"],
        **{name: found[name] for name in _NUMBERS},
        winner=np.asarray(found.get("winner", [""] * len(table)), dtype=np.str_),
        dof_names=dof_names,
        timings={name.removeprefix(_STAGE): found[name] for name in found if name.startswith(_STAGE)},
    )
