"""Plots of what was tracked: where the hand is, how it is turned, how its fingers bend."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from spf.evaluate import Compared
from spf.hand.kinematics import rotation_about
from spf.hand.shape import percent_of
from spf.report.plots import Line, Panel, Plot, frame_plot
from spf.runs import Run
from spf.trackfile import Track

__all__ = ["held_only", "track_plots"]

Array = NDArray[np.float64]
_DIGITS = ("thumb", "index", "middle", "ring", "little")


def held_only(track: Track, values: Array) -> Array:
    """Return (N, …) values, NaN while the hand is lost."""
    held = values.astype(np.float64)
    held[track.lost] = np.nan
    return held


def track_plots(run: Run, compared: Compared | None) -> list[Plot]:
    """Return the plots of a run's track, beside the truth where there is one."""
    track = run.track
    return [
        _place(track, compared),
        frame_plot(
            "turn", "How the palm is turned", track.frame, [Panel("degrees", _turns(track), from_zero=False)], track.lost,
            "Rotation from the first frame that shows the hand, about the camera's axes.",
        ),
        frame_plot(
            "bend", "How the fingers bend", track.frame, [Panel("degrees", _bends(track), from_zero=False)], track.lost,
            "Sum of the flexions of all joints of a finger.",
        ),
        *_shape(track),
    ]  # fmt: skip


def _shape(track: Track) -> list[Plot]:
    """How the hand's shape was refined, where it was."""
    if not track.shape_changes.any():
        return []
    lines = tuple(Line(part, values) for part, values in percent_of(track.shape_changes).items())
    return [
        frame_plot(
            "shape", "How the hand's shape was refined", track.frame, [Panel("%", lines, from_zero=False)], track.lost,
            "Change since the start, in views that tell something of the shape.",
        )
    ]  # fmt: skip


def _place(track: Track, compared: Compared | None) -> Plot:
    wrist = 1e3 * held_only(track, track.joints[:, 0])
    panels = []
    for axis, name in enumerate(("x, right", "y, down", "z, away")):
        lines = [Line("wrist", wrist[:, axis], "s1")]
        if compared is not None and np.isfinite(compared.truth[:, 0]).any():
            lines.append(
                Line("true wrist, as the data set marks it", 1e3 * compared.truth[:, 0, axis], "s2", thin=True)
            )
        panels.append(Panel(f"{name}, mm", tuple(lines), from_zero=False))
    return frame_plot("place", "Where the hand is", track.frame, panels, track.lost)


def _turns(track: Track) -> tuple[Line, ...]:
    pairs = zip(track.poses, track.references, strict=True)
    turned = Rotation.from_matrix([rotation_about(pose[3:6]) @ reference for pose, reference in pairs])
    held = np.flatnonzero(~track.lost)
    first = turned[int(held[0]) if len(held) else 0]
    angles = np.degrees((turned * first.inv()).as_rotvec())
    return tuple(Line(f"about {name}", held_only(track, angles[:, i])) for i, name in enumerate("xyz"))


def _bends(track: Track) -> tuple[Line, ...]:
    lines = []
    for digit in _DIGITS:
        own = [i for i, name in enumerate(track.dof_names) if name.startswith(digit) and name.endswith("flexion")]
        lines.append(Line(digit, held_only(track, np.degrees(track.poses[:, own].sum(axis=1)))))
    return tuple(lines)
