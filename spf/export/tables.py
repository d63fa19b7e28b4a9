"""A track as CSV or Parquet: one row a frame, the same named columns in both."""

from __future__ import annotations

from pathlib import Path

import pyarrow as pa
from pyarrow import csv

from spf.errors import RunError
from spf.export.writing import written_whole
from spf.trackfile import Track, table_of, write_track

__all__ = ["TABLES", "write_table"]

#: Endings of the files that a track can be written as.
TABLES = (".csv", ".parquet")


def write_table(track: Track, path: Path) -> None:
    """Write a track in metres, radians and seconds; what is not known in a frame is an empty cell of the CSV.

    Args:
        track: of a run.
        path: that ends in ``.csv`` or ``.parquet``.

    Raises:
        RunError: the ending is another, or the file cannot be written.
    """
    if path.suffix == ".parquet":
        write_track(track, path)
    elif path.suffix == ".csv":
        with written_whole(path) as part:
            csv.write_csv(_without_nan(table_of(track)), part)
    else:
        raise RunError(f"A track is written as {' or '.join(TABLES)}, not as '{path.suffix}': name {path} otherwise.")


def _without_nan(table: pa.Table) -> pa.Table:
    return pa.table({name: pa.array(table.column(name).to_numpy(), from_pandas=True) for name in table.column_names})
