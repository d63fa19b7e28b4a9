"""Files that are there whole or not at all."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from spf.errors import RunError

__all__ = ["written_whole"]


@contextmanager
def written_whole(path: Path) -> Iterator[Path]:
    """Give the name of a part file, which takes the place of ``path`` when the block ends well and else goes.

    Raises:
        RunError: the file cannot be written.
    """
    part = path.with_name(f".{path.stem}.part{path.suffix}")  # the ending stays: it tells writers the format
    try:
        yield part
        os.replace(part, path)
    except OSError as error:
        raise RunError(f"{path} cannot be written: {error.strerror or error}.") from None
    finally:
        part.unlink(missing_ok=True)
