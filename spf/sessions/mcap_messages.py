"""What a native session file holds: its topics, its ROS 2 messages and its metadata.

Messages are CDR as in ROS 2, so that ROS 2, Foxglove and Rerun open the files too.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from functools import cache
from typing import Any, NamedTuple, cast

import numpy as np
from numpy.typing import NDArray
from rosbags.typesys import Stores, get_typestore
from rosbags.typesys.store import Typestore

from spf.errors import SessionError
from spf.frame import JOINT_NAMES, Camera
from spf.sessions.session import Side

__all__ = [
    "CAMERA_TOPIC",
    "COLOUR_TOPIC",
    "DEPTH_TOPIC",
    "FREE_RECORD",
    "JOINTS_TOPIC",
    "MARKS_RECORD",
    "MESSAGE_TYPES",
    "NOTES_TOPIC",
    "ORIENTATION_TOPIC",
    "POSE_TOPIC",
    "SESSION_RECORD",
    "Description",
    "decode_array",
    "decode_camera",
    "decode_image",
    "decode_joints",
    "decode_note",
    "definition",
    "encode_array",
    "encode_camera",
    "encode_image",
    "encode_joints",
    "encode_note",
]

DEPTH_TOPIC = "/depth/image_rect_raw"
CAMERA_TOPIC = "/depth/camera_info"
COLOUR_TOPIC = "/color/image_rect"
JOINTS_TOPIC = "/truth/joints"
POSE_TOPIC = "/truth/pose"
ORIENTATION_TOPIC = "/truth/orientation"
NOTES_TOPIC = "/notes"

_IMAGE = "sensor_msgs/msg/Image"
_CAMERA_INFO = "sensor_msgs/msg/CameraInfo"
_POSE_ARRAY = "geometry_msgs/msg/PoseArray"
_MULTI_ARRAY = "std_msgs/msg/Float64MultiArray"
_LOG = "rcl_interfaces/msg/Log"  # what Foxglove and ROS 2 list as a log
_INFO = 20

#: The message type of each topic.
MESSAGE_TYPES = {
    DEPTH_TOPIC: _IMAGE,
    CAMERA_TOPIC: _CAMERA_INFO,
    COLOUR_TOPIC: _IMAGE,
    JOINTS_TOPIC: _POSE_ARRAY,
    POSE_TOPIC: _MULTI_ARRAY,
    ORIENTATION_TOPIC: _MULTI_ARRAY,
    NOTES_TOPIC: _LOG,
}

#: The metadata records: what the format defines, whatever else the writer was told, joints that a person marked.
SESSION_RECORD = "spf.session"
FREE_RECORD = "spf.metadata"
MARKS_RECORD = "spf.marks"

_FORMAT_VERSION = 1
_FRAME_ID = "depth_optical_frame"
_ENCODINGS = {"16UC1": ("<u2", 1), "rgb8": ("u1", 3)}


class Description(NamedTuple):
    """What the metadata record of a session says.

    Attributes:
        depth_unit: metres per raw count.
        side: the hand shown, or None.
        joint_definition: whose joints the truth marks.
        hand_shape: the exact hand shape of a synthetic session, or None.
        start_time_ns: nanoseconds since 1970 (UTC) of the time 0 of the frames' times, 0 if unknown.
        camera_model: ``"pinhole"`` or ``"orthographic"``.
    """

    depth_unit: float
    side: Side | None
    joint_definition: str
    hand_shape: dict[str, Any] | None
    start_time_ns: int
    camera_model: str

    def to_record(self, free: Mapping[str, str]) -> dict[str, str]:
        """Return the metadata record; the sensor's name is repeated from the free entries."""
        return {
            "format_version": str(_FORMAT_VERSION),
            "side": self.side or "",
            "depth_unit": repr(float(self.depth_unit)),
            "sensor": free.get("sensor", ""),
            "start_time": str(self.start_time_ns),
            "joint_definition": self.joint_definition,
            "joint_names": ",".join(JOINT_NAMES),
            "hand_shape": "" if self.hand_shape is None else json.dumps(self.hand_shape),
            "orthographic": "true" if self.camera_model == "orthographic" else "false",
        }

    @classmethod
    def from_record(cls, record: Mapping[str, str]) -> Description:
        """Read a metadata record.

        Raises:
            SessionError: it was written by a newer version.
            KeyError, ValueError: it is damaged.
        """
        version = int(record["format_version"])
        if version > _FORMAT_VERSION:
            raise SessionError(
                f"The session has format version {version} and this program reads up to {_FORMAT_VERSION}: "
                "update the program."
            )
        side = record["side"]
        if side not in ("left", "right", ""):
            raise ValueError(side)
        return cls(
            depth_unit=float(record["depth_unit"]),
            side=cast(Side, side) if side else None,
            joint_definition=record["joint_definition"],
            hand_shape=json.loads(record["hand_shape"]) if record["hand_shape"] else None,
            start_time_ns=int(record["start_time"]),
            camera_model="orthographic" if record["orthographic"] == "true" else "pinhole",
        )


@cache
def _store() -> Typestore:
    return get_typestore(Stores.ROS2_HUMBLE)  # 0.2 s: only when a file of this format is met


def definition(message_type: str) -> bytes:
    """Return the text of a message definition, as MCAP stores it."""
    return _store().generate_msgdef(message_type, ros_version=2)[0].encode()


def _make(message_type: str, **values: Any) -> Any:
    return _store().types[message_type](**values)


def _header(stamp_ns: int) -> Any:
    stamp = _make("builtin_interfaces/msg/Time", sec=stamp_ns // 10**9, nanosec=stamp_ns % 10**9)
    return _make("std_msgs/msg/Header", stamp=stamp, frame_id=_FRAME_ID)


def _encode(message: Any) -> bytes:
    return bytes(_store().serialize_cdr(message, message.__msgtype__))


def _decode(data: bytes, message_type: str) -> Any:
    return _store().deserialize_cdr(data, message_type)


def encode_image(image: NDArray[np.uint16 | np.uint8], stamp_ns: int) -> bytes:
    """Encode a (H, W) uint16 depth image (16UC1) or a (H, W, 3) uint8 RGB image (rgb8)."""
    encoding = "16UC1" if image.ndim == 2 else "rgb8"
    kind, channels = _ENCODINGS[encoding]
    pixels = np.ascontiguousarray(image, dtype=kind)
    height, width = image.shape[:2]
    return _encode(
        _make(
            _IMAGE,
            header=_header(stamp_ns),
            height=height,
            width=width,
            encoding=encoding,
            is_bigendian=0,
            step=width * channels * pixels.itemsize,
            data=pixels.reshape(-1).view(np.uint8),
        )
    )


def decode_image(data: bytes) -> NDArray[Any]:
    """Decode what :func:`encode_image` made."""
    message = _decode(data, _IMAGE)
    kind, channels = _ENCODINGS[message.encoding]
    pixels = message.data.view(kind).reshape(message.height, message.width, channels)
    return np.array(pixels[..., 0] if channels == 1 else pixels, dtype=np.dtype(kind).newbyteorder("="))


def encode_camera(camera: Camera, stamp_ns: int) -> bytes:
    """Encode a camera as CameraInfo (orthographic: focal lengths are pixels per metre, see the metadata record)."""
    fx, fy, cx, cy = map(float, (camera.fx, camera.fy, camera.cx, camera.cy))
    region = _make("sensor_msgs/msg/RegionOfInterest", x_offset=0, y_offset=0, height=0, width=0, do_rectify=False)
    return _encode(
        _make(
            _CAMERA_INFO,
            header=_header(stamp_ns),
            height=camera.height,
            width=camera.width,
            distortion_model="plumb_bob",
            d=np.zeros(5),
            k=np.array([fx, 0, cx, 0, fy, cy, 0, 0, 1]),
            r=np.eye(3).reshape(-1),
            p=np.array([fx, 0, cx, 0, 0, fy, cy, 0, 0, 0, 1, 0]),
            binning_x=0,
            binning_y=0,
            roi=region,
        )
    )


def decode_camera(data: bytes, model: Any) -> Camera:
    """Decode a CameraInfo; its model is known from the metadata record."""
    message = _decode(data, _CAMERA_INFO)
    fx, _, cx, _, fy, cy, *_ = map(float, message.k)
    return Camera(int(message.width), int(message.height), fx, fy, cx, cy, model)


def encode_joints(joints: NDArray[np.float64], stamp_ns: int) -> bytes:
    """Encode (J, 3) joints in metres as the positions of a PoseArray."""
    upright = _make("geometry_msgs/msg/Quaternion", x=0.0, y=0.0, z=0.0, w=1.0)
    points = (_make("geometry_msgs/msg/Point", x=x, y=y, z=z) for x, y, z in joints.tolist())
    poses = [_make("geometry_msgs/msg/Pose", position=point, orientation=upright) for point in points]
    return _encode(_make(_POSE_ARRAY, header=_header(stamp_ns), poses=poses))


def decode_joints(data: bytes) -> NDArray[np.float64]:
    """Decode (J, 3) joints in metres."""
    positions = [pose.position for pose in _decode(data, _POSE_ARRAY).poses]
    return np.array([(point.x, point.y, point.z) for point in positions], dtype=np.float64).reshape(-1, 3)


def encode_note(kind: str, text: str, stamp_ns: int) -> bytes:
    """Encode a marker, note or event as a log entry of that name."""
    stamp = _make("builtin_interfaces/msg/Time", sec=stamp_ns // 10**9, nanosec=stamp_ns % 10**9)
    return _encode(_make(_LOG, stamp=stamp, level=_INFO, name=kind, msg=text, file="", function="", line=0))


def decode_note(data: bytes) -> tuple[str, str]:
    """Decode (kind, text)."""
    message = _decode(data, _LOG)
    return str(message.name), str(message.msg)


def encode_array(array: NDArray[np.float64]) -> bytes:
    """Encode an array of any shape."""
    values = np.ascontiguousarray(array, dtype=np.float64)
    strides = np.cumprod((1, *values.shape[::-1]))[:0:-1]
    dim = [
        _make("std_msgs/msg/MultiArrayDimension", label=f"axis{axis}", size=size, stride=int(stride))
        for axis, (size, stride) in enumerate(zip(values.shape, strides, strict=True))
    ]
    layout = _make("std_msgs/msg/MultiArrayLayout", dim=dim, data_offset=0)
    return _encode(_make(_MULTI_ARRAY, layout=layout, data=values.reshape(-1)))


def decode_array(data: bytes) -> NDArray[np.float64]:
    """Decode an array with its shape."""
    message = _decode(data, _MULTI_ARRAY)
    return np.array(message.data, dtype=np.float64).reshape([axis.size for axis in message.layout.dim])
