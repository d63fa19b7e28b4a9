"""``spf mark``: joints that a person marked in a session, listed, exported, imported, and written into its own file."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from spf.cli.console import check_output, open_given, print_json
from spf.cli.sessions import AsJson, CameraFile, Force, SessionPath
from spf.errors import SessionError, SettingError
from spf.sessions import Marks, Session, keep_marks, marks_in
from spf.sessions.marked import path_of
from spf.sessions.marks import count_marks, marks_file, marks_from_csv, marks_to_csv, marks_to_json, merged
from spf.sessions.mcap_marks import embed_marks

__all__ = ["COMMANDS", "mark"]


def mark(
    session: SessionPath,
    import_: Annotated[
        Path | None, typer.Option("--import", metavar="FILE.csv", help="Take marks over: frame,joint,x_m,y_m,z_m.")
    ] = None,
    export: Annotated[Path | None, typer.Option("--export", metavar="FILE.csv", help="Write all marks.")] = None,
    into_session: Annotated[
        bool, typer.Option("--into-session", help="Put the marks into the session's own .mcap file.")
    ] = False,
    list_: Annotated[
        bool, typer.Option("--list", help="List the frames that are marked (done if nothing else is).")
    ] = False,
    camera: CameraFile = None,
    force: Force = False,
    as_json: AsJson = False,
) -> None:
    """Joints marked by hand, which are a session's truth: list them, take them over or give them away as CSV.

    Examples:

        spf mark sessions/open-close.mcap --list

        spf mark recordings/P5 --import p5.csv

        spf mark recordings/P5 --export p5.csv
    """
    if export is not None:
        check_output(export, force)
    with open_given(session, camera) as opened:
        if import_ is not None:
            opened = _imported(opened, import_, force)
        if into_session:
            _embed(opened)
        marks = marks_in(opened)
        if export is not None:
            if not marks:
                raise SessionError(f"No joint of {opened.name} is marked: mark some in the dashboard, or import them.")
            export.write_text(marks_to_csv(marks), encoding="utf-8")
            print(f"Wrote {_told(marks)} to {export}.")
        if list_ or as_json or (import_ is None and export is None and not into_session):
            _list(marks, as_json)


def _imported(session: Session, path: Path, force: bool) -> Session:
    """Take marks over from a CSV file; those that are there already stay, or are replaced if that is allowed."""
    try:
        text = path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise SessionError(f"{path} cannot be read ({error}): check its path.") from None
    before, new = marks_in(session), marks_from_csv(text, len(session), str(path))
    changed = [
        f"{name} of frame {frame}" for frame, joints in new.items() for name in joints if name in before.get(frame, {})
    ]
    if changed and not force:
        raise SettingError(
            f"{path} marks {changed[0]}{f' and {len(changed) - 1} more' if len(changed) > 1 else ''}, which is marked already: "
            "export those marks first, then replace them with --force."
        )
    kept = keep_marks(session, merged(before, new))
    print(f"Took {_told(new)} over into {marks_file(path_of(session))}.")
    return kept


def _embed(session: Session) -> None:
    path, size = path_of(session), (session.camera.width, session.camera.height)
    if session.format != "mcap":
        raise SessionError(
            f"{path} ({session.format}) is only read: 'spf convert {path} OUT.mcap' makes a file with its marks."
        )
    embed_marks(path, marks_to_json(marks_in(session), len(session), size))
    marks_file(path).unlink(missing_ok=True)
    print(f"{_told(marks_in(session)).capitalize()} are in {path}; all that was recorded is as it was.")


def _told(marks: Marks) -> str:
    frames, joints = count_marks(marks)
    return f"{joints} joint{'s' * (joints != 1)} of {frames} frame{'s' * (frames != 1)}"


def _list(marks: Marks, as_json: bool) -> None:
    """Print frame after frame which joints are marked, and which hidden."""
    rows: list[dict[str, Any]] = [
        {
            "frame": frame,
            "marked": [name for name, one in joints.items() if one.point is not None],
            "hidden": [name for name, one in joints.items() if one.point is None],
        }
        for frame, joints in marks.items()
    ]
    if as_json:
        print_json(rows)
        return
    for row in rows:
        hidden = f"; hidden: {', '.join(row['hidden'])}" if row["hidden"] else ""
        print(f"frame {row['frame']:>5}  {len(row['marked']):>2} joints: {', '.join(row['marked']) or 'none'}{hidden}")
    print(f"Marked by hand: {_told(marks)}.")


COMMANDS = (mark,)
