"""``spf calibrate`` and ``spf track``: a hand measured, a session tracked, a run repeated."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer

from spf.cli.console import (
    INTERRUPTED,
    check_output,
    complain,
    open_given,
    parse_assignments,
    parse_range,
    print_json,
    progress_bar,
    warn,
    warn_of,
)
from spf.cli.live import Seconds, Wait
from spf.cli.live_track import track_live
from spf.cli.sessions import AsJson, CameraFile, Force, SessionPath
from spf.errors import RunError, SettingError
from spf.evaluate import count_losses
from spf.hand import SavedPose, read_hand_shape, write_hand_shape, write_pose
from spf.initialise import Start
from spf.learned.network import available_network
from spf.live import is_live
from spf.live.tracking import Request
from spf.manifest import Plan, manifest_of
from spf.prepare import prepare
from spf.presets import chosen_settings
from spf.runs import RECORDING, RunWriter, check_free, read_run, reopen_session, track_plan
from spf.sessions import Session
from spf.trackers import PRESETS, TRACKERS
from spf.trackfile import Track

__all__ = ["COMMANDS", "calibrate", "track"]

HandFile = Annotated[
    Path | None, typer.Option("--hand", metavar="HAND.json", help="Shape of the hand; found if not given.")
]
FrameRange = Annotated[str | None, typer.Option("--frames", metavar="A:B", help="Only frames A to B−1.")]
Init = Annotated[str, typer.Option(metavar="auto|truth|POSE.json", help="Where the first pose comes from.")]


def calibrate(
    session: SessionPath,
    output: Annotated[Path, typer.Option("--output", "-o", metavar="HAND.json", help="The hand file to write.")],
    pose: Annotated[Path | None, typer.Option(metavar="POSE.json", help="Write the first pose too.")] = None,
    init: Init = "auto",
    frames: FrameRange = None,
    seed: Annotated[int, typer.Option(min=0, help="Seed of everything random.")] = 0,
    camera: CameraFile = None,
    force: Force = False,
) -> None:
    """Measure a hand's side, size and shape from the depth of its session.

    Example:  spf calibrate recordings/P5 -o p5-hand.json
    """
    for path in (output, pose):
        if path is not None:
            check_output(path, force)
    with open_given(session, camera) as opened, progress_bar() as report:
        first, last = parse_range(frames, len(opened))
        start = prepare(opened, init=init, seed=seed, first=first, last=last, progress=report)
    write_hand_shape(start.shape, output)
    if pose is not None:
        write_pose(SavedPose(start.shape.side, start.pose, start.reference, start.frame, start.shape), pose)
    print(_description(start))
    warn_of(start)
    print(f"Wrote {output}.\nNext: spf track {session} --hand {output} -o RUN")


def _description(start: Start) -> str:
    length = start.shape.hand().length * 1e3
    return (
        f"A {start.shape.side} hand of {length:.0f} mm from wrist to middle fingertip (scale {start.shape.scale:.3f}), "
        f"first believed in frame {start.frame}; unexplained depth {start.golden:.2f}."
    )


def track(
    output: Annotated[Path, typer.Option("--output", "-o", metavar="DIR", help="Directory of the run.")],
    session: Annotated[
        str | None,
        typer.Argument(
            metavar="SESSION",
            help="A recording, a file or a folder (docs/formats.md), or a live sensor (spf record --help).",
        ),
    ] = None,
    tracker: Annotated[str | None, typer.Option(help=f"One of {', '.join(TRACKERS)}; spf if not given.")] = None,
    preset: Annotated[
        str | None,
        typer.Option(
            metavar="NAME|FILE.json",
            help=f"One of {', '.join(PRESETS)}, one saved in the page, or its file; default if not given.",
        ),
    ] = None,
    assignments: Annotated[
        list[str] | None,
        typer.Option("--set", metavar="NAME=VALUE", help="Change a setting, as --set k=3 --set n=4; repeatable."),
    ] = None,
    hand: HandFile = None,
    init: Annotated[
        str | None,
        typer.Option(metavar="auto|truth|POSE.json", help="Where the first pose comes from; auto if not given."),
    ] = None,
    frames: FrameRange = None,
    seed: Annotated[int | None, typer.Option(min=0, help="Seed of everything random; 0 if not given.")] = None,
    camera: CameraFile = None,
    seconds: Seconds = None,
    wait: Wait = False,
    repeat: Annotated[Path | None, typer.Option(metavar="DIR", help="Repeat this run, bit for bit.")] = None,
    force: Force = False,
    as_json: AsJson = False,
) -> None:
    """Track the hand of a session or a live sensor; the track and all that is needed to repeat it go to a directory.

    A live sensor is recorded into that directory, too (docs/live.md).

    Examples:

        spf track sessions/open-close.mcap -o runs/a

        spf track recordings/P5 -o runs/b --preset paper --set n=16 --frames 0:300 --seed 3

        spf track recordings/P5 -o runs/mine --preset "presets/my hand.spf.json"

        spf track --repeat runs/b -o runs/c

        spf track realsense: -o runs/live --seconds 60
    """
    check_free(output, force)
    warn(available_network()[1])
    live: dict[str, Any] = {}
    if repeat is not None:
        options: dict[str, Any] = {"--tracker": tracker, "--preset": preset, "--set": assignments, "--hand": hand}
        options |= {"--init": init, "--frames": frames, "--seed": seed, "--camera": camera, "--seconds": seconds}
        _refuse_with_repeat([name for name, value in options.items() if value is not None])
        opened, plan, camera, live = _plan_to_repeat(repeat, session)
    elif session is None:
        raise SettingError("There is nothing to track: name a session, as in spf track SESSION -o DIR.")
    elif is_live(session):
        _refuse_live({"--frames": frames, "--camera": camera, "--init": None if init == "auto" else init})
        name, settings = chosen_settings(tracker or "spf", preset or "default", parse_assignments(assignments or []))
        shape = None if hand is None else read_hand_shape(hand)
        request = Request(tracker or "spf", name, settings, seed or 0, shape, None if shape is None else shape.side)
        track_live(
            session, output, output / RECORDING, request, seconds=seconds, wait=wait, force=force, as_json=as_json
        )
        return
    else:
        _refuse_recorded(seconds, wait)
        name, settings = chosen_settings(tracker or "spf", preset or "default", parse_assignments(assignments or []))
        shape = None if hand is None else read_hand_shape(hand)
        opened = open_given(session, camera)
        first, last = parse_range(frames, len(opened))
        with progress_bar() as report:
            start = prepare(
                opened, init=init or "auto", shape=shape, seed=seed or 0, first=first, last=last, progress=report
            )
        plan = Plan(tracker or "spf", name, settings, seed or 0, init or "auto", first, last, start)
    with opened:
        warn_of(plan.start)
        track_found = _track_to(output, opened, plan, camera, force, live)
    _summarise(output, track_found, plan, as_json)


def _refuse_with_repeat(given: list[str]) -> None:
    if given:
        raise SettingError(f"--repeat takes everything from the run that it repeats: leave out {', '.join(given)}.")


def _refuse_live(options: dict[str, Any]) -> None:
    given = [name for name, value in options.items() if value is not None]
    if given:
        raise SettingError(f"A live sensor is tracked from where it is found on: leave out {', '.join(given)}.")


def _refuse_recorded(seconds: float | None, wait: bool) -> None:
    if seconds is not None or wait:
        raise SettingError("--seconds and --wait are for live sensors; give a recording's frames with --frames A:B.")


def _plan_to_repeat(directory: Path, session: str | None) -> tuple[Session, Plan, Path | None, dict[str, Any]]:
    """Return the session, the plan, the camera file and, of a live run, its facts and the frames that it came to."""
    run = read_run(directory)
    with progress_bar() as report:
        opened = reopen_session(run.manifest, session, report)
    stored = run.manifest["session"]["camera_file"]
    now = manifest_of(run.plan, opened, None, [])
    changed = [
        name for name in ("spf_version", "packages", "platform", "network") if now[name] != run.manifest.get(name)
    ]
    if changed:
        warn(f"the run was made with another {' and '.join(changed)}, so that the track may differ in its last digits.")
    live = run.manifest.get("live")
    about_live = {} if live is None else {"live": live, "frames": run.track.frame.tolist()}
    return opened, run.plan, None if stored is None else Path(stored), about_live


def _track_to(
    output: Path, session: Session, plan: Plan, camera: Path | None, force: bool, live: dict[str, Any]
) -> Track:
    """Track a plan into a directory; Ctrl-C ends it with what was tracked until then.

    Raises:
        typer.Exit: Ctrl-C was pressed.
    """
    manifest = manifest_of(plan, session, camera, ["spf", *sys.argv[1:]])
    frames = live.get("frames")
    if frames is not None:
        manifest["live"] = live["live"]
    writer = RunWriter(output, manifest, plan.start.shape.hand().dof_names, overwrite=force)
    count = plan.last - plan.first if frames is None else len(frames)
    try:
        with writer, progress_bar() as report:
            for done, result in enumerate(track_plan(session, plan, frames), 1):
                writer.add(result)
                report("Lost, searching" if result.lost else "Tracking", done / count)
    except KeyboardInterrupt:
        complain(f"stopped: the {len(writer.track)} frames tracked until now are kept in {output}.")
        raise typer.Exit(INTERRUPTED) from None
    if not len(writer.track):
        raise RunError("No frame was tracked.")
    return writer.track


def _summarise(output: Path, track: Track, plan: Plan, as_json: bool) -> None:
    losses = count_losses(track.lost)
    seconds = track.seconds[track.seconds > 0]
    summary: dict[str, Any] = {
        "run": str(output),
        "frames": len(track),
        "losses": losses.losses,
        "frames_lost": losses.frames_lost,
        "seconds_per_frame_median": float(np.median(seconds)),
        "doubt": plan.start.doubt,
    }
    if as_json:
        print_json(summary)
        return
    print(_description(plan.start))
    print(
        f"Tracked {len(track)} frames with {plan.tracker}: {losses.losses} losses, {losses.frames_lost} frames without "
        f"a hand, {summary['seconds_per_frame_median'] * 1e3:.0f} ms a frame (median)."
    )
    print(f"Next: spf evaluate {output}")


COMMANDS = (calibrate, track)
