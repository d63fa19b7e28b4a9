from __future__ import annotations

import errno
import json
import tracemalloc
from pathlib import Path

import numpy as np
import pytest
from mcap.reader import make_reader
from mcap.writer import CompressionType, Writer
from rosbags.highlevel import AnyReader
from rosbags.typesys import Stores, get_typestore

from spf.errors import SessionError
from spf.frame import JOINT_NAMES, Camera, Frame, Truth
from spf.sessions import MCAPWriter, open_session, write_session
from tests.sessions.makers import make_mcap, make_png_folder

CAMERA = Camera(33, 21, 224.51234567890123, 1 / 3, 16.1, 10.7)


def make_frames(rng: np.random.Generator, count: int, depth_unit: float = 0.001) -> list[Frame]:
    """Frames with all that a frame can have, some parts missing here and there, odd times, NaN joints."""
    frames = []
    times_ns = np.cumsum(rng.integers(1, 40_000_000, count)) - 1
    for number in range(count):
        joints = rng.normal(size=(21, 3))
        joints[number % 21] = np.nan
        exact = number % 3 != 2
        truth = Truth(
            joints,
            pose=rng.normal(size=26) if exact else None,
            orientation=np.linalg.qr(rng.normal(size=(3, 3)))[0] if exact else None,
        )
        raw = rng.integers(0, 65536, (CAMERA.height, CAMERA.width), dtype=np.uint16)
        frames.append(
            Frame(
                index=number,
                time=(times_ns[number] - times_ns[0]) / 1e9,
                depth=raw * np.float32(depth_unit),
                camera=CAMERA,
                colour=rng.integers(0, 256, (*raw.shape, 3), dtype=np.uint8) if number % 2 else None,
                truth=truth if number % 4 != 3 else None,
            )
        )
    return frames


def write_frames(path: Path, frames: list[Frame], **options) -> Path:
    with MCAPWriter(path, camera=frames[0].camera, **options) as writer:
        for frame in frames:
            writer.write(frame)
    return path


def assert_same_frame(read: Frame, written: Frame) -> None:
    assert (read.index, read.time, read.camera) == (written.index, written.time, written.camera)
    np.testing.assert_array_equal(read.depth, written.depth)
    assert (read.colour is None) == (written.colour is None)
    if written.colour is not None:
        np.testing.assert_array_equal(read.colour, written.colour)
    assert (read.truth is None) == (written.truth is None)
    if written.truth is not None:
        for ours, theirs in zip(read.truth, written.truth, strict=True):
            assert (ours is None) == (theirs is None)
            if theirs is not None:
                assert ours.shape == theirs.shape
                assert ours.tobytes() == theirs.tobytes()


@pytest.mark.parametrize("depth_unit", [0.001, 0.0001, 1 / 8000, 0.00025])
def test_round_trip_is_bit_exact(tmp_path, rng, depth_unit):
    frames = make_frames(rng, 12, depth_unit)
    session = open_session(write_frames(tmp_path / "s.mcap", frames, depth_unit=depth_unit))
    assert len(session) == 12
    assert (session.depth_unit, session.camera, session.has_truth, session.warnings) == (depth_unit, CAMERA, True, ())
    for read, written in zip(session, frames, strict=True):
        assert_same_frame(read, written)


def test_what_is_known_of_the_session_comes_back(tmp_path, rng):
    camera = CAMERA._replace(model="orthographic", fx=1000.5)
    shape = {"scale": 0.1 + 0.2, "lengths": [1 / 3, 2.5], "side": "left"}
    frames = [frame._replace(camera=camera, truth=None) for frame in make_frames(rng, 2)]
    path = write_frames(
        tmp_path / "s.mcap",
        frames,
        side="left",
        joint_definition="cvar",
        hand_shape=shape,
        start_time_ns=1_700_000_000_123_456_789,
        metadata={"sensor": "D435 № 7", "note": ""},
    )
    session = open_session(path)
    assert (session.camera, session.side, session.joint_definition) == (camera, "left", "cvar")
    assert (session.hand_shape, session.metadata) == (shape, {"sensor": "D435 № 7", "note": ""})
    assert (session.start_time_ns, session.has_truth) == (1_700_000_000_123_456_789, False)
    assert [frame.time for frame in session] == [frame.time for frame in frames]


def test_little_is_known_of_a_plain_session(tmp_path, rng):
    session = open_session(write_frames(tmp_path / "s.mcap", make_frames(rng, 1)))
    assert (session.side, session.joint_definition, session.hand_shape) == (None, "model", None)
    assert (session.start_time_ns, session.metadata, session.depth_unit) == (0, {}, 0.001)


def test_a_piece_of_a_session_starts_at_zero_again(tmp_path, rng):
    frames = make_frames(rng, 6)
    session = open_session(write_frames(tmp_path / "s.mcap", frames[2:], start_time_ns=10**18))
    assert session[0].time == 0
    assert session.start_time_ns == 10**18 + round(frames[2].time * 1e9)
    assert session.times_ns[3] == round(frames[5].time * 1e9) - round(frames[2].time * 1e9)


def test_depth_is_rounded_to_counts(tmp_path, rng):
    frame = make_frames(rng, 1)[0]._replace(depth=np.full((21, 33), 0.43261, np.float32))
    session = open_session(write_frames(tmp_path / "s.mcap", [frame]))
    assert (session.raw_depth(0) == 433).all()


def test_the_mcap_library_sees_ros_2(tmp_path, rng):
    path = make_mcap(tmp_path / "s.mcap", rng, frames=70).path
    with path.open("rb") as file:
        reader = make_reader(file, validate_crcs=True)
        summary = reader.get_summary()
        record = {entry.name: entry.metadata for entry in reader.iter_metadata()}["spf.session"]
        messages = list(reader.iter_messages())
        assert reader.get_header().profile == "ros2"
    counts = {channel.topic: summary.statistics.channel_message_counts[id] for id, channel in summary.channels.items()}
    assert counts == {
        "/depth/camera_info": 3,  # 70 frames at 30 a second
        "/depth/image_rect_raw": 70,
        "/truth/joints": 70,
        "/truth/pose": 70,
        "/truth/orientation": 70,
    }
    assert {channel.message_encoding for channel in summary.channels.values()} == {"cdr"}
    assert {schema.encoding for schema in summary.schemas.values()} == {"ros2msg"}
    assert len(summary.chunk_indexes) == len(messages)  # one chunk a message
    assert {index.compression for index in summary.chunk_indexes} == {"zstd"}
    assert (record["format_version"], record["side"], record["depth_unit"]) == ("1", "right", "0.001")
    assert record["orthographic"] == "false"
    assert record["joint_names"].split(",") == list(JOINT_NAMES)


def test_rosbags_reads_the_same_values(tmp_path, rng):
    made = make_mcap(tmp_path / "s.mcap", rng)
    with AnyReader([made.path], default_typestore=get_typestore(Stores.ROS2_HUMBLE)) as reader:
        found = {
            topic: [
                (stamp, reader.deserialize(raw, connection.msgtype))
                for connection, stamp, raw in reader.messages([c for c in reader.connections if c.topic == topic])
            ]
            for topic in reader.topics
        }
    for number, (stamp, image) in enumerate(found["/depth/image_rect_raw"]):
        assert stamp == round(number / 30 * 1e9)
        assert image.header.stamp.sec * 10**9 + image.header.stamp.nanosec == stamp
        assert (image.encoding, image.is_bigendian, image.step, image.header.frame_id) == (
            "16UC1",
            0,
            80,
            "depth_optical_frame",
        )
        depth = np.frombuffer(image.data.tobytes(), "<u2").reshape(image.height, image.width)
        np.testing.assert_array_equal(depth, made.raw[number])
    camera = found["/depth/camera_info"][0][1]
    assert camera.k.tolist() == [41.25, 0, 19.5, 0, 42.5, 14.5, 0, 0, 1]
    assert camera.p.tolist() == [41.25, 0, 19.5, 0, 0, 42.5, 14.5, 0, 0, 0, 1, 0]
    positions = [(pose.position.x, pose.position.y, pose.position.z) for pose in found["/truth/joints"][3][1].poses]
    np.testing.assert_array_equal(positions, made.joints[3])
    orientation = found["/truth/orientation"][0][1]
    assert [(axis.size, axis.stride) for axis in orientation.layout.dim] == [(3, 9), (3, 3)]
    assert orientation.data.tolist() == np.eye(3).ravel().tolist()


def test_chunks_of_another_size_are_read_too(tmp_path, rng):
    """What `mcap compress` and `mcap recover` leave: many messages a chunk, another compression."""
    path = make_mcap(tmp_path / "s.mcap", rng).path
    for compression in (CompressionType.LZ4, CompressionType.NONE):
        copy = tmp_path / f"{compression.name}.mcap"
        with path.open("rb") as source, copy.open("wb") as target:
            reader, writer = make_reader(source), Writer(target, compression=compression)
            writer.start("ros2")
            for record in reader.iter_metadata():
                writer.add_metadata(record.name, record.metadata)
            channels: dict[int, int] = {}
            for schema, channel, message in reader.iter_messages():
                if channel.id not in channels:
                    id = writer.register_schema(schema.name, schema.encoding, schema.data)
                    channels[channel.id] = writer.register_channel(channel.topic, channel.message_encoding, id)
                writer.add_message(channels[channel.id], message.log_time, message.data, message.publish_time)
            writer.finish()
        again = open_session(copy)
        assert again.fingerprint() == open_session(path).fingerprint()
        np.testing.assert_array_equal(again[3].truth.pose, open_session(path)[3].truth.pose)


def test_two_writings_are_the_same_bytes(tmp_path):
    first, second = (make_mcap(tmp_path / name, np.random.default_rng(3)).path for name in ("a.mcap", "b.mcap"))
    assert first.read_bytes() == second.read_bytes()


def test_an_existing_file_is_kept_unless_told(tmp_path, rng):
    path = make_mcap(tmp_path / "s.mcap", rng).path
    before, session = path.read_bytes(), open_session(path)
    with pytest.raises(SessionError, match=r"s\.mcap is already there"):
        MCAPWriter(path, camera=CAMERA)
    with pytest.raises(SessionError, match=r"s\.mcap is already there"):
        write_session(session, path)
    assert path.read_bytes() == before
    other = open_session(make_mcap(tmp_path / "other.mcap", rng).path)
    write_session(other, path, overwrite=True)
    assert open_session(path).fingerprint() == other.fingerprint()


def test_a_folder_that_is_missing_is_told(tmp_path, rng):
    with pytest.raises(SessionError, match="cannot be written: No such file or directory"):
        MCAPWriter(tmp_path / "gone" / "s.mcap", camera=CAMERA)
    session = open_session(make_mcap(tmp_path / "s.mcap", rng).path)
    with pytest.raises(SessionError, match="cannot be written: No such file or directory"):
        write_session(session, tmp_path / "gone" / "s.mcap")


def test_a_conversion_that_fails_leaves_nothing(tmp_path, rng):
    folder = make_png_folder(tmp_path / "images", rng).path
    (folder / "depth_7.png").write_bytes((folder / "depth_7.png").read_bytes()[:-30])
    with pytest.raises(SessionError, match=r"depth_7\.png is torn"):
        write_session(open_session(folder), tmp_path / "out.mcap")
    assert [path.name for path in tmp_path.iterdir()] == ["images"]


def test_a_copy_that_fills_the_disk_leaves_nothing_and_does_not_say_that_it_did(tmp_path, rng, monkeypatch):
    session = open_session(make_mcap(tmp_path / "s.mcap", rng).path)
    (tmp_path / "out").mkdir()

    def full(self, *_args):
        raise self._unwritable(OSError(errno.ENOSPC, "No space left on device"))

    def no_room(*_args, **_names):
        raise OSError(errno.ENOSPC, "No space left on device")

    out = tmp_path / "out" / "c.mcap"
    for owner, name, fail in ((MCAPWriter, "write", full), (Writer, "start", no_room)):
        with monkeypatch.context() as patched:
            patched.setattr(owner, name, fail)
            with pytest.raises(SessionError) as told:
                write_session(session, out)
        assert str(told.value) == f"{out} cannot be written: No space left on device. Nothing of it was kept."
    assert not list((tmp_path / "out").iterdir())


def test_an_interrupted_recording_keeps_its_frames(tmp_path, rng):
    frames = make_frames(rng, 3)

    def record() -> None:
        with MCAPWriter(tmp_path / "s.mcap", camera=CAMERA) as writer:
            for frame in frames:
                writer.write(frame)
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        record()
    session = open_session(tmp_path / "s.mcap")
    assert (len(session), session.warnings) == (3, ())


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (lambda frame: frame._replace(time=0.0), "is not later"),
        (lambda frame: frame._replace(time=-1.0), "is not later"),
        (lambda frame: frame._replace(camera=CAMERA.crop(1, 1, 33, 21)), "another camera"),
        (lambda frame: frame._replace(depth=frame.depth[1:]), "another camera"),
        (lambda frame: frame._replace(depth=frame.depth + 1), "does not fit into 0 to 65535 counts of 0.001 m"),
        (lambda frame: frame._replace(depth=frame.depth - 1), "does not fit"),
        (lambda frame: frame._replace(depth=frame.depth * np.float32(np.nan)), "does not fit"),
        (lambda frame: frame._replace(truth=Truth(np.zeros((20, 3)))), "20 joints, not 21"),
    ],
)
def test_a_frame_that_cannot_be_stored_is_refused_whole(tmp_path, rng, change, said):
    first, second, third = make_frames(rng, 3)
    second = second._replace(depth=np.where(second.depth < 0.5, np.float32(0), np.float32(65.535)))
    with MCAPWriter(tmp_path / "s.mcap", camera=CAMERA) as writer:
        writer.write(first)
        with pytest.raises(SessionError, match=said):
            writer.write(change(second))
        writer.write(third)
        assert len(writer) == 2
    session = open_session(tmp_path / "s.mcap")
    assert_same_frame(session[1], third._replace(index=1))


def write_with_record(path: Path, **changes: str) -> None:
    """A file whose metadata record says something else."""
    record = {
        "format_version": "1",
        "side": "",
        "depth_unit": "0.001",
        "start_time": "0",
        "joint_definition": "model",
        "hand_shape": json.dumps({}),
        "orthographic": "false",
        **changes,
    }
    with path.open("wb") as file:
        writer = Writer(file)
        writer.start("ros2")
        writer.add_metadata("spf.session", record)
        schema = writer.register_schema("sensor_msgs/msg/Image", "ros2msg", b"")
        channel = writer.register_channel("/depth/image_rect_raw", "cdr", schema)
        writer.add_message(channel, 0, b"\0\1\0\0", 0)
        writer.finish()


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"format_version": "2"}, "format version 2 and this program reads up to 1"),
        ({"depth_unit": "much"}, "metadata record .* is damaged"),
        ({"side": "up"}, "metadata record .* is damaged"),
        ({"hand_shape": "{"}, "metadata record .* is damaged"),
        ({}, "/depth/camera_info is missing"),
    ],
)
def test_a_record_that_cannot_be_read_is_told(tmp_path, changes, said):
    write_with_record(tmp_path / "s.mcap", **changes)
    with pytest.raises(SessionError, match=said):
        open_session(tmp_path / "s.mcap")


def test_another_program_s_file_is_told(tmp_path):
    with (tmp_path / "robot.mcap").open("wb") as file:
        writer = Writer(file)
        writer.start()
        schema = writer.register_schema("pose", "jsonschema", b"{}")
        writer.add_message(writer.register_channel("/pose", "json", schema), 0, b"{}", 0)
        writer.finish()
    with pytest.raises(SessionError, match=r"no ROS messages \(its topics: /pose \(json\)\)"):
        open_session(tmp_path / "robot.mcap")


def test_a_session_without_frames_is_told(tmp_path):
    MCAPWriter(tmp_path / "s.mcap", camera=CAMERA).close()
    with pytest.raises(SessionError, match=r"s\.mcap holds no frame"):
        open_session(tmp_path / "s.mcap")


def test_a_long_recording_keeps_only_its_index_in_memory(tmp_path):
    raw = np.zeros((CAMERA.height, CAMERA.width), np.uint16)
    with MCAPWriter(tmp_path / "long.mcap", camera=CAMERA, start_time_ns=10**18) as writer:
        for number in range(100):
            writer.write_raw(number * 33_333_333, raw)
        tracemalloc.start()
        try:
            for number in range(100, 1100):
                writer.write_raw(number * 33_333_333, raw)
            kept, _ = tracemalloc.get_traced_memory()
        finally:
            tracemalloc.stop()
    assert kept < 1000 * 800  # an entry of the file's index: where the frame lies, which is written when it is closed
