"""Who is compared, what time they are given, the table and the figure."""

from __future__ import annotations

from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pytest

from spf.compare import contenders_of, draw_success, table
from spf.compare.equal_time import choose
from spf.errors import SettingError
from spf.settings import SettingInfo
from spf.trackers import make_settings

# ---- contenders


def test_trackers_take_part_with_presets_and_settings_of_their_own() -> None:
    apf, few = contenders_of(
        ["apf", "few=apf"], ["paper", "few=default"], {"few.points": "45", "n": "50", "apf.n": "60"}
    )
    assert (apf.label, apf.tracker, apf.preset) == ("apf", "apf", "paper")
    assert (few.label, few.tracker, few.preset) == ("few", "apf", "default")
    assert apf.settings == make_settings("apf", "paper", {"n": "60"})
    assert few.settings == make_settings("apf", "default", {"n": "50", "points": "45"})


def test_a_setting_for_all_goes_to_those_that_have_it() -> None:
    spf, gd = contenders_of(["spf", "gd"], [], {"n": "7", "k": "2"})
    assert spf.settings == make_settings("spf", changes={"n": "7", "k": "2"})
    assert gd.settings == make_settings("gd", changes={"k": "2"})


@pytest.mark.parametrize(
    ("names", "presets", "assignments", "words"),
    [
        (["nonesuch"], [], {}, "no tracker 'nonesuch'"),
        (["spf", "spf"], [], {}, "twice"),
        ([], [], {}, "nothing to compare"),
        (["a/b=spf"], [], {}, "no label"),
        (["spf"], ["nonesuch"], {}, "no preset"),
        (["spf"], ["smd=paper"], {}, "'smd' does not take part"),
        (["spf"], [], {"smd.k": "2"}, "'smd' does not take part"),
        (["gd"], [], {"n": "2"}, "None of the trackers"),
        (["spf"], [], {"spf.nonesuch": "2"}, "no setting 'nonesuch'"),
    ],
)
def test_what_makes_no_sense_is_refused(
    names: list[str], presets: list[str], assignments: dict[str, str], words: str
) -> None:
    with pytest.raises(SettingError, match=words):
        contenders_of(names, presets, assignments)


# ---- equal time


def info(low: int = 1, high: int = 1000) -> SettingInfo:
    return SettingInfo("n", int, 4, low, high, (), "", "", "", "")


def test_the_setting_whose_time_is_the_target_is_found_on_a_line() -> None:
    measured: list[int] = []

    def measure(value: int) -> float:
        measured.append(value)
        return 0.010 + 0.002 * value

    value, seconds = choose(info(), 100, 0.050, measure)
    assert value == 20
    assert seconds == pytest.approx(0.050)
    assert len(measured) <= 3


def test_a_tracker_that_takes_longer_at_its_least_gets_its_least() -> None:
    assert choose(info(), 10, 0.001, lambda value: 0.1 + 0.01 * value) == (1, 0.11)


def test_a_setting_that_is_near_enough_is_not_measured_again() -> None:
    assert choose(info(), 10, 1.0, lambda value: 1.05) == (10, 1.05)


def test_choosing_goes_on_between_two_times_on_both_sides_of_the_target() -> None:
    """A time that grows slowly at first and fast later, as of a search that ends by itself: lines from one side miss."""
    value, seconds = choose(info(), 90, 0.025, lambda value: 0.015 + 1e-9 * value**4)
    assert abs(seconds - 0.025) <= 0.1 * 0.025
    assert 48 < value < 64


# ---- table and figure


def content(runs: dict[str, list[float]], truth: bool = True) -> dict[str, Any]:
    thresholds = np.arange(81.0)

    def run(label: str, seed: int, error: float) -> dict[str, Any]:
        curve = (thresholds > error).astype(float).tolist()
        measures: dict[str, Any] = {"label": label, "seed": seed, "losses": seed, "silhouette_iou": 0.5}
        if truth:
            measures |= {"mean_joint_error_mm": error}
            measures |= {"success_curve": {"threshold_mm": thresholds.tolist(), "joints": curve, "frames": curve}}
        return measures

    return {
        "session": {"name": "wave"},
        "frames": [0, 10],
        "contenders": [{"label": label} for label in runs],
        "runs": [run(label, seed, error) for label, errors in runs.items() for seed, error in enumerate(errors)],
    }


def test_the_table_has_mean_and_standard_deviation_over_the_seeds() -> None:
    heading, spf, smd, apf = table(content({"spf": [4.0, 6.0], "smd": [20.0], "apf": []}))
    assert heading[:3] == ["tracker", "seeds", "mean mm"]
    assert spf[:3] == ["spf", "2", "5.0 ± 1.4"]
    assert smd[:3] == ["smd", "1", "20.0"]
    assert apf == ["apf", "0", *["–"] * (len(heading) - 2)]


def test_measures_that_nobody_has_are_left_out() -> None:
    heading, *_ = table(content({"spf": [4.0]}, truth=False))
    assert heading == ["tracker", "seeds", "IoU", "losses"]


def test_the_figure_has_a_curve_a_contender_and_is_the_same_each_time(tmp_path: Path) -> None:
    compared = content({"spf": [4.0, 6.0], "smd": [20.0]})
    assert draw_success(compared, tmp_path / "a.svg")
    assert draw_success(compared, tmp_path / "b.svg")
    text = (tmp_path / "a.svg").read_text(encoding="utf-8")
    assert text == (tmp_path / "b.svg").read_text(encoding="utf-8")
    written = {
        "".join(element.itertext()).strip() for element in ElementTree.fromstring(text).iter() if "text" in element.tag
    }
    assert {"spf", "smd"} <= written


def test_without_truth_there_is_no_figure(tmp_path: Path) -> None:
    assert not draw_success(content({"spf": [4.0]}, truth=False), tmp_path / "a.svg")
    assert not (tmp_path / "a.svg").exists()
