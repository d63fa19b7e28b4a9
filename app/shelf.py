"""The shelf of runs: a folder with one folder for each, laid out as ``spf track -o`` does, never written over."""

from __future__ import annotations

import datetime
import io
import re
import zipfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

from app.folders import runs_folder
from app.lane import Lane, Origin
from app.results import Results
from spf.errors import RunError
from spf.initialise import Start
from spf.manifest import Change, Plan, manifest_of, read_manifest, write_manifest
from spf.progress import Report
from spf.runs import MANIFEST, TRACK, Run, check_same_session, read_run, save_run, tracking_at
from spf.sessions import Session
from spf.statefile import read_states, write_states
from spf.track import begin
from spf.trackfile import TrackRow, rows_of, track_of

__all__ = ["Kept", "Shelf", "plan_of_lane", "reopen", "run_of"]

STATES = "states.npz"
_FILES = (MANIFEST, TRACK, STATES)


class Kept(NamedTuple):
    """A run on the shelf.

    Attributes:
        run: name of its folder.
        label: for people.
        manifest: as it was written.
    """

    run: str
    label: str
    manifest: dict[str, Any]


class Shelf:
    """Keeps runs.

    Args:
        folder: of all runs; ``SPF_RUNS``, or ``runs`` in the working directory, when it is not given.
    """

    def __init__(self, folder: Path | None = None) -> None:
        self.folder = runs_folder() if folder is None else folder

    def runs(self) -> tuple[Kept, ...]:
        """Return the runs, the newest first; one that is damaged says so for a label, and has no manifest."""
        if not self.folder.is_dir():
            return ()
        found = []
        for path in self.folder.iterdir():
            if (path / MANIFEST).is_file():
                try:
                    manifest = read_manifest(path / MANIFEST)
                    found.append(Kept(path.name, _label(manifest), manifest))
                except RunError as error:
                    found.append(Kept(path.name, str(error), {}))
        return tuple(sorted(found, key=lambda kept: (str(kept.manifest.get("created")), kept.run), reverse=True))

    def path(self, run: str) -> Path:
        """Return the folder of a run.

        Raises:
            RunError: there is none of this name.
        """
        if run in ("", "..") or Path(run).name != run or not (self.folder / run / MANIFEST).is_file():
            raise RunError(f"There is no run '{run}' in {self.folder}: choose one from the list of runs.")
        return self.folder / run

    def new(self, session: str, tracker: str) -> str:
        """Make a folder for a run and return its name.

        Raises:
            RunError: it cannot be made.
        """
        stamp = datetime.datetime.now().strftime("%Y%m%d-%H%M%S")
        base = re.sub(r"[^A-Za-z0-9._-]+", "-", f"{session}-{tracker}-{stamp}")
        for number in range(1, 1000):
            name = base if number == 1 else f"{base}-{number}"
            try:
                (self.folder / name).mkdir(parents=True)
            except FileExistsError:
                continue
            except OSError as error:
                raise RunError(
                    f"The run cannot be kept in {self.folder} ({error.strerror}): make it writable, or set SPF_RUNS."
                ) from None
            return name
        raise RunError(f"The folder {self.folder} holds too many runs of this second: try again.")

    def write(self, run: str, label: str, plan: Plan, session: Session, camera: str, results: Results) -> None:
        """Write a run into its folder.

        Raises:
            RunError: it cannot be written.
        """
        folder, made = self.folder / run, run_of(plan, session, camera, label, results.rows)
        write_states(results.states, folder / STATES)
        save_run(folder, made.manifest, made.track, complete=True)

    def rename(self, run: str, label: str) -> None:
        """Give a run another name for people."""
        path = self.path(run) / MANIFEST
        write_manifest(read_manifest(path) | {"name": label}, path)

    def delete(self, run: str) -> None:
        """Delete a run; other files in its folder stay.

        Raises:
            RunError: it cannot be deleted.
        """
        folder = self.path(run)
        try:
            for name in _FILES:
                (folder / name).unlink(missing_ok=True)
            if not any(folder.iterdir()):
                folder.rmdir()
        except OSError as error:
            raise RunError(f"The run {folder} cannot be deleted: {error.strerror}.") from None

    def archive(self, run: str) -> io.BytesIO:
        """Return a run's folder as a ``.zip``; unpacked, it opens with ``spf evaluate``."""
        folder, packed = self.path(run), io.BytesIO()
        with zipfile.ZipFile(packed, "w", zipfile.ZIP_DEFLATED) as archive:
            for name in _FILES:
                if (folder / name).exists():
                    archive.write(folder / name, f"{run}/{name}")
        packed.seek(0)
        return packed


def _label(manifest: dict[str, Any]) -> str:
    return str(manifest.get("name") or f"{manifest['tracker']} · {manifest['preset']}")


def run_of(plan: Plan, session: Session, camera: str, label: str, rows: Sequence[TrackRow]) -> Run:
    """Return what a page has tracked as a run, like one that was read from its folder.

    Raises:
        SessionError: a frame cannot be read (for the session's fingerprint).
    """
    manifest = manifest_of(plan, session, Path(camera) if camera else None, ["panel", "serve", "app"])
    manifest |= {"name": label, "complete": True, "frames_tracked": len(rows)}
    return Run(manifest, plan, track_of(rows, plan.start.shape.hand().dof_names))


def plan_of_lane(lane: Lane, origin: Origin, init: str) -> Plan:
    """Return what repeats what a lane has tracked, changes on the way included."""
    summaries = lane.results.summaries
    first, changes, now = summaries[0].tracking, [], summaries[0].tracking
    for summary in summaries[1:]:
        how = summary.tracking
        if (how.tracker, how.settings, how.seed) != (now.tracker, now.settings, now.seed):
            changes.append(Change(summary.frame, how.tracker, how.settings, how.seed))
        now = how
    start: Start = (lane.reopened or origin).start
    return Plan(
        first.tracker, lane.preset, first.settings, first.seed, init, start.frame, summaries[-1].frame + 1, start,
        tuple(changes),
    )  # fmt: skip


def reopen(shelf: Shelf, name: str, session: Session, report: Report) -> tuple[Run, Results, Origin]:
    """Read a run of a session back.

    Raises:
        RunError: it is missing, damaged, or of another recording.
    """
    folder = shelf.path(name)
    run = read_run(folder)
    check_same_session(run.manifest, session)
    plan = run.plan
    rows = [row for row in rows_of(run.track) if row.result.index >= plan.start.frame]
    if not rows:
        raise RunError(f"The run {name} has tracked no frame: delete it, and track the session again.")
    origin = Origin(plan.start, float(session.times[plan.start.frame]), plan.seed)
    tracking, _ = begin(plan.tracker, plan.settings, plan.start, plan.seed, time=origin.time)

    states = read_states(folder / STATES)
    results = Results.reopened(rows, states, lambda index: tracking_at(plan, tracking, index), session, report)
    return run, results, origin
