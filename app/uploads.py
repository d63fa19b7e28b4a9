"""Uploads: a recording in one file, or a zipped folder, bounded in size and unpacked where nothing else is."""

from __future__ import annotations

import io
import shutil
import tempfile
import zipfile
import zlib
from pathlib import Path, PurePosixPath

from app.folders import uploads_folder
from spf.errors import SessionError

__all__ = ["ENDINGS", "LARGEST_UPLOAD", "Uploads"]

#: Of the files that are taken: every format of a single file, told apart by content, and zipped folders.
ENDINGS = (".mcap", ".bag", ".db3", ".mkv", ".npz", ".npy", ".h5", ".hdf5", ".zip")

LARGEST_UPLOAD = 512 * 2**20  # bytes
_LARGEST_CONTENT = 2 * 2**30  # bytes of everything that a page has uploaded, unpacked
_MOST_FILES = 20_000
_LONGEST_NAME = 200  # bytes


class Uploads:
    """The uploads of one page: temporary folders that go when the page is closed."""

    def __init__(self) -> None:
        self._folders: dict[Path, int] = {}  # and the bytes in each

    def store(self, name: str, content: bytes) -> Path:
        """Write an upload to disk and return the path to open.

        Args:
            name: of the file as the browser gives it; only its last part and its ending matter.
            content: of the file.

        Raises:
            SessionError: its ending is none of :data:`ENDINGS`; it is too large, alone or with what was uploaded before;
                or it is damaged, or reaches out of its folder.
        """
        base = PurePosixPath(name.replace("\\", "/")).name
        ending = PurePosixPath(base).suffix.lower()
        if ending not in ENDINGS or "\0" in base or len(base.encode()) > _LONGEST_NAME:
            raise SessionError(
                f"{base[:80] or 'This file'} is no recording that can be uploaded: upload one of {', '.join(ENDINGS[:-1])}, "
                "or a folder as .zip."
            )
        if len(content) > LARGEST_UPLOAD:
            raise SessionError(
                f"{base} has {len(content) / 2**20:.0f} MB and at most {LARGEST_UPLOAD // 2**20} MB can be uploaded: "
                "copy it to the server and type its path."
            )
        folder = Path(tempfile.mkdtemp(dir=uploads_folder()))
        try:
            if ending == ".zip":
                path, size = _unpacked(base, content, folder, _LARGEST_CONTENT - sum(self._folders.values()))
            else:
                path, size = folder / base, len(content)
                _check_size(base, size, _LARGEST_CONTENT - sum(self._folders.values()))
                path.write_bytes(content)
        except OSError as error:
            shutil.rmtree(folder)
            raise SessionError(
                f"{base} cannot be stored on the server ({error.strerror}): try a smaller one."
            ) from None
        except SessionError:
            shutil.rmtree(folder)
            raise
        self._folders[folder] = size
        return path

    def drop(self, path: Path) -> None:
        """Delete an upload that is no session."""
        for folder in [folder for folder in self._folders if path.is_relative_to(folder)]:
            del self._folders[folder]
            shutil.rmtree(folder)

    def close(self) -> None:
        """Delete everything that was uploaded."""
        for folder in self._folders:
            shutil.rmtree(folder)
        self._folders.clear()


def _unpacked(name: str, content: bytes, folder: Path, room: int) -> tuple[Path, int]:
    """Unpack a zip of at most ``room`` bytes; return the folder that holds its files, and their size."""
    try:
        with zipfile.ZipFile(io.BytesIO(content)) as archive:
            members = [member for member in archive.infolist() if not member.is_dir()]
            _check(name, members, room)
            for member in members:
                target = folder / member.filename
                target.parent.mkdir(parents=True, exist_ok=True)
                # zipfile reads no more of a member than its index says, and that was checked
                with archive.open(member) as packed, target.open("wb") as unpacked:
                    shutil.copyfileobj(packed, unpacked)
    except (zipfile.BadZipFile, zlib.error, NotImplementedError, RuntimeError, EOFError, OSError) as error:
        raise SessionError(f"{name} cannot be unpacked ({error}): zip the folder again, without a password.") from error
    while len(children := list(folder.iterdir())) == 1 and children[0].is_dir():
        folder = children[0]
    return folder, sum(member.file_size for member in members)


def _check_size(name: str, size: int, room: int) -> None:
    if size > room:
        raise SessionError(
            f"{name} has {size / 2**20:.0f} MB unpacked and {room / 2**20:.0f} of the {_LARGEST_CONTENT / 2**20:.0f} MB of this "
            "page are left: upload fewer frames, or load the page again."
        )


def _check(name: str, members: list[zipfile.ZipInfo], room: int) -> None:
    if not members:
        raise SessionError(f"{name} holds no file: zip the folder of the session.")
    if len(members) > _MOST_FILES:
        raise SessionError(
            f"{name} holds {len(members)} files and at most {_MOST_FILES} are taken: upload fewer frames."
        )
    _check_size(name, sum(member.file_size for member in members), room)
    for member in members:
        path = PurePosixPath(member.filename.replace("\\", "/"))
        is_link = (member.external_attr >> 16) & 0o170000 == 0o120000
        if path.is_absolute() or ".." in path.parts or ":" in path.parts[0] or is_link:
            raise SessionError(f"{name} holds {member.filename}, which leads out of its folder: zip the folder again.")
