"""One case: damage a file of a good recording, open it and read it, and say what came of it."""

from __future__ import annotations

import shutil
from pathlib import Path
from typing import NamedTuple

import numpy as np

from benchmarks.fuzz.damage import damaged
from spf.errors import SessionError
from spf.sessions import open_session

__all__ = ["Outcome", "read_recording", "run_case"]

_READ = 6  # frames of a session that opens


class Outcome(NamedTuple):
    """What came of a case.

    Attributes:
        kind: ``refused`` (a SessionError, and which), ``read`` (frames, and any damage told), or ``WRONG``.
        text: the sentence, or what went wrong.
    """

    kind: str
    text: str


def run_case(good: Path, seed: int, work: Path) -> Outcome:
    """Damage a copy of a recording in a way that the seed says, and read it.

    Args:
        good: path of the recording: a file or a folder.
        seed: of the damage.
        work: a folder for the copy, made anew.
    """
    rng = np.random.default_rng(seed)
    shutil.rmtree(work, ignore_errors=True)
    work.mkdir(parents=True)
    target = work / good.name
    if good.is_dir():
        shutil.copytree(good, target)
        files = sorted(path for path in target.rglob("*") if path.is_file())
        # Half of the cases hit a list or a camera file, of which there are few.
        lists = [path for path in files if path.suffix in (".txt", ".json", ".yaml", ".mat")]
        victim = files[rng.integers(len(files))] if not lists or rng.random() < 0.5 else lists[rng.integers(len(lists))]
        name, content = damaged(rng, victim.read_bytes())
        victim.write_bytes(content)
    else:
        name, content = damaged(rng, good.read_bytes())
        target.write_bytes(content)
    return read_recording(target, name)


def read_recording(path: Path, name: str) -> Outcome:
    """Open a recording and read some of its frames.

    Args:
        path: of the recording.
        name: of its damage, for the text.
    """
    try:
        with open_session(path) as session:
            refused = 0
            for index in np.unique(np.linspace(0, len(session) - 1, _READ).astype(int)).tolist():
                try:
                    frame = session[index]
                except SessionError:
                    refused += 1
                    continue
                if (
                    frame.depth.shape != (session.camera.height, session.camera.width)
                    or not np.isfinite(frame.depth).all()
                ):
                    return Outcome("WRONG", f"{name}: frame {index} is {frame.depth.shape}, or not finite")
            if not (np.diff(session.times_ns) > 0).all():
                return Outcome("WRONG", f"{name}: times do not increase")
            return Outcome("read", f"{refused} frames refused; {' '.join(session.warnings)}")
    except SessionError as error:
        sentence = str(error)
        return Outcome("refused", sentence) if sentence.strip() else Outcome("WRONG", f"{name}: an empty sentence")
    except BaseException as error:  # whatever else is raised is what this looks for
        return Outcome("WRONG", f"{name}: {type(error).__name__}: {error}")
