"""Small sessions in every layout, written by code that shares nothing with the readers (but for the native format)."""

from __future__ import annotations

import json
import struct
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import cv2
import numpy as np
import scipy.io
from numpy.typing import NDArray

from spf.frame import JOINT_NAMES, Camera, Frame, Truth
from spf.sessions import MCAPWriter

FINGERS = ("index", "middle", "ring", "little")


class Made(NamedTuple):
    """What was written, and what reading it must give.

    raw is (N, H, W) counts; joints (N, 21, 3) metres with NaN for what the layout cannot hold, or None.
    """

    path: Path
    raw: NDArray[np.uint16]
    camera: Camera
    joints: NDArray[np.float64] | None
    depth_unit: float = 0.001


def scene(rng: np.random.Generator, frames: int, width: int, height: int) -> NDArray[np.uint16]:
    """(N, H, W) mm: a noisy blob at hand's distance, nothing around it."""
    raw = np.zeros((frames, height, width), np.uint16)
    raw[:, height // 4 : height // 2, width // 4 : width // 2] = rng.integers(
        300, 600, (frames, height // 2 - height // 4, width // 2 - width // 4)
    )
    return raw


def hand_joints(rng: np.random.Generator, frames: int) -> NDArray[np.float64]:
    """(N, 21, 3) metres, somewhere before the camera."""
    return rng.uniform((-0.1, -0.1, 0.3), (0.1, 0.1, 0.5), (frames, 21, 3))


def joint(name: str) -> int:
    return JOINT_NAMES.index(name)


#: CVAR and MSRA15 write the wrist, then these fingers.
COMMON_ORDER = [0] + [
    joint(f"{finger}_{part}")
    for finger, parts in [
        *((finger, ("mcp", "pip", "dip", "tip")) for finger in FINGERS),
        ("thumb", ("tm", "mp", "ip", "tip")),
    ]
    for part in parts
]


def to_uvz(joints: NDArray[np.float64], fx: float, fy: float) -> NDArray[np.float64]:
    """Pixels and mm, by the projection formula; the image centre of all these sets is (160, 120)."""
    x, y, z = np.moveaxis(joints, -1, 0)
    return np.stack([fx * x / z + 160, fy * y / z + 120, z * 1000], axis=-1)


def make_cvar(folder: Path, rng: np.random.Generator, frames: int = 4) -> Made:
    folder.mkdir(parents=True)
    raw, joints = scene(rng, frames, 320, 240), hand_joints(rng, frames)
    lines = [str(frames)]
    for number in range(frames):
        stored = np.where(raw[number] == 0, 32001, raw[number]).astype(np.uint16)
        cv2.imwrite(str(folder / f"{number:06d}_depth.png"), stored)
        numbers = " ".join(f"{value:.9f}" for value in to_uvz(joints[number, COMMON_ORDER], 224.5, 230.5).ravel())
        lines.append(f"./CVAR/PX/{number:06d}_depth.png {numbers} ")
    (folder / "joint.txt").write_text("\n".join(lines))
    return Made(folder, raw, Camera(320, 240, 224.5, 230.5, 160, 120), joints)


def make_msra15(folder: Path, rng: np.random.Generator, frames: int = 4) -> Made:
    folder.mkdir(parents=True)
    left, top, right, bottom = 100, 50, 180, 130
    tenths = np.zeros((frames, 240, 320), np.uint16)
    tenths[:, top:bottom, left:right] = rng.integers(0, 2, (frames, 80, 80)) * rng.integers(
        3000, 5000, (frames, 80, 80)
    )
    joints = hand_joints(rng, frames)
    lines = [str(frames)]
    for number in range(frames):
        box = (tenths[number, top:bottom, left:right] / 10).astype(np.float32)
        header = struct.pack("<6I", 320, 240, left, top, right, bottom)
        (folder / f"{number:06d}_depth.bin").write_bytes(header + box.tobytes())
        upwards = joints[number, COMMON_ORDER] * (1000, -1000, -1000)
        lines.append(" ".join(f"{value:.9f}" for value in upwards.ravel()))
    (folder / "joint.txt").write_text("\n".join(lines) + "\n")
    return Made(folder, tenths, Camera(320, 240, 241.42, 241.42, 160, 120), joints, depth_unit=0.0001)


def make_nyu(folder: Path, rng: np.random.Generator, frames: int = 3) -> Made:
    folder.mkdir(parents=True)
    raw, joints = scene(rng, frames, 640, 480), hand_joints(rng, frames)
    marks = rng.uniform(-300, 300, (3, frames, 36, 3))  # the other Kinects, and marks that are no joints of ours
    upwards = joints * (1000, -1000, 1000)
    for start, finger in zip((0, 6, 12, 18), ("little", "ring", "middle", "index"), strict=True):
        for offset, part in ((0, "tip"), (1, "dip"), (3, "pip"), (5, "mcp")):
            marks[0, :, start + offset] = upwards[:, joint(f"{finger}_{part}")]
    for offset, part in ((0, "tip"), (1, "ip"), (3, "mp"), (5, "tm")):
        marks[0, :, 24 + offset] = upwards[:, joint(f"thumb_{part}")]
    marks[0, :, 30] = upwards[:, 0] + (20, -5, 3)
    marks[0, :, 31] = upwards[:, 0] - (20, -5, 3)
    scipy.io.savemat(folder / "joint_data.mat", {"joint_xyz": marks, "joint_uvd": marks})
    for number in range(frames):
        bgr = np.stack([raw[number] % 256, raw[number] // 256, np.zeros_like(raw[number])], axis=-1)
        cv2.imwrite(str(folder / f"depth_1_{number + 1:07d}.png"), bgr.astype(np.uint8))
        cv2.imwrite(str(folder / f"depth_2_{number + 1:07d}.png"), bgr.astype(np.uint8)[::-1])
    return Made(folder, raw, Camera(640, 480, 588.03, 587.07, 320, 240), joints)


ICVL_ORDER = [joint(f"thumb_{part}") for part in ("mp", "ip", "tip")] + [
    joint(f"{finger}_{part}") for finger in FINGERS for part in ("mcp", "pip", "tip")
]


def make_icvl(folder: Path, rng: np.random.Generator, frames: int = 4, sequence: str = "test_seq_1") -> Made:
    images = folder / "Depth" / sequence
    images.mkdir(parents=True)
    raw, joints = scene(rng, frames, 320, 240), hand_joints(rng, frames)
    lines = []
    for number in range(frames):
        stored = np.where(raw[number] == 0, 32001, raw[number]).astype(np.uint16)
        cv2.imwrite(str(images / f"image_{number:04d}.png"), stored)
        palm = np.array([[160.0, 120.0, 400.0]])
        uvz = np.concatenate([palm, to_uvz(joints[number, ICVL_ORDER], 241.42, 241.42)])
        lines.append(f"{sequence}/image_{number:04d}.png " + " ".join(f"{value:.9f}" for value in uvz.ravel()) + " ")
    labels = folder / f"{sequence}.txt"
    labels.parent.mkdir(exist_ok=True)
    labels.write_text("\n".join(lines) + "\n\n")
    known = np.full_like(joints, np.nan)
    known[:, ICVL_ORDER] = joints[:, ICVL_ORDER]
    return Made(folder, raw, Camera(320, 240, 241.42, 241.42, 160, 120), known)


def make_png_folder(folder: Path, rng: np.random.Generator, frames: int = 12, **entries: Any) -> Made:
    folder.mkdir(parents=True)
    raw = scene(rng, frames, 64, 48)
    for number in range(frames):
        cv2.imwrite(str(folder / f"depth_{number}.png"), raw[number])  # 10 comes after 9, not after 1
    values = {"fx": 70.5, "fy": 71.0, "cx": 31.5, "cy": 23.5, **entries}
    (folder / "camera.json").write_text(json.dumps(values))
    return Made(folder, raw, Camera(64, 48, 70.5, 71.0, 31.5, 23.5), None)


def make_mcap(path: Path, rng: np.random.Generator, frames: int = 5, **options: Any) -> Made:
    path.parent.mkdir(parents=True, exist_ok=True)
    raw, joints = scene(rng, frames, 40, 30), hand_joints(rng, frames)
    camera = Camera(40, 30, 41.25, 42.5, 19.5, 14.5)
    with MCAPWriter(path, camera=camera, side="right", **options) as writer:
        for number in range(frames):
            writer.write(
                Frame(
                    index=number,
                    time=number / 30,
                    depth=raw[number] * np.float32(0.001),
                    camera=camera,
                    truth=Truth(joints[number], pose=rng.normal(size=26), orientation=np.eye(3)),
                )
            )
    return Made(path, raw, camera, joints)


#: Format → what makes a session of it.
MAKERS: dict[str, Callable[..., Made]] = {
    "mcap": make_mcap,
    "msra15": make_msra15,
    "cvar": make_cvar,
    "nyu": make_nyu,
    "icvl": make_icvl,
    "png-folder": make_png_folder,
}
