"""Recordings in the layouts of other programs: Azure Kinect (ffmpeg), TUM, Open3D, BOP (Pillow), arrays (NumPy, h5py)."""

from __future__ import annotations

import json
import struct
import subprocess
from pathlib import Path
from typing import Any

import h5py
import imageio_ffmpeg
import numpy as np
from PIL import Image

from spf.frame import Camera
from tests.sessions.makers import Made, hand_joints, scene

#: The factory calibration of a real Azure Kinect's depth camera, and what its SDK says of it in mode NFOV_UNBINNED.
CX, CY, FX, FY = 0.5122697949409485, 0.49451231956481934, 0.4921168386936188, 0.4921667277812958
RATIONAL = (
    3.1305770874023438,
    2.324939012527466,
    0.1304156482219696,
    3.458651542663574,
    3.350114583969116,
    0.6629416346549988,
)
TANGENTIAL = (0.00008132171933539212, -0.0000511557373101823)
SDK_CAMERA = Camera(640, 576, 503.927643, 503.978729, 332.064270, 325.880615)


def calibration(distorted: bool = False) -> dict[str, Any]:
    ks = [*RATIONAL, 0, 0, TANGENTIAL[1], TANGENTIAL[0]] if distorted else [0.0] * 10
    depth = {
        "Purpose": "CALIBRATION_CameraPurposeDepth",
        "Intrinsics": {
            "ModelParameterCount": 14,
            "ModelParameters": [CX, CY, FX, FY, *ks],
            "ModelType": "CALIBRATION_LensDistortionModelBrownConrady",
        },
        "SensorWidth": 1024,
        "SensorHeight": 1024,
    }
    colour = {"Purpose": "CALIBRATION_CameraPurposePhotoVideo", "Intrinsics": {"ModelParameters": [0.5] * 14}}
    return {"CalibrationInformation": {"Cameras": [colour, depth]}}


def write_mkv(
    path: Path, raw: np.ndarray, content: Any, names: tuple[str, ...] = ("DEPTH", "IR"), options: Any = ()
) -> None:
    """Have ffmpeg write a colour track, then the depth and IR tracks as b16g, with an attached calibration."""
    path.parent.mkdir(parents=True, exist_ok=True)
    frames, height, width = raw.shape
    work = path.with_name(f"{path.name}-parts")
    work.mkdir()
    raw.astype(">u2").tofile(work / "depth.raw")
    (raw // 3 + 1).astype(">u2").tofile(work / "ir.raw")
    (work / "calibration.json").write_text(content if isinstance(content, str) else json.dumps(content))
    grey = ["-f", "rawvideo", "-pix_fmt", "gray16be", "-s", f"{width}x{height}", "-r", "30"]
    command = [imageio_ffmpeg.get_ffmpeg_exe(), "-loglevel", "error", "-y"]
    command += ["-f", "lavfi", "-i", f"testsrc=s=64x48:r=30:d={frames / 30}"]
    for number in range(len(names)):
        command += [*grey, "-i", str(work / ("ir.raw" if number % 2 else "depth.raw"))]
    for number in range(len(names) + 1):
        command += ["-map", str(number)]
    command += ["-c:v:0", "mjpeg"]
    for number, name in enumerate(names, 1):
        command += [
            f"-c:v:{number}",
            "rawvideo",
            f"-tag:v:{number}",
            "b16g",
            f"-metadata:s:v:{number}",
            f"title={name}",
        ]
    if content is not None:
        command += ["-attach", str(work / "calibration.json"), "-metadata:s:t", "mimetype=application/octet-stream"]
    command += ["-metadata", "K4A_DEPTH_MODE=NFOV_2X2BINNED", "-metadata", "K4A_DEVICE_SERIAL_NUMBER=000123"]
    command += ["-allow_raw_vfw", "1", *options, "-f", "matroska", str(path)]
    subprocess.run(command, check=True)
    # ffmpeg knows b16g when it reads it, and leaves the four characters empty when it writes: the recorder puts them there.
    header = struct.pack("<IiiHH", 40, width, -height, 1, 16)
    data = path.read_bytes()
    assert data.count(header + bytes(4)) == len(names)
    path.write_bytes(data.replace(header + bytes(4), struct.pack("<IiiHH", 40, width, height, 1, 16) + b"b16g"))


def make_azure_mkv(path: Path, rng: np.random.Generator, frames: int = 4) -> Made:
    raw = scene(rng, frames, 320, 288)
    write_mkv(path, raw, calibration())
    return Made(path, raw, Camera(320, 288, FX * 512, FY * 512, CX * 512 - 96.5, CY * 512 - 90.5), None)


def save_depth(path: Path, raw: np.ndarray) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    Image.fromarray(raw).save(path)


def save_colour(path: Path, shape: tuple[int, int], value: int) -> np.ndarray:
    path.parent.mkdir(parents=True, exist_ok=True)
    colour = np.full((*shape, 3), (value, 20, 230), np.uint8)
    Image.fromarray(colour).save(path)
    return colour


def make_tum(folder: Path, rng: np.random.Generator, frames: int = 4) -> Made:
    raw = scene(rng, frames, 64, 48) * 5
    lines = ["# depth maps", "# file: 'x.bag'", "# timestamp filename"]
    colours = ["# color images"]
    for number, image in enumerate(raw):
        time = f"1305031102.{160407 + 33000 * number:06d}"
        save_depth(folder / "depth" / f"{time}.png", image)
        lines.append(f"{time} depth/{time}.png")
        save_colour(folder / "rgb" / f"{number}.png", (48, 64), number)
        colours.append(f"1305031102.{170000 + 33000 * number:06d} rgb/{number}.png")
    (folder / "depth.txt").write_text("\n".join(lines) + "\n")
    (folder / "rgb.txt").write_text("\n".join(colours) + "\n")
    (folder / "camera.json").write_text(json.dumps({"fx": 52.5, "fy": 53.5, "cx": 31.5, "cy": 23.5}))
    return Made(folder, raw, Camera(64, 48, 52.5, 53.5, 31.5, 23.5), None, depth_unit=0.0002)


def make_open3d(folder: Path, rng: np.random.Generator, frames: int = 4, **said: Any) -> Made:
    raw = scene(rng, frames, 64, 48)
    for number, image in enumerate(raw):
        save_depth(folder / "depth" / f"{number:06d}.png", image)
        save_colour(folder / "color" / f"{number:06d}.jpg", (48, 64), number)
    camera = {"width": 64, "height": 48, "intrinsic_matrix": [52.5, 0, 0, 0, 53.5, 0, 31.5, 23.5, 1]}
    (folder / "camera_intrinsic.json").write_text(json.dumps({**camera, **said}))
    return Made(folder, raw, Camera(64, 48, 52.5, 53.5, 31.5, 23.5), None)


def make_bop(folder: Path, rng: np.random.Generator, frames: int = 4) -> Made:
    raw = scene(rng, frames, 64, 48) * 10
    for number, image in enumerate(raw):
        save_depth(folder / "depth" / f"{number:06d}.png", image)
        save_colour(folder / "rgb" / f"{number:06d}.png", (48, 64), number)
    entry = {"cam_K": [52.5, 0, 31.5, 0, 53.5, 23.5, 0, 0, 1], "depth_scale": 0.1}
    (folder / "scene_camera.json").write_text(json.dumps({str(number): entry for number in range(frames)}))
    return Made(folder, raw, Camera(64, 48, 52.5, 53.5, 31.5, 23.5), None, depth_unit=0.0001)


def array_content(rng: np.random.Generator, frames: int = 4) -> tuple[Made, dict[str, Any]]:
    raw, joints = scene(rng, frames, 64, 48), hand_joints(rng, frames)
    camera = Camera(64, 48, 52.5, 53.5, 31.5, 23.5)
    content = {
        "depth": raw,
        "K": np.array([[52.5, 0, 31.5], [0, 53.5, 23.5], [0, 0, 1]]),
        "times": np.arange(frames) / 60,
        "joints": joints,
        "depth_unit": 0.001,
    }
    return Made(Path(), raw, camera, joints), content


def make_npz(path: Path, rng: np.random.Generator, packed: bool = False, **changes: Any) -> Made:
    made, content = array_content(rng)
    path = path.with_suffix(".npz")
    path.parent.mkdir(parents=True, exist_ok=True)
    (np.savez_compressed if packed else np.savez)(path, **{**content, **changes})
    return made._replace(path=path)


def make_hdf5(path: Path, rng: np.random.Generator, **changes: Any) -> Made:
    made, content = array_content(rng)
    path = path.with_suffix(".h5")
    path.parent.mkdir(parents=True, exist_ok=True)
    with h5py.File(path, "w") as file:
        for name, value in {**content, **changes}.items():
            options = {"compression": "gzip", "chunks": (1, 48, 64)} if name == "depth" and value.ndim == 3 else {}
            file.create_dataset(f"take/{name}", data=value, **options)
    return made._replace(path=path)


FILE_MAKERS = {
    "azure-mkv": make_azure_mkv,
    "tum": make_tum,
    "open3d": make_open3d,
    "bop": make_bop,
    "arrays": make_npz,
}
