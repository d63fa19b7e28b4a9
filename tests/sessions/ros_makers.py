"""Recordings in ROS formats, written by rosbags and by librealsense: nothing here is written by our own code."""

from __future__ import annotations

import ctypes
import struct
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from rosbags.rosbag1 import Writer as Writer1
from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin
from rosbags.rosbag2 import Writer as Writer2
from rosbags.typesys import Stores, get_typestore

from spf.frame import Camera
from tests.reference.rvl import encode_rvl
from tests.sessions.makers import Made, scene

WIDTH, HEIGHT = 40, 30
CAMERA = Camera(WIDTH, HEIGHT, 41.25, 42.5, 19.5, 14.5)
START = 1_700_000_000_123_456_789
STEP = 33_333_333


def stamps(frames: int) -> list[int]:
    return [START + STEP * number for number in range(frames)]


class Topics:
    """Makes messages of one ROS version."""

    def __init__(self, ros1: bool) -> None:
        self.store = get_typestore(Stores.ROS1_NOETIC if ros1 else Stores.ROS2_HUMBLE)
        self.ros1 = ros1

    def make(self, kind: str, **values: Any) -> Any:
        return self.store.types[kind](**values)

    def header(self, stamp: int, frame: str) -> Any:
        time = self.make("builtin_interfaces/msg/Time", sec=stamp // 10**9, nanosec=stamp % 10**9)
        extra = {"seq": 7} if self.ros1 else {}
        return self.make("std_msgs/msg/Header", stamp=time, frame_id=frame, **extra)

    def image(self, pixels: np.ndarray, encoding: str, stamp: int, frame: str = "depth", padding: int = 0) -> Any:
        """An image whose rows end in ``padding`` bytes."""
        rows = np.ascontiguousarray(pixels).view(np.uint8).reshape(len(pixels), -1)
        rows = np.concatenate([rows, np.full((len(rows), padding), 0xAB, np.uint8)], axis=1)
        return self.make(
            "sensor_msgs/msg/Image",
            header=self.header(stamp, frame),
            height=pixels.shape[0],
            width=pixels.shape[1],
            encoding=encoding,
            is_bigendian=int(pixels.dtype.byteorder == ">"),
            step=rows.shape[1],
            data=rows.reshape(-1),
        )

    def compressed(self, pixels: np.ndarray, stamp: int, layout: str, a: float = 0, b: float = 0) -> Any:
        code = encode_rvl(pixels) if "rvl" in layout else cv2.imencode(".png", pixels)[1].tobytes()
        data = np.frombuffer(struct.pack("<iff", 0, a, b) + code, np.uint8)
        return self.make(
            "sensor_msgs/msg/CompressedImage", header=self.header(stamp, "depth"), format=layout, data=data
        )

    def camera_info(
        self,
        camera: Camera,
        stamp: int,
        frame: str = "depth",
        model: str = "plumb_bob",
        d: tuple[float, ...] = (0,) * 5,
    ) -> Any:
        region = self.make(
            "sensor_msgs/msg/RegionOfInterest", x_offset=0, y_offset=0, height=0, width=0, do_rectify=False
        )
        fx, fy, cx, cy = camera.fx, camera.fy, camera.cx, camera.cy
        matrices = {
            "k": np.array([fx, 0, cx, 0, fy, cy, 0, 0, 1.0]),
            "r": np.eye(3).ravel(),
            "p": np.array([fx + 1, 0, cx + 1, 0, 0, fy + 1, cy + 1, 0, 0, 0, 1, 0.0]),
            "d": np.array(d, np.float64),
        }
        return self.make(
            "sensor_msgs/msg/CameraInfo",
            header=self.header(stamp, frame),
            height=camera.height,
            width=camera.width,
            distortion_model=model,
            binning_x=0,
            binning_y=0,
            roi=region,
            **{key.upper() if self.ros1 else key: value for key, value in matrices.items()},
        )


def write_ros1(path: Path, messages: list[tuple[str, int, Any]], tail: bytes = b"", **options: Any) -> None:
    """Write (topic, time, message); ``tail`` follows every image, as librealsense leaves it."""
    path.parent.mkdir(parents=True, exist_ok=True)
    store, connections = get_typestore(Stores.ROS1_NOETIC), {}
    writer = Writer1(path)
    if "compression" in options:
        writer.set_compression(options["compression"])
    if "chunk" in options:
        writer.chunk_threshold = options["chunk"]
    with writer:
        for topic, time, message in messages:
            kind = message.__msgtype__
            if topic not in connections:
                connections[topic] = writer.add_connection(topic, kind, typestore=store)
            data = bytes(store.serialize_ros1(message, kind))
            writer.write(connections[topic], time, data + (tail if kind.endswith("/Image") else b""))


def write_ros2(folder: Path, messages: list[tuple[str, int, Any]], mcap: bool, packed: bool = False) -> Path:
    """Write (topic, time, message); returns the file in the folder of the bag."""
    folder.parent.mkdir(parents=True, exist_ok=True)
    store, connections = get_typestore(Stores.ROS2_HUMBLE), {}
    writer = Writer2(folder, version=9, storage_plugin=StoragePlugin.MCAP if mcap else StoragePlugin.SQLITE3)
    if packed:
        writer.set_compression(CompressionMode.MESSAGE, CompressionFormat.ZSTD)
    with writer:
        for topic, time, message in messages:
            kind = message.__msgtype__
            if topic not in connections:
                connections[topic] = writer.add_connection(topic, kind, typestore=store)
            writer.write(connections[topic], time, store.serialize_cdr(message, kind))
    return next(path for path in folder.iterdir() if path.suffix != ".yaml")


def depth_messages(
    topics: Topics, raw: np.ndarray, topic: str = "/head/depth/image_raw", late: int = 5_000_000
) -> list[tuple[str, int, Any]]:
    """Depth images and their camera, recorded somewhat after they were taken."""
    info = topic.rpartition("/")[0] + "/camera_info"
    messages = []
    for image, stamp in zip(raw, stamps(len(raw)), strict=True):
        messages.append((info, stamp + late, topics.camera_info(CAMERA, stamp)))
        messages.append((topic, stamp + late, topics.image(image, "16UC1", stamp)))
    return messages


def make_ros1_bag(path: Path, rng: np.random.Generator, frames: int = 5, **options: Any) -> Made:
    raw = scene(rng, frames, WIDTH, HEIGHT)
    write_ros1(path, depth_messages(Topics(ros1=True), raw), **options)
    return Made(path, raw, CAMERA, None)


def make_ros2_bag(path: Path, rng: np.random.Generator, frames: int = 5) -> Made:
    raw = scene(rng, frames, WIDTH, HEIGHT)
    write_ros2(path, depth_messages(Topics(ros1=False), raw), mcap=False)
    return Made(path, raw, CAMERA, None)


def make_ros_mcap(path: Path, rng: np.random.Generator, frames: int = 5) -> Made:
    raw = scene(rng, frames, WIDTH, HEIGHT)
    file = write_ros2(path.with_name(f"{path.name}-bag"), depth_messages(Topics(ros1=False), raw), mcap=True)
    return Made(file, raw, CAMERA, None)


def make_ros_rvl(path: Path, rng: np.random.Generator, frames: int = 5) -> Made:
    """Images in RVL."""
    topics, raw = Topics(ros1=False), scene(rng, frames, WIDTH, HEIGHT)
    messages = []
    for image, stamp in zip(raw, stamps(frames), strict=True):
        messages.append(("/head/depth/camera_info", stamp, topics.camera_info(CAMERA, stamp)))
        packed = topics.compressed(image, stamp, "16UC1; compressedDepth rvl")
        messages.append(("/head/depth/image_raw/compressedDepth", stamp, packed))
    file = write_ros2(path.with_name(f"{path.name}-bag"), messages, mcap=True)
    return Made(file, raw, CAMERA, None)


def make_realsense(path: Path, rng: np.random.Generator, frames: int = 5, unit: float = 0.0001) -> Made:
    """Record a virtual camera of librealsense with librealsense's recorder."""
    import libusb_package

    ctypes.CDLL(str(libusb_package.get_library_path()), mode=ctypes.RTLD_GLOBAL)
    import pyrealsense2 as rs

    path = path.with_suffix(".db3")
    path.parent.mkdir(parents=True, exist_ok=True)
    raw = scene(rng, frames, WIDTH, HEIGHT) * 10
    device = rs.software_device()
    sensor = device.add_sensor("Stereo Module")
    sensor.add_read_only_option(rs.option.depth_units, unit)
    lens = rs.intrinsics()
    lens.width, lens.height, lens.fx, lens.fy, lens.ppx, lens.ppy = CAMERA[:6]
    lens.model, lens.coeffs = rs.distortion.brown_conrady, [0] * 5
    stream = rs.video_stream()
    stream.type, stream.fmt, stream.index, stream.uid = rs.stream.depth, rs.format.z16, 0, 0
    stream.width, stream.height, stream.fps, stream.bpp, stream.intrinsics = WIDTH, HEIGHT, 30, 2, lens
    profile = sensor.add_video_stream(stream).as_video_stream_profile()
    recorder = rs.recorder(str(path), device)
    recorded, syncer = recorder.query_sensors()[0], rs.syncer()
    recorded.open(recorded.get_stream_profiles()[0])
    recorded.start(syncer)
    for number, image in enumerate(raw):
        frame = rs.software_video_frame()
        frame.pixels, frame.stride, frame.bpp = image.view(np.uint8).ravel(), WIDTH * 2, 2
        frame.timestamp, frame.domain = 1000 + STEP * number / 1e6, rs.timestamp_domain.hardware_clock
        frame.frame_number, frame.profile, frame.depth_units = number, profile, unit
        sensor.on_video_frame(frame)
        syncer.wait_for_frames(2000)
    recorded.stop()
    recorded.close()
    return Made(path, raw, CAMERA, None, depth_unit=unit)


ROS_MAKERS = {
    "ros1-bag": make_ros1_bag,
    "ros2-bag": make_ros2_bag,
    "ros-mcap": make_ros_mcap,
    "realsense": make_realsense,
}
