"""Uploads: one recording, or a zipped folder, bounded in size and unpacked where nothing else is."""

from __future__ import annotations

import io
import shutil
import tempfile
import zipfile
import zlib
from pathlib import Path, PurePosixPath

from spf.errors import SessionError

__all__ = ["LARGEST_UPLOAD", "Uploads"]

LARGEST_UPLOAD = 512 * 2**20  # bytes
_LARGEST_CONTENT = 2 * 2**30  # bytes of all files of a zip, unpacked
_MOST_FILES = 20_000


class Uploads:
    """The uploads of one page: a temporary folder that goes when the page is closed."""

    def __init__(self) -> None:
        self._folders: list[Path] = []

    def store(self, name: str, content: bytes) -> Path:
        """Write an upload to disk and return the path to open.

        Args:
            name: of the file as the browser gives it; only its last part and its ending matter.
            content: of the file.

        Raises:
            SessionError: it is neither ``.mcap`` nor ``.zip``, too large, damaged, or reaches out of its folder.
        """
        base = PurePosixPath(name.replace("\\", "/")).name
        ending = PurePosixPath(base).suffix.lower()
        if ending not in (".mcap", ".zip"):
            raise SessionError(f"{base or 'This file'} is neither a .mcap nor a .zip of a folder: upload one of these.")
        if len(content) > LARGEST_UPLOAD:
            raise SessionError(
                f"{base} has {len(content) / 2**20:.0f} MB and at most {LARGEST_UPLOAD // 2**20} MB can be uploaded: "
                "copy it to the server and type its path."
            )
        folder = Path(tempfile.mkdtemp(prefix="spf-upload-"))
        self._folders.append(folder)
        if ending == ".zip":
            return _unpacked(base, content, folder)
        path = folder / base
        path.write_bytes(content)
        return path

    def close(self) -> None:
        """Delete everything that was uploaded."""
        for folder in self._folders:
            shutil.rmtree(folder)
        self._folders.clear()


def _unpacked(name: str, content: bytes, folder: Path) -> Path:
    """Unpack a zip and return the folder that holds its files."""
    try:
        with zipfile.ZipFile(io.BytesIO(content)) as archive:
            members = [member for member in archive.infolist() if not member.is_dir()]
            _check(name, members)
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
    return folder


def _check(name: str, members: list[zipfile.ZipInfo]) -> None:
    if not members:
        raise SessionError(f"{name} holds no file: zip the folder of the session.")
    if len(members) > _MOST_FILES:
        raise SessionError(
            f"{name} holds {len(members)} files and at most {_MOST_FILES} are taken: upload fewer frames."
        )
    if sum(member.file_size for member in members) > _LARGEST_CONTENT:
        raise SessionError(f"{name} unpacks to more than {_LARGEST_CONTENT // 2**30} GB: upload fewer frames.")
    for member in members:
        path = PurePosixPath(member.filename.replace("\\", "/"))
        is_link = (member.external_attr >> 16) & 0o170000 == 0o120000
        if path.is_absolute() or ".." in path.parts or ":" in path.parts[0] or is_link:
            raise SessionError(f"{name} holds {member.filename}, which leads out of its folder: zip the folder again.")
