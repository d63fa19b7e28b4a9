"""One array of a MATLAB file. SciPy follows a damaged type of data out of its table and crashes: types are checked first."""

from __future__ import annotations

import struct
import zlib
from pathlib import Path

import numpy as np
import scipy.io
from numpy.typing import NDArray

from spf.errors import SessionError

__all__ = ["read_mat_array"]

_HEADER, _TAG = 128, 8
_MATRIX, _COMPRESSED = 14, 15
_TYPES = range(1, 19)
_PARTS = 4  # of an array: flags, sizes, name, numbers
_HEAD = 4096  # bytes that hold the tags of all parts of an array of numbers


def read_mat_array(path: Path, name: str) -> NDArray[np.float64]:
    """Read an array of numbers from a MATLAB 5 to 7 file.

    Raises:
        SessionError: the file is damaged or holds no such array.
    """
    try:
        _check_types(path.read_bytes())
        return np.asarray(scipy.io.loadmat(path, variable_names=[name])[name], dtype=np.float64)
    except Exception as error:  # scipy's reader raises nearly anything on a torn file
        raise SessionError(f"The file {path} is damaged or holds no {name}: copy it again.") from error


def _check_types(data: bytes) -> None:
    order = {b"IM": "<", b"MI": ">"}[data[_HEADER - 2 : _HEADER]]
    position = _HEADER
    while position + _TAG <= len(data):
        kind, size = struct.unpack_from(f"{order}II", data, position)
        start = position + _TAG
        if kind == _COMPRESSED:
            head = zlib.decompressobj().decompress(data[start : start + size], _HEAD)
            _check_array(head[_TAG:], order)
        elif kind == _MATRIX:
            _check_array(data[start : start + min(size, _HEAD)], order)
        else:
            raise ValueError(kind)
        position = start + size


def _check_array(head: bytes, order: str) -> None:
    position = 0
    for _ in range(_PARTS):
        kind, size = struct.unpack_from(f"{order}II", head, position)
        short = kind >> 16  # of up to 4 bytes, which then stand in the tag
        if kind & 0xFFFF not in _TYPES or short > 4:
            raise ValueError(kind)
        position += _TAG if short else _TAG + (size + 7) // 8 * 8
