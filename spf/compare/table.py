"""The table of a comparison: mean and standard deviation over the seeds, one contender a row."""

from __future__ import annotations

from typing import Any

import numpy as np

__all__ = ["COLUMNS", "table"]

#: heading → name of the measure, factor, format.
COLUMNS: dict[str, tuple[str, float, str]] = {
    "mean mm": ("mean_joint_error_mm", 1.0, ".1f"),
    "median mm": ("median_joint_error_mm", 1.0, ".1f"),
    "tips mm": ("fingertip_error_mm", 1.0, ".1f"),
    "IoU": ("silhouette_iou", 1.0, ".2f"),
    "losses": ("losses", 1.0, ".1f"),
    "lost": ("frames_lost", 1.0, ".0f"),
    "ms/frame": ("processor_seconds_per_frame_median", 1e3, ".0f"),
    "evals/frame": ("evaluations_per_frame", 1.0, ".0f"),
}


def table(content: dict[str, Any]) -> list[list[str]]:
    """Return the rows of the table, the heading first: label, number of seeds, then mean ± sd of every measure.

    Args:
        content: of ``compare.json``.
    """
    shown = {
        heading: column
        for heading, column in COLUMNS.items()
        if any(run.get(column[0]) is not None for run in content["runs"])
    }
    rows = [["tracker", "seeds", *shown]]
    for contender in content["contenders"]:
        runs = [run for run in content["runs"] if run["label"] == contender["label"]]
        rows.append([contender["label"], str(len(runs)), *(_cell(runs, *column) for column in shown.values())])
    return rows


def _cell(runs: list[dict[str, Any]], name: str, factor: float, style: str) -> str:
    values = [factor * run[name] for run in runs if run.get(name) is not None]
    if not values:
        return "–"
    mean = format(float(np.mean(values)), style)
    return mean if len(values) == 1 else f"{mean} ± {format(float(np.std(values, ddof=1)), style)}"
