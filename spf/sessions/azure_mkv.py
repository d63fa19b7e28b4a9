"""Azure Kinect recordings (``.mkv``): 16-bit big-endian depth beside infrared and colour, and the device's calibration.

As k4arecorder writes them: a track DEPTH of raw ``b16g`` images in mm, an attachment ``calibration.json`` with the
factory calibration of the whole sensor, and a tag that tells which part of the sensor the depth mode reads.
"""

from __future__ import annotations

import json
import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from spf.errors import SessionError
from spf.sessions.bag import damaged
from spf.sessions.camera_file import EXAMPLE
from spf.sessions.choice import Choice
from spf.sessions.files import check_depth_unit
from spf.sessions.matroska import MAGIC, Block, Matroska, Track, read_matroska
from spf.sessions.rectify import Lens, Rectify, rectification
from spf.sessions.session import Session
from spf.sessions.streams import choose_stream

__all__ = ["is_azure_mkv", "open_azure_mkv"]

_UNIT = 0.001  # metres per count of the depth engine
_DEPTH_CODES = {b"b16g": ">u2", b"Y1\x00\x10": "<u2", b"Y16 ": "<u2"}
_MOST_PIXELS = 2**26


class _Mode(NamedTuple):
    """Which part of the sensor a depth mode reads: the sensor's size after binning, and the corner of the part."""

    sensor: int
    left: int
    top: int


#: By the size of the images: each depth mode has its own.
_MODES = {
    (320, 288): _Mode(512, 96, 90),
    (640, 576): _Mode(1024, 192, 180),
    (512, 512): _Mode(512, 0, 0),
    (1024, 1024): _Mode(1024, 0, 0),
}


@dataclass(frozen=True, kw_only=True, eq=False)
class MkvSession(Session):
    """A session in a Matroska file.

    Attributes:
        path: the file.
        blocks: where the N frames lie.
        size: of the recorded images, (width, height).
        dtype: of their counts.
        rectify: takes out the lens distortion, None if there is none.
    """

    path: Path
    blocks: tuple[Block, ...]
    size: tuple[int, int]
    dtype: str
    rectify: Rectify | None

    def raw_depth(self, index: int) -> NDArray[np.uint16]:
        """Return the (H, W) raw counts of a frame."""
        block, (width, height) = self.blocks[index], self.size
        if block.size != 2 * width * height:
            raise damaged(self.path, f"frame {index} has {block.size} bytes")
        try:
            with self.path.open("rb") as file:
                file.seek(block.start)
                data = file.read(block.size)
        except OSError as error:
            raise damaged(self.path, f"frame {index}") from error
        if len(data) < block.size:
            raise damaged(self.path, f"frame {index} ends too early")
        raw = np.frombuffer(data, self.dtype).reshape(height, width).astype(np.uint16)
        return raw if self.rectify is None else self.rectify(raw)


def is_azure_mkv(path: Path) -> bool:
    """Tell whether a path is a Matroska file."""
    if not path.is_file():
        return False
    with path.open("rb") as file:
        return file.read(len(MAGIC)) == MAGIC


def open_azure_mkv(path: Path, choice: Choice, uri: str) -> Session:
    """Open an Azure Kinect recording.

    Raises:
        SessionError: it has no track with depth, or several and none is chosen; it says nothing of its camera; or it is
            damaged.
    """
    file = read_matroska(path)
    track = _depth_track(path, file, choice, uri)
    size = (track.width, track.height)
    if not 0 < size[0] * size[1] <= _MOST_PIXELS:
        raise damaged(path, f"images of {size[0]}×{size[1]}")
    blocks = sorted(track.blocks)
    times = np.array([block.time for block in blocks], dtype=np.float64) * file.scale
    fresh = np.concatenate([[True], np.diff(times) > 0]) & (np.abs(times) < 2**62)
    if not fresh.any() or file.scale <= 0:
        raise damaged(path, "the times of its frames")
    blocks = [block for block, keep in zip(blocks, fresh, strict=True) if keep]
    lens, notes = _lens(path, file, size, choice, uri)
    warnings = []
    if not file.whole:
        warnings.append(f"{path.name} was torn or is damaged: {len(blocks)} frames were recovered.")
    if not fresh.all():
        warnings.append(f"{int((~fresh).sum())} frames have an impossible time and were left out.")
    exact = np.array([block.time for block in blocks], dtype=np.int64) * file.scale
    session = MkvSession(
        uri=uri,
        name=path.stem,
        format="azure-mkv",
        camera=lens.camera,
        times_ns=exact - exact[0],
        depth_unit=choice.depth_unit or _UNIT,
        metadata={"track": track.name, **notes},
        contents=tuple(
            f"track {each.name or each.number}: {len(each.blocks)} × {_layout(each)}" for each in file.tracks
        )
        + tuple(f"attachment {name}" for name in file.attachments),
        warnings=tuple(warnings),
        path=path,
        blocks=tuple(blocks),
        size=size,
        dtype=_DEPTH_CODES[track.fourcc],
        rectify=rectification(lens, uri),
    )
    check_depth_unit(session)
    return session


def _layout(track: Track) -> str:
    code = track.fourcc.decode("latin-1").strip("\0 ")
    return f"{code or track.codec or 'unknown'}, {track.width}×{track.height}"


def _depth_track(path: Path, file: Matroska, choice: Choice, uri: str) -> Track:
    """Return the track with depth: the one that is called so, as infrared images look the same."""
    grey = [track for track in file.tracks if track.fourcc in _DEPTH_CODES and track.blocks]
    if not grey:
        listed = "; ".join(f"{track.name or track.number}: {_layout(track)}" for track in file.tracks) or "none"
        why = "" if file.whole else " It is torn or damaged."
        raise SessionError(f"{path} has no track with raw 16-bit depth (its tracks: {listed}).{why}")
    names = {track.name or str(track.number): track for track in grey}
    named = [name for name in names if name.upper().startswith("DEPTH")]
    chosen = choice.topic or (named[0] if len(named) == 1 else "")
    found = choose_stream(uri, "tracks", {name: _layout(track) for name, track in names.items()}, chosen)
    return names[found]


def _lens(path: Path, file: Matroska, size: tuple[int, int], choice: Choice, uri: str) -> tuple[Lens, dict[str, str]]:
    if choice.camera is not None:
        camera = choice.fitting(size, uri)
        return Lens(*camera[:6]), {"camera": "given by the user"}
    name = file.tags.get("K4A_CALIBRATION_FILE", "calibration.json")
    if name not in file.attachments or size not in _MODES:
        why = f"{name} is not attached" if name not in file.attachments else f"{size[0]}×{size[1]} is no depth mode"
        raise SessionError(f"{path} does not say what its depth camera is ({why}): give --camera FILE, like {EXAMPLE}.")
    try:
        lens = calibration_lens(json.loads(file.attachments[name]), size)
    except (ValueError, LookupError, TypeError, AttributeError, OverflowError, RecursionError) as error:
        raise SessionError(f"The calibration in {path} is damaged: give the camera with --camera FILE.") from error
    notes = {"sensor": f"Azure Kinect {file.tags.get('K4A_DEVICE_SERIAL_NUMBER', '')}".strip()}
    if "K4A_DEPTH_MODE" in file.tags:
        notes["depth_mode"] = file.tags["K4A_DEPTH_MODE"]
    if lens.is_distorted:
        notes["rectified"] = "lens distortion (rational_polynomial) was taken out on reading"
    return lens, notes


def calibration_lens(calibration: Any, size: tuple[int, int]) -> Lens:
    """Return the lens of a depth mode from the calibration of the whole sensor.

    The calibration is in units of the sensor's size; a depth mode bins the sensor and reads a part of it.

    Args:
        calibration: content of ``calibration.json``.
        size: (width, height) of the depth mode's images.

    Raises:
        ValueError, LookupError, TypeError: it is not such a calibration.
    """
    cameras = calibration["CalibrationInformation"]["Cameras"]
    depth = next(each for each in cameras if each["Purpose"] == "CALIBRATION_CameraPurposeDepth")
    cx, cy, fx, fy, *ks = map(float, depth["Intrinsics"]["ModelParameters"])
    k1, k2, k3, k4, k5, k6, codx, cody, p2, p1 = ks[:10]
    if codx or cody or not all(map(math.isfinite, ks)):
        raise ValueError("an unknown centre of distortion")
    mode = _MODES[size]
    # Half a pixel: the calibration counts from the corner of the first pixel, we from its centre.
    lens = Lens(
        *size,
        fx * mode.sensor,
        fy * mode.sensor,
        cx * mode.sensor - mode.left - 0.5,
        cy * mode.sensor - mode.top - 0.5,
        "rational_polynomial",
        (k1, k2, p1, p2, k3, k4, k5, k6),
    )
    if not lens.is_calibrated:
        raise ValueError("impossible focal lengths")
    return lens
