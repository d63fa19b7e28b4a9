"""A small comparison, in processes of its own: what it keeps, that it is repeatable, and what Ctrl-C leaves."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from spf.cli import execute
from spf.compare import COMPARISON, check_free, compare, contenders_of, prepare_comparison
from spf.errors import RunError
from spf.hand import HandShape, write_hand_shape
from spf.runs import read_run
from spf.sessions import Session, open_session
from tests.conftest import REPOSITORY

_URI = str(REPOSITORY / "sessions" / "open-close.mcap")
_CHEAP = {"rounds": "2"}


@pytest.fixture(scope="module")
def session() -> Iterator[Session]:
    with open_session(_URI) as opened:
        yield opened


@pytest.fixture(scope="module")
def compared(session: Session, tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, dict[str, Any]]:
    directory = tmp_path_factory.mktemp("compare") / "c"
    contenders = contenders_of(["spf", "gd"], [], _CHEAP | {"spf.n": "1"})
    comparison = prepare_comparison(session, contenders, range(2), command=["spf"], init="truth", first=3, last=6)
    contents = list(compare(comparison, directory, jobs=1))
    assert len(contents) == 4
    return directory, contents[-1]


def test_all_that_a_repetition_needs_is_kept(compared: tuple[Path, dict[str, Any]], session: Session) -> None:
    directory, content = compared
    kept = json.loads((directory / COMPARISON).read_text(encoding="utf-8"))
    assert kept == content
    assert kept["complete"]
    assert kept["session"]["fingerprint"] == session.fingerprint()
    assert kept["frames"] == [3, 6]
    assert kept["seeds"] == [0, 1]
    assert [contender["label"] for contender in kept["contenders"]] == ["spf", "gd"]
    assert kept["contenders"][0]["settings"]["n"] == 1
    assert sorted((run["label"], run["seed"]) for run in kept["runs"]) == [("gd", 0), ("gd", 1), ("spf", 0), ("spf", 1)]
    for run in kept["runs"]:
        assert run["mean_joint_error_mm"] > 0
        assert run["processor_seconds_per_frame_median"] > 0


def test_all_contenders_get_the_same_start(compared: tuple[Path, dict[str, Any]]) -> None:
    directory, content = compared
    for seed in content["seeds"]:
        starts = [read_run(directory / run["run"]).plan.start for run in content["runs"] if run["seed"] == seed]
        np.testing.assert_array_equal(starts[0].pose, starts[1].pose)
        np.testing.assert_array_equal(starts[0].pose, content["starts"][str(seed)]["pose"])


def test_a_run_of_a_comparison_is_repeated_bit_for_bit(compared: tuple[Path, dict[str, Any]], tmp_path: Path) -> None:
    directory, content = compared
    run = next(run for run in content["runs"] if run["label"] == "spf")["run"]
    assert execute(["track", "--repeat", str(directory / run), "-o", str(tmp_path / "again")]) == 0
    np.testing.assert_array_equal(read_run(tmp_path / "again").track.poses, read_run(directory / run).track.poses)


def test_what_was_done_before_an_interruption_is_kept(session: Session, tmp_path: Path) -> None:
    comparison = prepare_comparison(
        session, contenders_of(["gd"], [], _CHEAP), range(3), command=["spf"], init="truth", first=3, last=5
    )
    running = compare(comparison, tmp_path / "c", jobs=1)
    next(running)
    with pytest.raises(KeyboardInterrupt):
        running.throw(KeyboardInterrupt)  # type: ignore[attr-defined]
    kept = json.loads((tmp_path / "c" / COMPARISON).read_text(encoding="utf-8"))
    assert not kept["complete"]
    assert len(kept["runs"]) == 1


def test_a_directory_with_something_else_is_left_alone(compared: tuple[Path, dict[str, Any]], tmp_path: Path) -> None:
    directory, _ = compared
    with pytest.raises(RunError, match="--force"):
        check_free(directory, False)
    check_free(directory, True)
    (tmp_path / "notes.txt").write_text("mine", encoding="utf-8")
    with pytest.raises(RunError, match="other things"):
        check_free(tmp_path, True)
    with pytest.raises(RunError, match="is a file"):
        check_free(tmp_path / "notes.txt", True)


def test_the_command_prints_a_table_and_draws_the_curves(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    arguments = ["compare", _URI, "-o", str(tmp_path / "c"), "--trackers", "few=gd", "--seeds", "1", "--init", "truth"]
    arguments += ["--frames", "3:15", "--set", "few.rounds=1", "--jobs", "1", "--equal-time"]
    assert execute(arguments) == 0
    out = capsys.readouterr().out
    assert "mean mm" in out
    assert "few" in out
    assert (tmp_path / "c" / "success.svg").stat().st_size > 1000
    kept = json.loads((tmp_path / "c" / COMPARISON).read_text(encoding="utf-8"))
    chosen = kept["equal_time"]["chosen"]["few"]
    assert chosen["setting"] == "rounds"
    assert chosen["value"] == kept["contenders"][0]["settings"]["rounds"] > 1
    assert kept["equal_time"]["of"]["settings"]["n"] == 4


def test_a_known_hand_is_that_of_all_contenders(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    hand = tmp_path / "hand.json"
    write_hand_shape(HandShape("right", scale=1.05), hand)
    arguments = [
        "compare",
        _URI,
        "-o",
        str(tmp_path / "c"),
        "--trackers",
        "gd,few=gd",
        "--seeds",
        "1",
        "--init",
        "truth",
    ]
    arguments += ["--frames", "3:5", "--set", "rounds=1", "--jobs", "1", "--hand"]
    assert execute([*arguments, str(hand)]) == 0
    content = json.loads((tmp_path / "c" / COMPARISON).read_text(encoding="utf-8"))
    for run in content["runs"]:
        assert read_run(tmp_path / "c" / run["run"]).plan.start.shape.scale == 1.05
    write_hand_shape(HandShape("left"), hand)
    capsys.readouterr()
    assert execute([*arguments, str(hand), "--force"]) == 2
    assert "The hand shape is of a left hand, and open-close shows a right hand." in capsys.readouterr().err
    assert execute([*arguments, str(tmp_path / "none.json"), "--force"]) == 2
