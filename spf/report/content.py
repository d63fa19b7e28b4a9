"""What a report says, gathered from a run and its session: numbers, tables, plots; no HTML."""

from __future__ import annotations

import shlex
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from spf.evaluate import Compared, compare_run, count_losses, measures_of
from spf.progress import Report
from spf.report.plots import Line, Panel, Plot, bar_plot, curve_plot, frame_plot, stage_plot
from spf.report.tracks import held_only, track_plots
from spf.runs import Run
from spf.sessions import Session
from spf.settings import SettingInfo
from spf.trackers import make_settings
from spf.trackfile import Track

__all__ = [
    "Figures",
    "SettingRow",
    "badness",
    "figures_of",
    "loss_rows",
    "numbers_of",
    "plots_of",
    "repeat_commands",
    "setting_rows",
    "stage_rows",
]

Array = NDArray[np.float64]


class SettingRow(NamedTuple):
    """A setting of the run: what is declared of it, its value, and the preset's."""

    info: SettingInfo
    value: Any
    preset: Any

    @property
    def differs(self) -> bool:
        """Whether the run has another value than its preset."""
        return bool(self.value != self.preset)


class Figures(NamedTuple):
    """What was measured: summary (see :func:`spf.evaluate.evaluate_run`) and, with the session, every frame."""

    measures: dict[str, Any]
    compared: Compared | None


def figures_of(run: Run, session: Session | None, progress: Report | None = None) -> Figures:
    """Measure a run; without its session only by what the track itself says.

    Raises:
        SessionError: a frame cannot be read.
    """
    if session is None:
        return Figures(dict(count_losses(run.track.lost)._asdict()), None)
    compared = compare_run(run, session, progress)
    return Figures(measures_of(run, session, compared), compared)


def badness(track: Track, compared: Compared | None) -> Array:
    """Return (N,) how bad each frame is: its mean joint error, else its distance from the depth, else its golden energy."""
    if compared is None:
        return track.golden
    errors = _mean_error(compared)
    return errors if np.isfinite(errors).any() else compared.distance


def _mean_error(compared: Compared) -> Array:
    known = np.isfinite(compared.errors)
    total = np.where(known, compared.errors, 0.0).sum(axis=1)
    return np.where(known.any(axis=1), total / np.maximum(known.sum(axis=1), 1), np.nan)


def _largest_error(compared: Compared) -> Array:
    known = np.isfinite(compared.errors)
    return np.where(known.any(axis=1), np.where(known, compared.errors, -1.0).max(axis=1), np.nan)


def numbers_of(run: Run, figures: Figures) -> list[tuple[str, str, str]]:
    """Return the numbers at the head of a report: (name, value, a few words)."""
    measures, track = figures.measures, run.track
    rows: list[tuple[str, str, str]] = []
    if measures.get("mean_joint_error_mm") is not None:
        tips = measures["fingertip_error_mm"]
        rows.append(("Mean joint error", f"{measures['mean_joint_error_mm']:.1f} mm", f"fingertips {_mm(tips)}"))
    if measures.get("mean_data_to_model_mm") is not None:
        rows.append(
            ("Depth to hand", f"{measures['mean_data_to_model_mm']:.1f} mm", "mean distance of the observed points")
        )
    if measures.get("silhouette_iou") is not None:
        rows.append(("Silhouettes", f"{100 * measures['silhouette_iou']:.0f} %", "overlap of hand and depth"))
    lost = int(track.lost.sum())
    rows.append(("Losses", str(measures["losses"]), f"{lost} of {len(track)} frames without a hand"))
    known = track.ess[np.isfinite(track.ess)]
    if len(known):
        rows.append(("Effective samples", f"{np.median(known):.1f}", f"median; {_samples(run)}"))
    seconds = track.seconds[track.seconds > 0]
    if len(seconds):
        rows.append(("Time of a frame", f"{1e3 * np.median(seconds):.0f} ms", f"median; {seconds.sum():.0f} s in all"))
    return rows


def _samples(run: Run) -> str:
    count = getattr(run.plan.settings, "n", None)
    return "one hypothesis" if count is None else f"N = {count}"


def _mm(value: float | None) -> str:
    return "–" if value is None else f"{value:.1f} mm"


def plots_of(run: Run, figures: Figures) -> dict[str, list[Plot]]:
    """Return the plots of each section."""
    track, compared, measures = run.track, figures.compared, figures.measures
    plots: dict[str, list[Plot]] = {"errors": [], "beside": [], "agreement": [], "filter": [], "time": []}
    if compared is not None:
        plots["errors"], plots["beside"] = _error_plots(track, compared, measures)
    agreement = [Panel("golden energy", (Line("golden energy: 0 explains all", held_only(track, track.golden)),))]
    if compared is not None:
        iou = Line("overlap of the silhouettes: 1 is perfect", compared.iou, "s3")
        agreement.insert(0, Panel("IoU", (iou,), top=1.05))
    plots["agreement"] = [frame_plot("agreement", "Hand and depth", track.frame, agreement, track.lost)]
    plots["filter"] = _filter_plots(track)
    plots["track"] = track_plots(run, compared)
    plots["time"] = _time_plots(track)
    return plots


def _error_plots(track: Track, compared: Compared, measures: dict[str, Any]) -> tuple[list[Plot], list[Plot]]:
    distance = Line("mean distance of the observed points from the hand", 1e3 * compared.distance, "s3")
    if measures.get("mean_joint_error_mm") is None:
        panel = Panel("mm", (distance,))
        note = "This session has no truth: how far the observed points lie from the hand is what can be said."
        return [frame_plot("residual", "Distance from the depth", track.frame, [panel], track.lost, note)], []
    mean = Line("mean over the joints", 1e3 * _mean_error(compared))
    largest = Line("largest joint error", 1e3 * _largest_error(compared), "s2", thin=True)
    panels = [Panel("joint error, mm", (mean, largest)), Panel("residual, mm", (distance,))]
    note = f"Correction of the joints: {measures['correction']}."
    over = frame_plot("error", "Errors against the truth", track.frame, panels, track.lost, note)
    bars = bar_plot("joints", "Mean error of each joint", measures["joint_error_mm"], "mm")
    curve = measures["success_curve"]
    lines = {"joints": curve["joints"], "frames, by their largest error": curve["frames"]}
    success = curve_plot("success", "Share within …", curve["threshold_mm"], lines, "mm")
    return [over], [bars, success]


def _filter_plots(track: Track) -> list[Plot]:
    panels = []
    if np.isfinite(track.ess).any():
        panels.append(Panel("ESS", (Line("effective sample size", track.ess),)))
    if np.isfinite(track.optimised_share).any():
        share = Line("weight on optimised samples", 100 * track.optimised_share, "s2")
        panels.append(Panel("%", (share,), top=104.0))
    if np.isfinite(track.log_likelihood).any():
        likelihood = Line("log-likelihood of the estimate", track.log_likelihood, "s3")
        panels.append(Panel("log p", (likelihood,), from_zero=False))
    return [frame_plot("filter", "The filter", track.frame, panels, track.lost)] if panels else []


def _time_plots(track: Track) -> list[Plot]:
    looked = track.seconds > 0
    if not looked.any() or not track.timings:
        return []
    order = [row[0] for row in stage_rows(track)]
    shown, rest = order[:4], order[4:]
    stages = {name: track.timings[name] for name in shown}
    if rest:
        stages["other stages"] = np.sum([np.nan_to_num(track.timings[name]) for name in rest], axis=0)
    note = "Stages of each frame on top of each other; the scale holds 98 % of the frames."
    return [stage_plot("time", "Time of a frame", track.frame, stages, track.lost, note)]


def stage_rows(track: Track) -> list[tuple[str, float, float, float]]:
    """Return (stage, median ms, 95th percentile ms, share of all time) of each stage, the longest first."""
    total = float(track.seconds.sum()) or 1.0
    rows = []
    for name, seconds in track.timings.items():
        known = seconds[np.isfinite(seconds)]
        if len(known):
            middle, high = np.percentile(1e3 * known, [50, 95])
            rows.append((name, float(middle), float(high), float(known.sum()) / total))
    return sorted(rows, key=lambda row: -row[3])


def loss_rows(track: Track) -> list[tuple[int, int, int, bool]]:
    """Return (first frame, last frame, number of frames, whether it was found again) of each time without a hand."""
    edges = np.diff(np.concatenate([[0], track.lost.astype(np.int8), [0]]))
    pairs = zip(np.flatnonzero(edges == 1), np.flatnonzero(edges == -1), strict=True)
    return [(int(track.frame[a]), int(track.frame[b - 1]), int(b - a), bool(b < len(track))) for a, b in pairs]


def setting_rows(run: Run) -> dict[str, list[SettingRow]]:
    """Return the settings by group, beside those of the preset."""
    plan = run.plan
    values, preset = plan.settings.to_dict(), make_settings(plan.tracker, plan.preset).to_dict()
    groups: dict[str, list[SettingRow]] = {}
    for info in plan.settings.describe():
        groups.setdefault(info.group, []).append(SettingRow(info, values[info.name], preset[info.name]))
    return groups


def repeat_commands(run: Run, directory: str) -> list[tuple[str, str]]:
    """Return (what for, command) that repeat a run; the first needs its directory, the second only the session."""
    commands = [("From its directory, bit for bit", f"spf track --repeat {shlex.quote(directory)} -o again")]
    made = [str(part) for part in run.manifest.get("command", [])]
    if made and made[0] == "spf":  # the page makes runs too, and no command repeats what somebody clicked
        commands.append(("As it was made", shlex.join(made)))
    return commands
