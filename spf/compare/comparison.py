"""A comparison: prepared once per seed, run in parallel, kept in a directory with all that is needed to repeat it."""

from __future__ import annotations

import datetime
import json
import shutil
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from spf import __version__
from spf.compare.contender import Contender
from spf.compare.equal_time import equalise
from spf.compare.workers import Job, open_workers, track_and_measure
from spf.errors import RunError
from spf.hand import HandShape
from spf.initialise import Start
from spf.manifest import Plan, manifest_of
from spf.prepare import prepare
from spf.progress import Report, silent
from spf.runs import make_directory
from spf.sessions import Session

__all__ = ["COMPARISON", "Comparison", "check_free", "compare", "prepare_comparison"]

COMPARISON, RUNS = "compare.json", "runs"


class Comparison(NamedTuple):
    """What is compared.

    Attributes:
        session, camera: what is tracked.
        contenders: by what.
        init: how the starts were made.
        first, last: frames ``[first, last)``.
        starts: seed → start, the same for all.
        command: the exact command line.
    """

    session: Session
    camera: Path | None
    contenders: tuple[Contender, ...]
    init: str
    first: int
    last: int
    starts: dict[int, Start]
    command: list[str]


def check_free(directory: Path, overwrite: bool) -> None:
    """Check that a comparison may be written to a directory, before any work is done.

    Raises:
        RunError: there is something else there already.
    """
    if directory.exists() and not directory.is_dir():
        raise RunError(f"{directory} is a file: choose a directory for the comparison.")
    if not directory.exists() or not any(directory.iterdir()):
        return
    if not (directory / COMPARISON).exists():
        raise RunError(f"The directory {directory} holds other things than a comparison: choose a new one.")
    if not overwrite:
        raise RunError(f"The directory {directory} holds a comparison already: choose another, or use --force.")


def prepare_comparison(
    session: Session,
    contenders: Sequence[Contender],
    seeds: Sequence[int],
    *,
    command: list[str],
    camera: Path | None = None,
    shape: HandShape | None = None,
    init: str = "auto",
    first: int = 0,
    last: int | None = None,
    progress: Report | None = None,
) -> Comparison:
    """Prepare one start per seed, for all contenders; ``shape`` is of the hand where it is known (:func:`prepare`).

    Raises:
        StartError: no first pose is found.
        HandError: the shape is of another hand than the session or the pose file.
        SessionError: a frame cannot be read.
    """
    end = len(session) if last is None else last
    starts = {}
    for done, seed in enumerate(seeds):
        if progress is not None:
            progress(f"Preparing seed {seed}", done / len(seeds))
        starts[seed] = prepare(session, init=init, shape=shape, seed=seed, first=first, last=end)
    return Comparison(session, camera, tuple(contenders), init, first, end, starts, command)


def compare(
    comparison: Comparison,
    directory: Path,
    *,
    jobs: int,
    equal_time: bool = False,
    progress: Report | None = None,
) -> Iterator[dict[str, Any]]:
    """Run all contenders with all seeds; what is done is kept in the directory, however the work ends.

    Args:
        comparison: what is compared.
        directory: to write to; its runs can be evaluated and repeated one by one.
        jobs: number of processes, each with one thread.
        equal_time: choose settings such that all take about the same time per frame.
        progress: called with what is being done and the share done.

    Yields:
        After every run the comparison until then, as it is in ``compare.json``.

    Raises:
        RunError: the directory cannot be written to.
        SessionError: a frame cannot be read.
    """
    report = progress or silent
    shutil.rmtree(directory / RUNS, ignore_errors=True)
    make_directory(directory)
    session, contenders = comparison.session, comparison.contenders
    uri, shared_time = str(session.uri), None
    with open_workers(jobs) as workers:
        if equal_time:
            start = next(iter(comparison.starts.values()))
            contenders, shared_time = equalise(
                workers, contenders, uri, comparison.camera, start, comparison.last,
                lambda _: report("Measuring times", 0.0),
            )  # fmt: skip
        planned = _jobs(comparison._replace(contenders=contenders), directory)
        content = _described(comparison, contenders, shared_time)
        total = len(planned) * (comparison.last - comparison.first)
        _write(content, directory)
        arguments = [(job,) for _, job in planned]
        for index, measures in workers.map(track_and_measure, arguments, lambda done: report("Tracking", done / total)):
            contender, job = planned[index]
            if measures is None:
                continue
            where = str(job.directory.relative_to(directory))
            content["runs"].append({"label": contender.label, "seed": job.plan.seed, "run": where, **measures})
            content["complete"] = len(content["runs"]) == len(planned)
            _write(content, directory)
            yield content


def _jobs(comparison: Comparison, directory: Path) -> list[tuple[Contender, Job]]:
    """All runs, seed by seed, so that a comparison that is stopped has about the same seeds of all."""
    return [
        (
            contender,
            Job(
                str(comparison.session.uri),
                comparison.camera,
                Plan(
                    contender.tracker, contender.preset, contender.settings, seed, comparison.init,
                    comparison.first, comparison.last, start,
                ),
                directory / RUNS / f"{contender.label}-{seed}",
                comparison.command,
            ),
        )
        for seed, start in comparison.starts.items()
        for contender in comparison.contenders
    ]  # fmt: skip


def _described(
    comparison: Comparison, contenders: Sequence[Contender], shared_time: dict[str, Any] | None
) -> dict[str, Any]:
    """Everything that a repetition needs, and no runs yet."""
    manifests = {
        seed: manifest_of(
            Plan(
                contenders[0].tracker, "", contenders[0].settings, seed, comparison.init,
                comparison.first, comparison.last, start,
            ),
            comparison.session, comparison.camera, comparison.command,
        )
        for seed, start in comparison.starts.items()
    }  # fmt: skip
    one = next(iter(manifests.values()))
    return {
        "format": "spf-compare",
        "version": 1,
        "spf_version": __version__,
        "command": comparison.command,
        "created": datetime.datetime.now(datetime.UTC).isoformat(timespec="seconds"),
        "complete": False,
        **{name: one[name] for name in ("session", "init", "frames", "platform", "packages")},
        "seeds": list(comparison.starts),
        "starts": {str(seed): manifest["start"] for seed, manifest in manifests.items()},
        "contenders": [contender.to_dict() for contender in contenders],
        "equal_time": shared_time,
        "runs": [],
    }


def _write(content: dict[str, Any], directory: Path) -> None:
    part = directory / (COMPARISON + ".part")
    try:
        part.write_text(json.dumps(content, indent=1) + "\n", encoding="utf-8")
        part.replace(directory / COMPARISON)
    except OSError as error:
        raise RunError(f"{directory / COMPARISON} cannot be written: {error.strerror}.") from None
