"""A stated focal length that cannot be: told by the size of the hand that it shows, and by how well a hand explains the depth.

Lateral sizes grow with 1/f, depths do not. A focal length that is too short shows a hand that is too large *and* too flat, so
that no hand explains the depth well; with the true one both are mended. The factor between the two is called the lens here.
A recording whose hand is of a believable size is never doubted: with a flat hand the depth alone tells little.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import overload

import numpy as np
from numpy.typing import NDArray

from spf.frame import Frame

__all__ = ["Through", "as_seen", "as_stated", "is_believable", "lens_of", "lenses_for", "seen_through", "unlikelihood"]

Array = NDArray[np.float64]
_LENGTH, _SPREAD = 0.187, 0.012  # m, from the wrist to the tip of the middle finger: adults' hands
_RARE = 2.0  # deviations
_BELIEVABLE = 0.222  # m, longer than nearly all of them
_TRIED = (0.205, 0.19, 0.175, 0.16)  # m that the tried lenses give the hand
_TRUST = 6.0  # nats: one recording in four hundred states a wrong focal length
_AS_GOOD = 0.05  # share by which a golden energy may be higher and weigh 1/e


def seen_through(frame: Frame, lens: float) -> Frame:
    """Return a frame as taken by a camera whose focal lengths are ``lens`` times the stated ones, its truth with it."""
    if lens == 1.0:
        return frame
    camera = frame.camera._replace(fx=frame.camera.fx * lens, fy=frame.camera.fy * lens)
    truth = frame.truth
    if truth is not None:
        truth = truth._replace(joints=as_seen(truth.joints, lens), pose=None, orientation=None)
    return frame._replace(camera=camera, truth=truth)


def as_stated(points: Array, lens: float) -> Array:
    """Return where the stated camera puts points (…, 3) that were found through a lens: in the same pixels and depths."""
    return points * _stretch(lens)


def as_seen(points: Array, lens: float) -> Array:
    """Return where a lens shows points (…, 3) that are given in the stated camera; undoes :func:`as_stated`."""
    return points / _stretch(lens)


def _stretch(lens: float) -> Array:
    return np.array([lens, lens, 1.0])


class Through(Sequence[Frame]):
    """Frames seen through a lens.

    Args:
        frames: as they are stated.
        lens: factor on their focal lengths.
    """

    def __init__(self, frames: Sequence[Frame], lens: float) -> None:
        self._frames, self._lens = frames, lens

    def __len__(self) -> int:
        return len(self._frames)

    @overload
    def __getitem__(self, index: int) -> Frame: ...

    @overload
    def __getitem__(self, index: slice) -> Through: ...

    def __getitem__(self, index: int | slice) -> Frame | Through:
        if isinstance(index, slice):
            return Through(self._frames[index], self._lens)
        return seen_through(self._frames[index], self._lens)


def is_believable(length: float) -> bool:
    """Whether a hand can be so long, m, wrist to tip. Children's hands are small: a short one says nothing."""
    return length <= _BELIEVABLE


def unlikelihood(lengths: Array) -> Array:
    """Return the negative log likelihood, but for a constant, of hands' lengths (N,), m, among adults' hands.

    Beyond two deviations it grows no faster: hands of children, and what a wrong focal length makes of hands, are not rare.
    """
    apart = np.abs(_deviations(lengths))
    return np.where(apart < _RARE, 0.5 * apart**2, _RARE * (apart - 0.5 * _RARE))


def _deviations(lengths: Sequence[float] | Array) -> Array:
    """By how many deviations hands' lengths (N,), m, are longer than the usual one."""
    return (np.asarray(lengths) - _LENGTH) / _SPREAD


def lenses_for(length: float) -> tuple[float, ...]:
    """Return the lenses to try on a hand that is ``length`` metres long in the stated camera."""
    return tuple(length / believable for believable in _TRIED)


def lens_of(lenses: Sequence[float], lengths: Sequence[float], goldens: Sequence[float]) -> float:
    """Weigh lenses by how well their hands explain the depth and by how long these are.

    Args:
        lenses: the first is 1, the stated camera.
        lengths: of the hands that were found through each, m.
        goldens: mean golden energies of those hands.

    Returns:
        1 where the stated camera is the most likely; else the mean of the others, in the logarithm.
    """
    worse = np.asarray(goldens) / min(goldens) - 1.0
    unlikely = worse / _AS_GOOD + 0.5 * _deviations(lengths) ** 2
    unlikely[1:] += _TRUST
    if np.argmin(unlikely) == 0:
        return 1.0
    weights = np.exp(unlikely[1:].min() - unlikely[1:])
    return float(np.exp(np.log(lenses[1:]) @ weights / weights.sum()))
