"""Arrays in files, read row by row: NumPy's ``.npy`` and ``.npz``, and HDF5."""

from __future__ import annotations

import math
import struct
import tempfile
import threading
import weakref
import zipfile
import zlib
from abc import ABC, abstractmethod
from pathlib import Path
from typing import IO, Any, NamedTuple

import h5py
import numpy as np
from numpy.lib import format as npy
from numpy.typing import NDArray

from spf.progress import Report, silent

__all__ = ["DAMAGE", "HDF5_MAGIC", "NPY_MAGIC", "ZIP_MAGIC", "ArrayFile", "ArrayInfo", "open_array_file"]

NPY_MAGIC, ZIP_MAGIC, HDF5_MAGIC = b"\x93NUMPY", b"PK\x03\x04", b"\x89HDF\r\n\x1a\n"

#: What damaged bytes make the libraries raise.
DAMAGE = (
    OSError, ValueError, TypeError, LookupError, RuntimeError, EOFError, OverflowError, MemoryError, SyntaxError,
    NotImplementedError, RecursionError, zipfile.BadZipFile, zlib.error, struct.error,
)  # fmt: skip

_LARGEST_SMALL = 2**26  # bytes of an array that is read whole
_LARGEST_ROW = 2**28  # bytes of a frame, or of a chunk of HDF5
_CHUNKS_KEPT = 2**26  # bytes of unpacked chunks of HDF5, which may hold a part of each of many frames
_LARGEST_UNPACKED = 2**33  # bytes of a compressed array, which is unpacked to disk
_MOST_OBJECTS = 10_000
_PIECE = 2**18  # bytes unpacked at a time: more of them do not stay in the cache, and take twice the processor time


class ArrayInfo(NamedTuple):
    """An array in a file."""

    shape: tuple[int, ...]
    dtype: np.dtype[Any]

    def __str__(self) -> str:
        return f"{'×'.join(map(str, self.shape)) or 'scalar'} {self.dtype}"


class ArrayFile(ABC):
    """A file of named arrays; may be read from several threads.

    Attributes:
        arrays: name → shape and type.
        values: name → small values that are no arrays (HDF5 attributes).
    """

    arrays: dict[str, ArrayInfo]
    values: dict[str, Any]

    @abstractmethod
    def whole(self, name: str) -> NDArray[Any]:
        """Read a small array. Raises one of ``DAMAGE``."""

    @abstractmethod
    def row(self, name: str, index: int) -> NDArray[Any]:
        """Read ``array[index]``. Raises one of ``DAMAGE``."""

    def prepare(self, name: str, report: Report) -> None:  # noqa: B027 - only what is packed has to be
        """Get the rows of an array ready to be read, and report how far that is. Raises one of ``DAMAGE``."""

    def _check_small(self, name: str) -> None:
        info = self.arrays[name]
        if math.prod(info.shape) * info.dtype.itemsize > _LARGEST_SMALL or info.dtype.hasobject:
            raise ValueError(f"{name} is too large")

    def close(self) -> None:  # noqa: B027 - only HDF5 holds its file open
        """Close what is held open."""


class _Member(NamedTuple):
    """Where the content of an array begins in which file, and a lock for who reads it."""

    file: IO[bytes] | Path
    start: int


class NumpyFile(ArrayFile):
    """An ``.npy`` file (its array is called ``depth``) or an ``.npz`` file.

    Compressed arrays with more than one dimension are unpacked into a temporary file when they are first read.
    """

    def __init__(self, path: Path) -> None:
        self._path, self._lock = path, threading.Lock()
        self._unpacked: dict[str, _Member] = {}
        self.arrays, self.values = {}, {}
        with path.open("rb") as file:
            if file.read(len(NPY_MAGIC)) == NPY_MAGIC:
                file.seek(0)
                self.arrays["depth"], start = _read_header(file)
                self._unpacked["depth"] = _Member(path, start)
                return
        with zipfile.ZipFile(path) as archive:
            for member in archive.infolist()[:_MOST_OBJECTS]:
                if member.filename.endswith(".npy"):
                    with archive.open(member) as packed:
                        self.arrays[member.filename.removesuffix(".npy")], _ = _read_header(packed)

    def whole(self, name: str) -> NDArray[Any]:
        """Read a small array."""
        self._check_small(name)
        with zipfile.ZipFile(self._path) as archive, archive.open(f"{name}.npy") as packed:
            return np.asarray(npy.read_array(packed, allow_pickle=False))

    def row(self, name: str, index: int) -> NDArray[Any]:
        """Read ``array[index]``."""
        info = self.arrays[name]
        shape = info.shape[1:]
        size = math.prod(shape) * info.dtype.itemsize
        if size > _LARGEST_ROW:
            raise ValueError(f"a frame of {size} bytes")
        self.prepare(name, silent)
        with self._lock:
            member = self._unpacked[name]
            if isinstance(member.file, Path):
                with member.file.open("rb") as file:
                    data = _read_at(file, member.start + index * size, size)
            else:
                data = _read_at(member.file, member.start + index * size, size)
        return np.frombuffer(data, info.dtype).reshape(shape)

    def prepare(self, name: str, report: Report) -> None:
        """Unpack an array, if it is packed and was not yet."""
        with self._lock:
            if name not in self._unpacked:
                self._unpacked[name] = self._unpack(name, report)

    def _unpack(self, name: str, report: Report) -> _Member:
        info = self.arrays[name]
        with zipfile.ZipFile(self._path) as archive:
            member = archive.getinfo(f"{name}.npy")
            if member.compress_type == zipfile.ZIP_STORED:
                with self._path.open("rb") as file:
                    local = _read_at(file, member.header_offset, 30)
                    name_size, extra_size = struct.unpack_from("<HH", local, 26)
                    file.seek(member.header_offset + 30 + name_size + extra_size)
                    return _Member(self._path, _read_header(file)[1])
            left = size = math.prod(info.shape) * info.dtype.itemsize
            if size > _LARGEST_UNPACKED:
                raise ValueError(f"{name} unpacks to {size} bytes: save it with np.savez, uncompressed")
            target = tempfile.TemporaryFile(prefix="spf-")  # noqa: SIM115 - read from until the session is gone
            weakref.finalize(self, target.close)
            with archive.open(member) as packed:
                _read_header(packed)
                while left > 0:
                    piece = packed.read(min(left, _PIECE))
                    if not piece:
                        raise EOFError
                    target.write(piece)
                    left -= len(piece)
                    report("Unpacking", 1 - left / size)
                packed.read(1)  # at its end the sum of all bytes is checked
        return _Member(target, 0)


class Hdf5File(ArrayFile):
    """An HDF5 file."""

    def __init__(self, path: Path) -> None:
        self._lock = threading.RLock()
        self._file = h5py.File(path, "r", rdcc_nbytes=_CHUNKS_KEPT, rdcc_nslots=10_007)
        self._read_from: dict[str, h5py.Dataset] = {}  # held open: with a dataset, its unpacked chunks are given up
        self.arrays, self.values = {}, dict(_attributes(self._file))
        self._file.visititems(self._meet)

    def _meet(self, name: str, found: Any) -> bool | None:
        if isinstance(found, h5py.Dataset) and found.shape is not None and found.dtype.kind in "uifS":
            if found.external or found.is_virtual:  # an upload could so read any file of the server
                raise ValueError(f"the numbers of {name} lie in other files: copy them into one")
            self.arrays[name] = ArrayInfo(tuple(map(int, found.shape)), found.dtype)
            for key, value in _attributes(found).items():
                self.values.setdefault(key, value)
        return True if len(self.arrays) > _MOST_OBJECTS else None

    def whole(self, name: str) -> NDArray[Any]:
        """Read a small array."""
        self._check_small(name)
        with self._lock:
            return np.asarray(self._file[name][()])

    def row(self, name: str, index: int) -> NDArray[Any]:
        """Read ``array[index]``."""
        with self._lock:
            if name not in self._read_from:
                self._read_from[name] = self._file[name]
            data = self._read_from[name]
            if math.prod(data.chunks or data.shape[1:]) * data.dtype.itemsize > _LARGEST_ROW:
                raise ValueError("chunks too large to be read")
            return np.asarray(data[index])

    def close(self) -> None:
        """Close the file."""
        with self._lock:
            self._file.close()


def open_array_file(path: Path) -> ArrayFile:
    """Open a file of arrays. Raises one of ``DAMAGE``."""
    with path.open("rb") as file:
        return Hdf5File(path) if file.read(len(HDF5_MAGIC)) == HDF5_MAGIC else NumpyFile(path)


def _attributes(found: Any) -> dict[str, Any]:
    return {name: value for name, value in found.attrs.items() if np.size(value) <= 100}


def _read_at(file: IO[bytes], position: int, size: int) -> bytes:
    file.seek(position)
    data = file.read(size)
    if len(data) < size:
        raise EOFError
    return data


def _read_header(file: IO[bytes]) -> tuple[ArrayInfo, int]:
    """Read the header of an array in NumPy's format; returns what it says and where the content begins."""
    version = npy.read_magic(file)
    read = npy.read_array_header_1_0 if version == (1, 0) else npy.read_array_header_2_0
    shape, in_columns, dtype = read(file)
    if (in_columns and len(shape) > 1) or dtype.hasobject:
        raise ValueError("an array in column order or of objects: save it with np.ascontiguousarray")
    return ArrayInfo(tuple(map(int, shape)), dtype), file.tell()
