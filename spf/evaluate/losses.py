"""Losses of track, as the tracker noticed them."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

__all__ = ["Losses", "count_losses"]


class Losses(NamedTuple):
    """Losses of a run.

    Attributes:
        losses: times that the hand was held and then lost.
        frames_lost: frames without a hand, those before it was first found included.
        recoveries: losses after which it was found again.
        frames_to_recover: mean number of frames from a loss to the hand being found again; NaN without any.
    """

    losses: int
    frames_lost: int
    recoveries: int
    frames_to_recover: float


def count_losses(lost: NDArray[np.bool_]) -> Losses:
    """Count losses in (N,) flags of the frames that the hand was lost in."""
    flags = np.concatenate([[False], lost, [False]]).astype(np.int8)
    begins, ends = np.flatnonzero(np.diff(flags) == 1), np.flatnonzero(np.diff(flags) == -1)
    held_before, found_after = begins > 0, ends < len(lost)
    lengths = (ends - begins)[held_before & found_after]
    return Losses(
        losses=int(held_before.sum()),
        frames_lost=int(lost.sum()),
        recoveries=len(lengths),
        frames_to_recover=float(lengths.mean()) if len(lengths) else float("nan"),
    )
