"""The native format as other programs read it, notes included: the schemas of ROS 2, and messages that fit them."""

from __future__ import annotations

import pytest
from mcap.reader import make_reader
from rosbags.highlevel import AnyReader
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from spf.sessions import MCAPWriter, Note
from tests.sessions.test_mcap import CAMERA, make_frames

ROS2 = get_typestore(Stores.ROS2_HUMBLE)


@pytest.fixture
def recording(tmp_path, rng):
    """A file with everything that the format has."""
    with MCAPWriter(tmp_path / "s.mcap", camera=CAMERA, start_time_ns=10**18) as writer:
        frames = make_frames(rng, 6)
        for frame in frames[:3]:
            writer.write(frame)
        writer.add_note(Note(frames[2].time, "marker", ""))
        for frame in frames[3:]:
            writer.write(frame)
        writer.add_note(Note(frames[5].time + 0.5, "note", "Daumen verdeckt – später"))
        writer.add_note(Note(frames[5].time + 0.6, "event", "The sensor was lost."))
    return tmp_path / "s.mcap"


def test_schemas_are_those_of_ros_2(recording):
    with recording.open("rb") as file:
        schemas = make_reader(file, validate_crcs=True).get_summary().schemas.values()
    assert {schema.name for schema in schemas} == {
        "sensor_msgs/msg/CameraInfo", "sensor_msgs/msg/Image", "geometry_msgs/msg/PoseArray",
        "std_msgs/msg/Float64MultiArray", "rcl_interfaces/msg/Log",
    }  # fmt: skip
    for schema in schemas:
        for name, (constants, fields) in get_types_from_msg(schema.data.decode(), schema.name).items():
            expected = ROS2.fielddefs[name]
            assert fields == expected[1], name
            assert [(constant, value) for constant, _, value in constants] == [
                (constant, value) for constant, _, value in expected[0]
            ]


def test_messages_fill_their_schemas_to_the_last_byte(recording):
    seen = set()
    with AnyReader([recording], default_typestore=ROS2) as reader:
        for connection, _, data in reader.messages():
            message = reader.deserialize(data, connection.msgtype)
            assert bytes(ROS2.serialize_cdr(message, connection.msgtype)) == data, connection.topic
            seen.add(connection.topic)
    assert {"/notes", "/depth/image_rect_raw", "/color/image_rect", "/truth/joints"} <= seen


def test_notes_are_log_messages_in_order_of_time(recording):
    with AnyReader([recording], default_typestore=ROS2) as reader:
        wanted = [connection for connection in reader.connections if connection.topic == "/notes"]
        found = [
            (stamp, reader.deserialize(data, connection.msgtype)) for connection, stamp, data in reader.messages(wanted)
        ]
        times = [stamp for _, stamp, _ in reader.messages()]
    assert times == sorted(times)
    assert [(log.name, log.msg) for _, log in found] == [
        ("marker", ""),
        ("note", "Daumen verdeckt – später"),
        ("event", "The sensor was lost."),
    ]
    for stamp, log in found:
        assert log.stamp.sec * 10**9 + log.stamp.nanosec == stamp
        assert log.level in (10, 20, 30, 40, 50)
