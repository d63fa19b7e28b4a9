"""``spf info``, ``spf convert``, ``spf synth``: sessions looked at, converted and made."""

from __future__ import annotations

import datetime
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer

from spf.cli.console import (
    INTERRUPTED,
    check_session_output,
    complain,
    open_given,
    parse_assignments,
    parse_range,
    print_json,
    progress_bar,
)
from spf.errors import SettingError
from spf.segmentation import find_regions
from spf.sessions import Session, copy_frames, copying
from spf.synthetic import CLUTTER, MOTIONS, SENSORS, SHAPES, SyntheticSettings, synthesise

__all__ = ["COMMANDS", "convert", "info", "split", "synth", "trim"]

SessionPath = Annotated[
    str, typer.Argument(metavar="SESSION", help="A recording, a file or a folder (docs/formats.md).")
]
CameraFile = Annotated[
    Path | None, typer.Option("--camera", metavar="FILE", help="Camera file, where none or a wrong one is recorded.")
]
AsJson = Annotated[bool, typer.Option("--json", help="Print JSON.")]
Force = Annotated[bool, typer.Option("--force", help="Replace what is there.")]
_LOOKED_AT = 7


def info(session: SessionPath, camera: CameraFile = None, as_json: AsJson = False) -> None:
    """Say what a session holds, and whether its depth is believable.

    Example:  spf info sessions/open-close.mcap --json
    """
    with open_given(session, camera) as opened:
        facts = _facts(opened)
    if as_json:
        print_json(facts)
        return
    width = max(len(name) for name in facts)
    for name, value in facts.items():
        print(f"{name.replace('_', ' '):<{width}}  {_readable(value, width + 2)}")


def _readable(value: Any, indent: int) -> str:
    """Write a fact for people: several numbers on a line, several texts on a line each."""
    if isinstance(value, dict):
        value = [f"{name}: {text}" for name, text in value.items()]
    if isinstance(value, list):
        are_texts = all(isinstance(item, str) for item in value)
        value = ("\n" + " " * indent if are_texts else ", ").join(map(str, value))
    return "–" if value in (None, "") else str(value)


def _facts(session: Session) -> dict[str, Any]:
    camera, times = session.camera, session.times
    indices = sorted({int(i) for i in np.linspace(0, len(session) - 1, _LOOKED_AT)})
    frames = [session[index] for index in indices]
    depths = np.concatenate([frame.depth[frame.depth > 0] for frame in frames])
    low, middle, high = np.percentile(depths, [1, 50, 99]).round(3).tolist() if depths.size else (None, None, None)
    seen = sum(bool(find_regions(frame)) for frame in frames)
    duration = float(times[-1])
    return {
        "name": session.name,
        "format": session.format,
        "frames": len(session),
        "recorded": _utc(session.start_time_ns),
        "duration_s": round(duration, 3),
        "frames_per_second": round((len(session) - 1) / duration, 2) if duration > 0 else None,
        "size": [camera.width, camera.height],
        "camera": camera.model,
        "focal_length_px": [camera.fx, camera.fy],
        "principal_point_px": [camera.cx, camera.cy],
        "depth_unit_m": session.depth_unit,
        "depth_m": [low, middle, high],
        "hand_sized_surface": f"in {seen} of the {len(frames)} frames looked at",
        "side": session.side,
        "truth": session.joint_definition if session.has_truth else None,
        "marked_by_hand": session.metadata.get("marks"),
        "exact_hand_shape": session.hand_shape is not None,
        "sensor": session.metadata.get("sensor"),
        "contents": list(session.contents),
        "details": {name: text for name, text in session.metadata.items() if name not in ("sensor", "marks")},
        "notes": [f"{note.time:.1f} s {note.kind}" + (f": {note.text}" if note.text else "") for note in session.notes],
        "warnings": list(session.warnings),
    }


def _utc(nanoseconds: int) -> str | None:
    if not nanoseconds:
        return None
    return f"{datetime.datetime.fromtimestamp(nanoseconds / 1e9, datetime.UTC):%Y-%m-%d %H:%M:%S} UTC"


def convert(
    session: SessionPath,
    output: Annotated[Path, typer.Argument(metavar="OUT.mcap", help="The file to write.")],
    camera: CameraFile = None,
    frames: Annotated[str | None, typer.Option(metavar="A:B", help="Only frames A to B−1.")] = None,
    force: Force = False,
) -> None:
    """Convert any session to the native format, truth and colour included.

    Example:  spf convert recordings/P5 P5.mcap --frames 0:200
    """
    check_session_output(output, force)
    with open_given(session, camera) as opened:
        first, last = parse_range(frames, len(opened))
        _write(opened, output, first, last)
    print(f"Wrote {last - first} frames to {output}.")


def trim(
    session: SessionPath,
    frames: Annotated[str, typer.Argument(metavar="A:B", help="Frames A to B−1; either may be left out.")],
    output: Annotated[Path, typer.Argument(metavar="OUT.mcap", help="The file to write.")],
    camera: CameraFile = None,
    force: Force = False,
) -> None:
    """Keep a part of a session: its depth, colour, truth, times and notes as they are.

    Example:  spf trim sessions/open-close.mcap 20:80 middle.mcap
    """
    convert(session, output, camera, frames, force)


def split(
    session: SessionPath,
    output: Annotated[Path, typer.Argument(metavar="OUT.mcap", help="Parts are named OUT-1.mcap, OUT-2.mcap, ….")],
    at: Annotated[str, typer.Option(metavar="A,B,…", help="First frames of the parts after the first.")],
    camera: CameraFile = None,
    force: Force = False,
) -> None:
    """Split a session before some of its frames; every frame is in one part.

    Example:  spf split sessions/open-close.mcap part.mcap --at 40,80
    """
    with open_given(session, camera) as opened:
        bounds = [0, *_cuts(at, len(opened)), len(opened)]
        parts = [output.with_name(f"{output.stem}-{number}.mcap") for number in range(1, len(bounds))]
        for part in parts:
            check_session_output(part, force)
        for part, first, last in zip(parts, bounds[:-1], bounds[1:], strict=True):
            _write(opened, part, first, last)
            print(f"Wrote {last - first} frames to {part}.")


def _cuts(text: str, count: int) -> list[int]:
    try:
        cuts = [int(word) for word in text.split(",")]
    except ValueError:
        raise SettingError(f"--at takes frames like 40,80, not '{text}'.") from None
    if not all(before < after for before, after in zip([0, *cuts], [*cuts, count], strict=True)):
        raise SettingError(f"--at takes increasing frames from 1 to {count - 1}, not '{text}'.")
    return cuts


def _write(session: Session, output: Path, first: int, last: int) -> None:
    """Write frames under another name until all are written; Ctrl-C ends it with those written until then.

    Raises:
        SessionError: a frame cannot be read or written; then nothing is kept.
        typer.Exit: Ctrl-C was pressed.
    """
    stopped = False
    with copying(session, output, overwrite=True) as writer, progress_bar() as report:
        try:
            copy_frames(
                session, writer, first, last, lambda done, count: report(f"Writing {output.name}", done / count)
            )
        except KeyboardInterrupt:
            if not len(writer):  # a session without frames is none
                raise
            stopped = True
    if stopped:
        complain(f"stopped: about {len(writer)} frames were written until now and are kept in {output}.")
        raise typer.Exit(INTERRUPTED)


def _names(table: Any) -> str:
    return ", ".join(table)


def synth(
    output: Annotated[Path, typer.Argument(metavar="OUT.mcap", help="The file to write.")],
    motion: Annotated[str, typer.Option(help=f"What the hand does: {_names(MOTIONS)}.")] = "open_close",
    sensor: Annotated[str, typer.Option(help=f"What sees it: {_names(SENSORS)}.")] = "senz3d",
    clutter: Annotated[str, typer.Option(help=f"What else is there: {_names(CLUTTER)}.")] = "forearm",
    frames: Annotated[int, typer.Option(help="Number of frames.")] = 120,
    speed: Annotated[float, typer.Option(help="Mean motion of the joints a frame, mm (4 slow, 9, 16 fast).")] = 9.0,
    side: Annotated[str, typer.Option(help="Which hand: right, left.")] = "right",
    shape: Annotated[str, typer.Option(help=f"Shape of the hand: {_names(SHAPES)}, random.")] = "standard",
    seed: Annotated[int, typer.Option(help="Seed of everything random.")] = 0,
    assignments: Annotated[
        list[str] | None,
        typer.Option(
            "--set",
            metavar="NAME=VALUE",
            help=f"Any setting of {_names(info.name for info in SyntheticSettings.describe())}; repeatable.",
        ),
    ] = None,
    force: Force = False,
) -> None:
    """Make a synthetic session with exact truth.

    Example:  spf synth wave.mcap --motion wave --sensor kinect2 --frames 200 --seed 1 --set holes=0.05
    """
    check_session_output(output, force)
    named = {"motion": motion, "sensor": sensor, "clutter": clutter, "side": side, "shape": shape}
    settings = SyntheticSettings().replace(frames=frames, speed_mm=speed, seed=seed, **named)
    session = synthesise(settings.with_text(parse_assignments(assignments or [])))
    _write(session, output, 0, len(session))
    print(f"Wrote {len(session)} frames of a {session.side} hand to {output}.\nNext: spf track {output} -o RUN")


COMMANDS = (info, convert, trim, split, synth)
