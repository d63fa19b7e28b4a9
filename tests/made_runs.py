"""Small runs whose track is known: the truth of a synthetic session, with a loss and an error put in on purpose."""

from __future__ import annotations

import numpy as np

from spf.hand import HandShape
from spf.hand.kinematics import joints_of
from spf.initialise import Start
from spf.manifest import Plan, manifest_of
from spf.runs import Run, RunWriter
from spf.sessions import Session
from spf.synthetic import SyntheticSettings, synthesise
from spf.track import TrackedFrame
from spf.trackers import make_settings
from spf.trackfile import row_of, track_of

__all__ = ["LOST", "WORST", "kept_run", "made_run", "made_session"]

#: Frames without a hand, and the one whose pose is off by 30 mm.
LOST, WORST = (4, 5), 2
_NAN = float("nan")


def made_session(frames: int = 8) -> Session:
    return synthesise(SyntheticSettings(frames=frames, seed=3, clutter="forearm"))


def _tracked(session, hand):
    for frame in session:
        pose, lost = frame.truth.pose.copy(), frame.index in LOST
        reference = np.eye(3) if frame.truth.orientation is None else frame.truth.orientation
        pose[0] += 0.03 if frame.index == WORST else 0.0
        timings = {"search": 0.2} if lost else {"observe": 0.01, "optimise": 0.03}
        numbers = (_NAN,) * 4 if lost else (-20.0, 2.5, 0.2, 0.9)
        joints, seconds = joints_of(hand, pose, reference), sum(timings.values())
        found = frame.index == LOST[-1] + 1
        yield TrackedFrame(
            frame.index, frame.time, pose, reference, joints, lost, found, *numbers, seconds, timings, None, None
        )


def made_run(session: Session, *, complete: bool = True, **changes: str) -> Run:
    """A run of a session whose hand is held but for the frames LOST; settings as text."""
    shape = HandShape.from_dict(session.hand_shape, "the session")
    results = list(_tracked(session, shape.hand()))
    start = Start(0, results[0].pose, results[0].reference, shape, 0.1, 0.3)
    plan = Plan("spf", "default", make_settings("spf", "default", changes), 7, "truth", 0, len(session), start)
    manifest = manifest_of(plan, session, None, ["spf", "track", "a session.mcap", "-o", "runs/a"])
    manifest |= {"complete": complete, "frames_tracked": len(results)}
    return Run(manifest, plan, track_of([row_of(result) for result in results], shape.hand().dof_names))


def kept_run(session: Session, directory) -> None:
    """Keep such a run in a directory."""
    run = made_run(session)
    with RunWriter(directory, run.manifest, run.track.dof_names) as writer:
        for result in _tracked(session, run.plan.start.shape.hand()):
            writer.add(result)
