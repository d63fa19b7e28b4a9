"""The table of trackers by name, with their presets: what the command line, the dashboard and the tests iterate over."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from typing import Any, NamedTuple, Protocol

import numpy as np

from spf.errors import SettingError
from spf.filters import annealed, condensation, single, smart
from spf.filters.step import State, StepInfo
from spf.hand.model import Hand
from spf.kernels.cost import Spheres
from spf.nbp import tracker as nbp
from spf.observation import Observation
from spf.optimisers import bfgs, gd, lm, powell, smd
from spf.settings import Settings

__all__ = ["PRESETS", "TRACKERS", "Step", "Tracker", "make_settings"]


class Step(Protocol):
    """One frame of a tracker."""

    def __call__(
        self,
        rng: np.random.Generator,
        state: State,
        observation: Observation,
        hand: Hand,
        settings: Any,
        *,
        spheres: Spheres | None = None,
        record: bool = False,
        effort: float = 1.0,
    ) -> tuple[State, StepInfo]:
        """Track one frame; see :func:`spf.filters.smart.step`."""
        ...


class Tracker(NamedTuple):
    """A tracker by name.

    Attributes:
        name: as in ``--tracker``.
        title: for headings.
        settings: class of its settings.
        step: one frame.
        cost: name of the whole-number setting that a frame's time grows with: what is chosen to give it more or less
            time.
        presets: preset → changes from the defaults beside those of all trackers.
    """

    name: str
    title: str
    settings: type[Settings]
    step: Step
    cost: str
    presets: Mapping[str, Mapping[str, Any]] = {}


TRACKERS: dict[str, Tracker] = {
    tracker.name: tracker
    for tracker in (
        Tracker("spf", "Smart Particle Filter", smart.SpfSettings, smart.step, "n", {"paper": {"n": 4}}),
        Tracker("smd", "One SMD tracker", single.SingleSmdSettings, partial(single.step, smd.optimise), "rounds"),
        Tracker("gd", "Gradient descent", single.SingleGdSettings, partial(single.step, gd.optimise), "rounds"),
        Tracker("bfgs", "L-BFGS-B", single.SingleBfgsSettings, partial(single.step, bfgs.optimise), "rounds"),
        Tracker(
            "powell",
            "Powell's method",
            single.SinglePowellSettings,
            partial(single.step, powell.optimise),
            "evaluations",
        ),
        Tracker("lm", "Levenberg-Marquardt", single.SingleLmSettings, partial(single.step, lm.optimise), "rounds"),
        Tracker("condensation", "Condensation", condensation.CondensationSettings, condensation.step, "n"),
        Tracker(
            "apf",
            "Annealed particle filter",
            annealed.ApfSettings,
            annealed.step,
            "n",
            {"paper": {"n": 500, "layers": 12, "points": 350, "survival": 0.5}},
        ),
        Tracker(
            "nbp",
            "Nonparametric belief propagation",
            nbp.NbpSettings,
            nbp.step,
            "n",
            {"paper": {"reach": 3.2, "dynamics": "random-walk"}},
        ),
    )
}

#: Changes from the defaults, for the trackers that have the setting. ``paper`` is the paper's own cost, (3), with its N,
#: |S| and k; a tracker's own changes come on top.
PRESETS: dict[str, dict[str, Any]] = {
    "default": {},
    "paper": {
        "k": 3.0,
        "points": 45,
        "coverage": 0.0,
        "data_points": 0,
        "background": 1.0,
        "collision": 0.0,
        "robust": False,
        "zbuffer": False,
        "golden": 0.0,
        "structured": 0.0,
        "recombination": 0.0,
        "learned": False,
        "prediction_pull": 0.0,
        "refine_shape": False,
        "dynamics": "first-order",
    },
}


def make_settings(tracker: str, preset: str = "default", changes: Mapping[str, str] | None = None) -> Settings:
    """Return a tracker's settings: a preset, then changes given as text.

    Raises:
        SettingError: there is no such tracker, preset or setting, or a value is out of range.
    """
    if tracker not in TRACKERS:
        raise SettingError(f"There is no tracker '{tracker}'; the trackers are {', '.join(TRACKERS)}.")
    if preset not in PRESETS:
        raise SettingError(f"There is no preset '{preset}'; the presets are {', '.join(PRESETS)}.")
    settings = TRACKERS[tracker].settings()
    known = {info.name for info in settings.describe()}
    chosen = {name: value for name, value in PRESETS[preset].items() if name in known}
    chosen |= TRACKERS[tracker].presets.get(preset, {})
    return settings.replace(**chosen).with_text(changes or {})
