"""The hand of a run, in the shape that it had been refined to, as a file to begin other runs with."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from spf.errors import RunError
from spf.export.pictures import row_of_frame
from spf.export.writing import written_whole
from spf.hand.shape import write_hand_shape
from spf.runs import Run

__all__ = ["write_hand"]


def write_hand(run: Run, path: Path, frame: int | None = None) -> int:
    """Write the shape of the hand in a frame, as :func:`spf.hand.shape.read_hand_shape` reads it.

    Args:
        run: that was kept.
        path: to write to.
        frame: of the session; the last in which the hand was held, when None.

    Returns:
        The frame.

    Raises:
        RunError: the frame was not tracked, the hand was held in none, or the file cannot be written.
    """
    held = np.flatnonzero(~run.track.lost)
    if frame is None and not len(held):
        raise RunError("The hand was held in no frame of this run: choose another run, or calibrate the hand.")
    row = int(held[-1]) if frame is None else row_of_frame(run.track, frame)
    with written_whole(path) as part:
        write_hand_shape(run.shape_at(row), part)
    return int(run.track.frame[row])
