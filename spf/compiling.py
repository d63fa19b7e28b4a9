"""Compile the kernels ahead of their first use: ``python -m spf.compiling`` takes about a minute once, then seconds.

Numba keeps what it has compiled on disk, so that another process may do this while a page or a command line stays at hand.
"""

from __future__ import annotations

import numpy as np

from spf.calibrate import fit_shape
from spf.hand.shape import HandShape
from spf.locate import locate, reach_of
from spf.observation import observe
from spf.prepare import prepare
from spf.search import SearchSettings
from spf.segmentation import find_regions
from spf.shape_equations import View
from spf.synthetic import SyntheticSettings, synthesise
from spf.track import begin, track_frame
from spf.trackers import TRACKERS, make_settings

__all__ = ["compile_kernels"]

_LEAST_SEARCH = SearchSettings(islands=1, kept=1, population=8, survivors=2, scouting=1, generations=1)


def compile_kernels() -> None:
    """Use every kernel once, as an automatic start and every tracker do, on one small synthetic frame."""
    session = synthesise(SyntheticSettings(frames=1, clutter="none"))
    frame, rng = session[0], np.random.default_rng(0)
    start = prepare(session, init="truth")
    for name in TRACKERS:
        tracking, state = begin(name, make_settings(name), start, seed=0)
        track_frame(tracking, state, frame, record=True)
    hand = start.shape.hand()
    observation = observe(frame, start.pose[:3], reach_of(hand))
    fit_shape([View(observation, start.pose, start.reference)], HandShape(start.shape.side), rng, iterations=1)
    locate(hand, observation, find_regions(frame)[0].points, _LEAST_SEARCH, rng)


if __name__ == "__main__":
    compile_kernels()
