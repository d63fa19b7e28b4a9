"""Success curves of a comparison as a figure."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from spf.errors import RunError

__all__ = ["draw_success"]

_PANELS = {"joints": "share of joints within", "frames": "share of frames whose largest error is within"}


def draw_success(content: dict[str, Any], path: Path) -> bool:
    """Draw the success curves of all contenders: mean over the seeds, and their range.

    Args:
        content: of ``compare.json``.
        path: of the figure; its ending says the format (svg, png, pdf).

    Returns:
        Whether there was anything to draw: without ground truth there is not.

    Raises:
        RunError: the file cannot be written.
    """
    curves = {
        contender["label"]: [
            run["success_curve"]
            for run in content["runs"]
            if run["label"] == contender["label"] and "success_curve" in run
        ]
        for contender in content["contenders"]
    }
    curves = {label: runs for label, runs in curves.items() if runs}
    if not curves:
        return False
    with mpl.rc_context({"svg.hashsalt": "spf", "svg.fonttype": "none", "font.size": 9.0}):
        figure = Figure(figsize=(9.0, 3.8), layout="constrained")
        for axes, panel in zip(figure.subplots(1, 2, sharey=True), _PANELS, strict=True):
            _draw_panel(axes, panel, curves)
        figure.suptitle(f"{content['session']['name']}, frames {content['frames'][0]} to {content['frames'][1] - 1}")
        figure.axes[0].legend(frameon=False, loc="lower right")
        try:
            figure.savefig(path, metadata={"Date": None} if path.suffix == ".svg" else None)
        except OSError as error:
            raise RunError(f"The figure {path} cannot be written: {error.strerror}.") from None
    return True


def _draw_panel(axes: Axes, panel: str, curves: dict[str, list[dict[str, Any]]]) -> None:
    for label, runs in curves.items():
        thresholds, seeds = runs[0]["threshold_mm"], np.array([run[panel] for run in runs], dtype=np.float64)
        (line,) = axes.plot(thresholds, 100 * seeds.mean(axis=0), label=label, linewidth=1.6)
        axes.fill_between(
            thresholds,
            100 * seeds.min(axis=0),
            100 * seeds.max(axis=0),
            color=line.get_color(),
            alpha=0.15,
            linewidth=0,
        )
    axes.set(xlim=(0, 80), ylim=(0, 100), xlabel=f"{_PANELS[panel]} … mm", ylabel="%" if panel == "joints" else "")
    axes.grid(alpha=0.3)
    axes.spines[["top", "right"]].set_visible(False)
