"""One session held from end to end, and the shares that starts and kidnaps are summarised by."""

from __future__ import annotations

import json

import pytest

from benchmarks.holds import kidnaps, starts
from benchmarks.holds.sessions import synthetic
from benchmarks.holds.table import row_of
from benchmarks.holds.tracking import Asked, held


@pytest.fixture(scope="module")
def runs():
    (source,) = synthetic("medium", 1, 1, 4)
    return held(source, Asked("spf", "default", (1, 2), {"learned": "off"}, "truth"))


def test_a_session_is_held_once_for_each_number_of_particles(runs):
    assert [run["n"] for run in runs] == [1, 2]
    first, second = runs
    assert first["exact_floor_mm"] == second["exact_floor_mm"]
    assert first["error_mm"] != second["error_mm"]
    for run in runs:
        assert len(run["error_mm"]) == len(run["floor_mm"]) == len(run["lost"]) == len(run["flagged"]) == 4
        assert max(run["error_mm"]) < 20.0
        assert not any(run["flagged"])
        assert run["right_side"] is True
        assert run["size_ratio"] == pytest.approx(1.0)
    json.dumps(runs, allow_nan=False)
    assert row_of(runs[:1])["kind"] == "medium"


def test_the_same_session_held_again_gives_the_same_errors(runs):
    (source,) = synthetic("medium", 1, 1, 4)
    (again,) = held(source, Asked("spf", "default", (2,), {"learned": "off"}, "truth"))
    for key in ("error_mm", "golden", "exact_floor_mm", "label_golden"):
        assert again[key] == runs[1][key]


def test_shares_of_starts():
    def start(given, apart, *, right=True, doubt="", kind="medium"):
        return {"kind": kind, "given": given, "apart_mm": apart, "right_side": right, "doubt": doubt, "seconds": 1.0}

    tried = [start(1, 5.0), start(1, 25.0, doubt="pose"), start(1, None, right=False), start(1, 19.0, kind="body")]
    tried += [start(10, 5.0)] * 3 + [start(10, 5.0, kind="body")]
    rows = {(row["kind"], row["given"]): row for row in starts._rows(tried)}
    assert rows["medium", 1]["found"] == pytest.approx(1 / 3)
    assert rows["medium", 1]["right_side"] == pytest.approx(2 / 3)
    assert rows["medium", 1]["failures_doubted"] == 0.5
    assert rows["all", 1]["found"] == 0.5
    assert rows["all", 10]["found"] == 1.0
    assert rows["all", 10]["failures_doubted"] is None
    assert "–" in starts._table(list(rows.values()))


def test_no_start_is_compared_with_labels_that_contradict_the_depth(monkeypatch):
    (source,) = synthetic("medium", 1, 1, 30)
    monkeypatch.setattr(starts, "label_energy", lambda _hand, frame: 0.9 if frame.index in (3, 15) else 0.2)
    compared = {place.frame + given - 1 for place in starts._in_recording(source, 30) for given in (1, 10)}
    assert compared.isdisjoint({3, 15})
    assert {2, 4, 14} < compared


def test_shares_of_kidnaps():
    def one(noticed, recovered, *, again=False):
        return {"kind": "medium", "noticed": noticed, "recovered": recovered, "lost_again": again}

    all_of_them = kidnaps._rows([one(3, 8), one(None, 2, again=True), one(6, 12), one(None, None)])[-1]
    assert all_of_them["noticed"] == 0.5  # held again within five frames needs no notice
    assert all_of_them["recovered"] == 0.5
    assert (all_of_them["ever"], all_of_them["longest"], all_of_them["median"], all_of_them["lost_again"]) == (
        3,
        12,
        8.0,
        1,
    )
