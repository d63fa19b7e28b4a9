"""Runs: plan one, track it frame by frame, keep it in a directory (track and manifest), and repeat it."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from types import TracebackType
from typing import Any, NamedTuple, Self

from spf.errors import RunError
from spf.hand.model import Hand
from spf.hand.shape import HandShape, varied
from spf.manifest import Plan, plan_of, read_manifest, write_manifest
from spf.progress import Report, silent
from spf.refine import modelled
from spf.sessions import Session, open_session
from spf.track import TrackedFrame, Tracking, TrackState, begin, run, stated_joints, track_frame
from spf.trackfile import Track, TrackRow, joined, read_track, row_of, track_of, write_track

__all__ = [
    "MANIFEST",
    "RECORDING",
    "TRACK",
    "Run",
    "RunWriter",
    "begin_late",
    "check_same_session",
    "make_directory",
    "read_run",
    "reopen_session",
    "save_run",
    "track_plan",
    "tracking_at",
]

MANIFEST, TRACK = "manifest.json", "track.parquet"
RECORDING = "session.mcap"  # of a live run, unless it is recorded elsewhere
_SAVED_EVERY = 200  # frames that a killed program loses at most


class Run(NamedTuple):
    """A run that was kept.

    Attributes:
        manifest: as it was written.
        plan: to repeat it.
        track: what it found.
    """

    manifest: dict[str, Any]
    plan: Plan
    track: Track

    def hand_at(self, row: int) -> Hand:
        """Return the hand that a row of the track was tracked with: its shape may have been refined on the way."""
        return modelled(self.shape_at(row))[0]

    def shape_at(self, row: int) -> HandShape:
        """Return the shape of that hand."""
        return varied(self.plan.start.shape, self.track.shape_changes[row])


def begin_late(plan: Plan, frame: int, time: float) -> tuple[Tracking, TrackState]:
    """Set up a run that begins some frames after its first pose: the hand has moved on, and is searched for.

    Args:
        plan: of the run.
        frame, time: index and time (s) of the first frame that will be tracked.
    """
    tracking, state = begin(plan.tracker, plan.settings, plan.start, plan.seed, time=time)
    return tracking, state._replace(lost=True, missing=max(frame - plan.start.frame, 0))


def track_plan(session: Session, plan: Plan, frames: Sequence[int] | None = None) -> Iterator[TrackedFrame]:
    """Track the frames of a plan, lazily: stop asking and nothing more is computed.

    Frames before the first pose's are reported as lost, with that pose: no hand was believed in them.

    Args:
        session: to track.
        plan: of the run.
        frames: of a live run that is repeated: those that its tracker came to.

    Raises:
        SessionError: a frame cannot be read.
    """
    if frames is not None:
        late = begin_late(plan, frames[0], float(session.times[frames[0]]))
        yield from run(*late, (session[index] for index in frames))
        return
    began = float(session.times[plan.start.frame])
    tracking, state = begin(plan.tracker, plan.settings, plan.start, plan.seed, time=began)
    joints = stated_joints(tracking, plan.start.pose, plan.start.reference)
    nan = float("nan")
    for index in range(plan.first, plan.start.frame):
        yield TrackedFrame(
            index, float(session.times[index]), plan.start.pose, plan.start.reference, joints, True, False,
            nan, nan, nan, nan, 0.0, {}, None, None,
        )  # fmt: skip
    for index in range(plan.start.frame, plan.last):
        state, result = track_frame(tracking_at(plan, tracking, index), state, session[index])
        yield result


def tracking_at(plan: Plan, tracking: Tracking, frame: int) -> Tracking:
    """Return what a frame of a run is tracked with: what the run began with, and the last change up to there."""
    change = next((change for change in reversed(plan.changes) if change.frame <= frame), None)
    if change is None:
        return tracking
    return tracking._replace(tracker=change.tracker, settings=change.settings, seed=change.seed)


def make_directory(directory: Path) -> None:
    """Make a directory, and those that it lies in, where they are not there yet.

    Raises:
        RunError: it cannot be made.
    """
    try:
        directory.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise RunError(f"The directory {directory} cannot be made: {error.strerror}.") from None


class RunWriter:
    """Keeps a run in a directory while it is tracked; what was tracked when it ends, however it ends, is kept.

    Args:
        directory: to write to; made if it is not there.
        manifest: of the run; ``complete`` and ``frames_tracked`` are set by the writer.
        dof_names: of the poses.
        overwrite: replace a run that is there.

    Raises:
        RunError: there is a run already, or the directory cannot be made.
    """

    def __init__(
        self, directory: Path, manifest: dict[str, Any], dof_names: tuple[str, ...], *, overwrite: bool = False
    ) -> None:
        check_free(directory, overwrite)
        make_directory(directory)
        try:
            (directory / TRACK).unlink(missing_ok=True)
        except OSError as error:
            raise RunError(f"{directory / TRACK} cannot be replaced: {error.strerror}.") from None
        self._directory, self._dof_names = directory, dof_names
        self._manifest = {**manifest, "complete": False, "frames_tracked": 0}
        self._saved = track_of([], dof_names)
        self._rows: list[TrackRow] = []  # that came after those: as rows they take twice the memory
        self._save(complete=False)

    def add(self, result: TrackedFrame) -> None:
        """Add the next frame.

        Raises:
            RunError: the directory cannot be written to any more.
        """
        self._rows.append(row_of(result))
        if len(self._rows) == _SAVED_EVERY:
            self._save(complete=False)

    def describe(self, manifest: dict[str, Any]) -> None:
        """Replace the manifest by one that knows more: that of a live run, once its recording is finished."""
        self._manifest = {**manifest, "complete": False, "frames_tracked": len(self._saved) + len(self._rows)}

    def _save(self, *, complete: bool) -> None:
        self._saved, self._rows = self.track, []
        self._manifest = save_run(self._directory, self._manifest, self._saved, complete=complete)

    @property
    def track(self) -> Track:
        """What was added until now."""
        return joined([self._saved, track_of(self._rows, self._dof_names)])

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._save(complete=kind is None)


def save_run(directory: Path, manifest: dict[str, Any], track: Track, *, complete: bool) -> dict[str, Any]:
    """Write a run into its directory, over what it held of the same run; return the manifest as it was written.

    Raises:
        RunError: the directory cannot be written to.
    """
    write_track(track, directory / TRACK)
    manifest = {**manifest, "complete": complete, "frames_tracked": len(track)}
    write_manifest(manifest, directory / MANIFEST)
    return manifest


def check_free(directory: Path, overwrite: bool) -> None:
    """Check that a run may be written to a directory, before any work is done.

    Raises:
        RunError: there is something else there already.
    """
    if directory.exists() and not directory.is_dir():
        raise RunError(f"{directory} is a file: choose a directory for the run.")
    if not directory.exists() or all(path.name == RECORDING for path in directory.iterdir()):
        return
    if not (directory / MANIFEST).exists():
        raise RunError(f"The directory {directory} holds other things than a run: choose a new one.")
    if not overwrite:
        raise RunError(f"The directory {directory} holds a run already: choose another, or replace it with --force.")


def read_run(directory: Path) -> Run:
    """Read a run.

    Raises:
        RunError: it is missing or damaged.
    """
    manifest = read_manifest(directory / MANIFEST)
    plan = plan_of(manifest, f"The manifest of {directory}")
    return Run(manifest, plan, read_track(directory / TRACK))


def reopen_session(manifest: dict[str, Any], uri: str | Path | None = None, report: Report = silent) -> Session:
    """Open the session of a run again, and check that it is the same recording.

    Args:
        manifest: of the run.
        uri: where the session lies now, if it was moved.
        report: is told how far that is.

    Raises:
        SessionError: it cannot be opened.
        RunError: it is another recording.
    """
    stored = manifest["session"]
    session = open_session(uri or stored["uri"], camera=stored["camera_file"], report=report)
    check_same_session(manifest, session, report)
    return session


def check_same_session(manifest: dict[str, Any], session: Session, report: Report = silent) -> None:
    """Check by its fingerprint that a session is the one that a run tracked.

    Raises:
        RunError: it is another recording.
        SessionError: a frame cannot be read.
    """
    stored = manifest["session"]["fingerprint"]
    if stored is not None and session.fingerprint(report) != stored:  # a live run that was killed has none
        raise RunError(
            f"{session.uri} is not the recording of this run (its fingerprint differs): give the right session."
        )
