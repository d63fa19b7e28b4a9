"""Rows and bars of the table, against small runs worked out by hand."""

from __future__ import annotations

import pytest

from benchmarks.holds.calibration import LEVELS, coverage, fitted
from benchmarks.holds.table import bar_of, lay_out, row_of, worst


def run_of(error_mm, *, kind="medium", n=8, exact=None, flagged=None, lost=None, right=True, **others):
    count = len(error_mm)
    return {
        "kind": kind, "number": 0, "seed": 0, "session": "a", "n": n, "start_frame": 2, "start_seconds": 5.0,
        "start_golden": 0.2, "doubt": None, "right_side": right, "size_ratio": 0.9, "error_mm": error_mm,
        "largest_mm": [None if e is None else 2 * e for e in error_mm], "floor_mm": [3.0] * count, "fitted_mm": [1.0] * count,
        "exact_floor_mm": [None] * count if exact is None else exact, "flagged": flagged or [False] * count,
        "lost": lost or [False] * count, "iou": [], "seconds": [0.02] * count, "cpu_seconds": [0.03] * count, **others,
    }  # fmt: skip


def test_a_row_says_what_its_runs_were():
    row = row_of([run_of([2.0, 4.0, None]), run_of([6.0, 60.0, 12.0], right=False, lost=[False, True, False])])
    assert (row["sessions"], row["frames"]) == (2, 6)
    assert row["mean_mm"] == pytest.approx((3.0 + 26.0) / 2)
    assert row["spread_mm"] == pytest.approx(11.5)
    assert row["median_mm"] == 6.0
    assert row["over_40"] == pytest.approx(1 / 5)
    assert row["success_curve"][0] == 0.0
    assert row["success_curve"][20] == pytest.approx(3 / 5)  # largest errors 4, 8, 12, 120, 24
    assert (row["losses"], row["frames_lost"], row["wrong_sides"]) == (1, 1, 1)
    assert row["size_error"] == pytest.approx(0.1)
    assert (row["ms"], row["cpu_ms"]) == (pytest.approx(20.0), pytest.approx(30.0))


def test_the_floor_is_the_exact_hands_where_there_is_one():
    assert row_of([run_of([5.0, 5.0])])["floor_mm"] == 3.0
    row = row_of([run_of([5.0, 5.0], exact=[1.0, 2.0])])
    assert (row["floor_mm"], row["own_floor_mm"]) == (1.5, 3.0)


def test_flagged_frames_are_left_out_beside_and_not_instead():
    row = row_of([run_of([5.0, 7.0, 90.0], flagged=[False, False, True])])
    assert row["mean_mm"] == pytest.approx(34.0)
    assert row["unflagged_mean_mm"] == pytest.approx(6.0)
    assert row["flagged"] == pytest.approx(1 / 3)


@pytest.mark.parametrize(
    ("run", "said"),
    [
        (run_of([4.9] * 4), "held"),
        (run_of([5.1] * 4), "mean > 5.0"),
        (run_of([5.1] * 4, n=4), "held"),
        (run_of([1.0] * 98 + [41.0] * 2), ">40 > 1 %"),
        (run_of([3.9] * 4, kind="P4"), "held"),
        (run_of([4.1] * 4, kind="P4"), "mean > 4.0"),
        (run_of([400.0] * 4, kind="table"), ""),
        (run_of([None] * 20, kind="kinect2", iou=[0.8] * 19 + [0.6]), "held"),
        (run_of([None] * 20, kind="kinect2", iou=[0.8] * 18 + [0.6] * 2), "IoU < 95 %"),
    ],
)
def test_a_row_is_judged_by_its_bar(run, said):
    assert row_of([run])["bar"] == said


def test_fewer_particles_may_be_two_millimetres_worse():
    assert (bar_of("slow", 8).mean_mm, bar_of("slow", 4).mean_mm) == (4.0, 6.0)
    assert bar_of("P4", 4) == bar_of("P4", 8)


def test_the_table_shows_every_row_and_no_made_up_number():
    text = lay_out(
        [row_of([run_of([2.0, 4.0])]), row_of([run_of([None, None], kind="kinect2", right=None, iou=[0.9, 0.9])])]
    )
    lines = text.splitlines()
    assert len(lines) == 4
    assert len({len(line) for line in lines}) == 1
    assert "3.0 ± 0.0" in lines[2]
    assert lines[3].split("|")[4].strip() == "–"


def test_the_worst_runs_come_first_and_say_where():
    lines = worst([run_of([4.0, 5.0]), run_of([4.0, 80.0, 90.0, 4.0], right=False)], 1)
    assert len(lines) == 1
    assert "worst 90 mm in frame 4" in lines[0]
    assert "frames 3-4" in lines[0] or "WRONG SIDE" in lines[0]


def test_coverage_of_errors_is_what_it_says_however_heavy_their_tails(rng):
    normal = (rng.normal(size=(200_000, 3)) ** 2).sum(axis=1)
    for covariance, tails in ((2.5, 4.0), (0.3, 30.0)):
        squared = covariance * (tails - 2.0) / tails * normal / (rng.chisquare(tails, size=200_000) / tails)
        factor, found = fitted(squared)
        assert factor == pytest.approx(covariance, rel=0.1)
        assert found == pytest.approx(tails, rel=0.15)
        assert coverage(squared, factor, found) == pytest.approx(list(LEVELS), abs=0.005)
        assert coverage(squared, factor / 4, found)[LEVELS.index(0.9)] < 0.75
