"""A slice of the damaged recordings; ``python -m benchmarks.fuzz`` runs thousands."""

from __future__ import annotations

import numpy as np
import pytest

from benchmarks.fuzz.case import read_recording, run_case
from benchmarks.fuzz.damage import DAMAGES
from benchmarks.fuzz.recordings import RECORDINGS
from benchmarks.fuzz.worker import Worker
from spf.sessions.opening import FORMATS

CASES = 20


def test_every_format_is_damaged():
    assert {form.name for form in FORMATS} <= set(RECORDINGS)


@pytest.mark.parametrize("damage", DAMAGES)
def test_a_damage_changes_the_file_and_repeats(damage):
    data = np.random.default_rng(1).bytes(5000)
    first, second = (bytes(DAMAGES[damage](np.random.default_rng(4), bytearray(data))) for _ in range(2))
    assert first == second != data


@pytest.mark.parametrize("name", RECORDINGS)
def test_damaged_recordings_are_refused_or_read(name, tmp_path):
    good = RECORDINGS[name](tmp_path / "good", np.random.default_rng(0)).path
    assert read_recording(good, "no damage").kind == "read"
    outcomes = [(seed, run_case(good, seed, tmp_path / "case")) for seed in range(10_000, 10_000 + CASES)]
    assert [(seed, outcome.text) for seed, outcome in outcomes if outcome.kind == "WRONG"] == []
    assert any(outcome.kind == "refused" for _, outcome in outcomes)


# What the thousands found: an index behind the end, an encoding that is none, an error message that is no text.
@pytest.mark.parametrize(
    ("name", "seed"),
    [("mcap", 286), ("nyu", 481), ("realsense", 60), ("realsense", 98), ("ros-mcap", 299), ("ros-mcap", 417)],
)
def test_what_was_wrong_once_is_refused_or_read(name, seed, tmp_path):
    good = RECORDINGS[name](tmp_path / "good", np.random.default_rng(0)).path
    outcome = run_case(good, seed, tmp_path / "case")
    assert outcome.kind in ("refused", "read"), outcome.text


def test_what_libraries_say_of_damage_does_not_stand_among_the_results(tmp_path, capfd):
    good = RECORDINGS["open3d"](tmp_path / "good", np.random.default_rng(0)).path
    worker = Worker(good, tmp_path / "case")
    try:
        worker.run(20)  # libjpeg: "Corrupt JPEG data"
        assert "JPEG" in (tmp_path / "case.log").read_text()
        worker.run(21)
        assert "JPEG" not in (tmp_path / "case.log").read_text()
    finally:
        worker.close()
    assert capfd.readouterr() == ("", "")
