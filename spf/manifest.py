"""What a run needs to be repeated, bit for bit on the same machine: its plan, and the plan as a small JSON file."""

from __future__ import annotations

import datetime
import json
import platform
from importlib.metadata import version
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from spf import __version__
from spf.errors import RunError, SpfError
from spf.hand.pose_file import SavedPose
from spf.initialise import Start
from spf.learned.network import available_network
from spf.sessions import Session
from spf.settings import Settings
from spf.trackers import TRACKERS

__all__ = ["Change", "Plan", "live_manifest_of", "manifest_of", "plan_of", "read_manifest", "write_manifest"]

_FORMAT = "spf-run"
_PACKAGES = ("numpy", "numba", "scipy", "opencv-python-headless")


class Change(NamedTuple):
    """From a frame on, a run goes on with another tracker, other settings or another seed."""

    frame: int
    tracker: str
    settings: Settings
    seed: int


class Plan(NamedTuple):
    """Everything that a run's result depends on, besides the session's frames.

    Attributes:
        tracker: name in the table of trackers.
        preset: that the settings were made from, for people.
        settings: of the tracker.
        seed: of all randomness.
        init: how the start was made: ``auto``, ``truth`` or a pose file.
        first, last: frames ``[first, last)`` are tracked.
        start: first pose and hand shape.
        changes: on the way, in the order of their frames.
    """

    tracker: str
    preset: str
    settings: Settings
    seed: int
    init: str
    first: int
    last: int
    start: Start
    changes: tuple[Change, ...] = ()


def manifest_of(plan: Plan, session: Session, camera_file: Path | None, command: list[str]) -> dict[str, Any]:
    """Describe a run that begins, ready for JSON.

    Args:
        plan: of the run.
        session: that is tracked.
        camera_file: that it was opened with, if any.
        command: the exact command line.

    Raises:
        SessionError: a frame cannot be read (for the session's fingerprint).
    """
    described: dict[str, Any] = {
        "uri": str(Path(session.uri).resolve()),
        "camera_file": None if camera_file is None else str(camera_file.resolve()),
        "name": session.name,
        "format": session.format,
        "frames": len(session),
        "fingerprint": session.fingerprint(),
        "joint_definition": session.joint_definition,
        "warnings": list(session.warnings),
    }
    return _manifest(plan, described, command)


def live_manifest_of(plan: Plan, recording: Path, command: list[str]) -> dict[str, Any]:
    """Describe a live run that begins, whose recording is not finished: it has no fingerprint and no length yet."""
    described: dict[str, Any] = {
        "uri": str(recording.resolve()),
        "camera_file": None,
        "name": recording.stem,
        "format": "mcap",
        "frames": None,
        "fingerprint": None,
        "joint_definition": "model",
        "warnings": [],
    }
    return _manifest(plan, described, command)


def _manifest(plan: Plan, session: dict[str, Any], command: list[str]) -> dict[str, Any]:
    start, (network, _) = plan.start, available_network()
    saved = SavedPose(start.shape.side, start.pose, start.reference, start.frame, start.shape)
    return {
        "format": _FORMAT,
        "version": 1,
        "spf_version": __version__,
        "command": command,
        "created": datetime.datetime.now(datetime.UTC).isoformat(timespec="seconds"),
        "complete": False,
        "frames_tracked": 0,
        "session": session,
        "tracker": plan.tracker,
        "preset": plan.preset,
        "settings": plan.settings.to_dict(),
        "seed": plan.seed,
        "changes": [{**change._asdict(), "settings": change.settings.to_dict()} for change in plan.changes],
        "init": plan.init,
        "frames": [plan.first, plan.last],
        "start": {"golden": start.golden, "margin": start.margin, "doubt": start.doubt, **saved.to_dict()},
        "platform": {"system": platform.platform(), "python": platform.python_version()},
        "packages": {name: version(name) for name in _PACKAGES},
        "network": None if network is None else network.about.get("sha256"),
    }


def plan_of(manifest: dict[str, Any], source: str = "The manifest") -> Plan:
    """Read a plan back from a manifest.

    Raises:
        RunError: something is missing or does not fit this version.
    """
    try:
        saved = SavedPose.from_dict(manifest["start"], source)
        if saved.shape is None or saved.frame is None:
            raise RunError(f"{source} lacks the hand or the frame of its first pose: track the session again.")
        golden, margin = float(manifest["start"]["golden"]), float(manifest["start"]["margin"])
        start = Start(saved.frame, saved.pose, np.ascontiguousarray(saved.reference), saved.shape, golden, margin)
        settings = TRACKERS[manifest["tracker"]].settings().replace(**manifest["settings"])
        first, last = (int(number) for number in manifest["frames"])
        return Plan(
            manifest["tracker"],
            manifest["preset"],
            settings,
            int(manifest["seed"]),
            manifest["init"],
            first,
            last,
            start,
            tuple(_change_of(change) for change in manifest.get("changes", [])),
        )
    except (KeyError, TypeError, ValueError) as error:
        if isinstance(error, SpfError):
            raise
        raise RunError(f"{source} is damaged or of another version of this program ({error}).") from None


def _change_of(content: dict[str, Any]) -> Change:
    settings = TRACKERS[content["tracker"]].settings().replace(**content["settings"])
    return Change(int(content["frame"]), content["tracker"], settings, int(content["seed"]))


def write_manifest(manifest: dict[str, Any], path: Path) -> None:
    """Write a manifest.

    Raises:
        RunError: the file cannot be written.
    """
    try:
        path.write_text(json.dumps(manifest, indent=2) + "\n", encoding="utf-8")
    except OSError as error:
        raise RunError(f"The manifest {path} cannot be written: {error.strerror}.") from None


def read_manifest(path: Path) -> dict[str, Any]:
    """Read a manifest.

    Raises:
        RunError: the file is missing, torn or no manifest.
    """
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
    except OSError:
        raise RunError(
            f"{path.parent} is no run: it has no {path.name}; make one with 'spf track SESSION -o DIR'."
        ) from None
    except ValueError:
        raise RunError(f"The manifest {path} is torn or not JSON: track the session again.") from None
    if not isinstance(content, dict) or content.get("format") != _FORMAT:
        raise RunError(f"The file {path} is no manifest of a run: track the session again.")
    return content
