"""The only numba code of the project. Imports nothing of ours but its siblings; randomness comes in from outside."""

import os
from contextlib import suppress
from pathlib import Path


def _forget_stale_machine_code() -> None:
    """Delete compiled kernels that are older than the newest source file here.

    Numba's cache compares a function only with its own file. A kernel with another file's functions compiled into it
    would outlive their change, and a ``git pull`` would go on running the old mathematics.
    """
    here = Path(__file__).parent
    compiled = here / "__pycache__"
    if not os.access(compiled, os.W_OK):
        return
    newest = max(source.stat().st_mtime for source in here.glob("*.py"))
    for index in compiled.glob("*.nbi"):
        with suppress(FileNotFoundError):  # another process has just done it
            if index.stat().st_mtime < newest:
                index.unlink()


_forget_stale_machine_code()
