"""Bags by themselves: their first bytes without the rest, files of any size, and how far opening one is."""

from __future__ import annotations

import os
from functools import partial
from pathlib import Path

import numpy as np
import pytest
from mcap.writer import CompressionType, IndexType
from mcap.writer import Writer as McapWriter
from rosbags.rosbag1 import Writer as Writer1
from rosbags.typesys import Stores, get_typestore

from spf.errors import SessionError
from spf.sessions import open_session
from spf.sessions.bag import Bag
from spf.sessions.bag_mcap import McapBag
from spf.sessions.bag_ros1 import Ros1Bag, _records_in
from spf.sessions.bag_sqlite import SqliteBag
from spf.sessions.ros_bags import ChainedBag
from tests.sessions.file_makers import make_npz
from tests.sessions.makers import make_mcap, scene
from tests.sessions.ros_makers import (
    HEIGHT,
    ROS_MAKERS,
    WIDTH,
    Topics,
    depth_messages,
    make_ros1_bag,
    write_ros2,
)

TOPICS = ["/head/depth/camera_info", "/head/depth/image_raw"]


def write_mcap(path, raw, **options):
    """Write depth with the MCAP project's own library."""
    store, channels = get_typestore(Stores.ROS2_HUMBLE), {}
    writer = McapWriter(str(path), **options)
    writer.start("ros2", "test")
    for topic, time, message in depth_messages(Topics(ros1=False), raw):
        kind = message.__msgtype__
        if topic not in channels:
            text, _ = store.generate_msgdef(kind, ros_version=2)
            channels[topic] = writer.register_channel(
                topic, "cdr", writer.register_schema(kind, "ros2msg", text.encode())
            )
        writer.add_message(channels[topic], time, bytes(store.serialize_cdr(message, kind)), time)
    writer.finish()
    return path


def bags_in(folder, raw, rng):
    """Yield (name, bag) of all kinds and compressions."""
    for compression in CompressionType:
        for size in (1, 10_000, 2**20):
            name = f"mcap {compression.name} {size}"
            path = write_mcap(folder / name, raw, compression=compression, chunk_size=size)
            yield name, McapBag(path)
    yield "mcap without chunks", McapBag(write_mcap(folder / "plain", raw, use_chunking=False))
    yield "mcap without index", McapBag(write_mcap(folder / "blind", raw, index_types=IndexType.NONE))
    for compression in (None, *Writer1.CompressionFormat):
        options = {} if compression is None else {"compression": compression}
        made = make_ros1_bag(folder / f"{compression}.bag", rng, frames=len(raw), chunk=10_000, **options)
        yield f"ros 1 {compression}", Ros1Bag(made.path)
    messages = depth_messages(Topics(ros1=False), raw)
    parts = []
    for packed in (False, True):
        parts.append(SqliteBag(write_ros2(folder / f"db3-{packed}", messages, False, packed), packed))
        yield f"db3 packed {packed}", parts[-1]
        parts.append(McapBag(write_ros2(folder / f"mcap-{packed}", messages, True, packed), packed))
        yield f"rosbags mcap packed {packed}", parts[-1]
    yield "several files", ChainedBag(folder, parts)


def check_heads(name: str, bag: Bag, topic: str) -> None:
    whole = [bag.read(topic, position) for position in range(bag.topics[topic].messages)]
    for size in (16, 300, 100_000):
        heads = dict(bag.heads(topic, size))
        assert [heads[position] for position in range(len(whole))] == [message[:size] for message in whole], (
            name,
            size,
        )


def test_first_bytes_are_those_of_the_messages(tmp_path, rng):
    for name, bag in bags_in(tmp_path, scene(rng, 12, WIDTH, HEIGHT), rng):
        assert sorted(bag.topics) == TOPICS, name
        for topic in TOPICS:
            check_heads(name, bag, topic)
            assert (np.diff(bag.times(topic)) > 0).all() or name == "several files"


def test_first_bytes_behind_a_long_record_of_the_connection(tmp_path, rng):
    """As in bags whose index points at the connection before a message: then its definition comes first, of any length."""
    made = make_ros1_bag(tmp_path / "a.bag", rng)
    bag = Ros1Bag(made.path)
    with made.path.open("rb") as file:
        chunk = bag._chunk(file, int(bag.places[TOPICS[1]][0, 1]))
    connections = {record.fields.get("topic"): offset for offset, record in _records_in(chunk)}
    bag.places[TOPICS[1]][0, 2] = connections[TOPICS[1].encode()]
    assert len(bag.read(TOPICS[1], 0)) > 2 * WIDTH * HEIGHT
    check_heads("connection first", bag, TOPICS[1])


def test_a_damaged_chunk_is_told_with_its_frame(tmp_path, rng):
    raw = scene(rng, 40, WIDTH, HEIGHT)
    path = write_mcap(tmp_path / "a", raw, chunk_size=10_000, compression=CompressionType.NONE)
    data = bytearray(path.read_bytes())
    data[len(data) // 2] ^= 1
    path.write_bytes(data)
    session, wrong = open_session(path), []
    for index in range(len(session)):
        try:
            np.testing.assert_array_equal(session.raw_depth(index), raw[index])
        except SessionError as error:
            wrong.append(str(error))
    assert 1 <= len(wrong) <= 4  # the frames of one chunk
    assert all("is damaged or was changed" in sentence for sentence in wrong)


def test_a_large_sqlite_file_opens(tmp_path, rng):
    """SQLite counts its steps in 32 bits, and the steps allowed grow with the file."""
    raw = scene(rng, 4, WIDTH, HEIGHT)
    path = write_ros2(tmp_path / "a", depth_messages(Topics(ros1=False), raw), mcap=False)
    os.truncate(path, 2**32)  # sparse
    np.testing.assert_array_equal(open_session(path).raw_depth(3), raw[3])


class StoppedError(Exception):
    """What a page raises to end the opening of a session."""


def torn_native(path: Path, rng: np.random.Generator):
    made = make_mcap(path, rng)
    made.path.write_bytes(made.path.read_bytes()[:-2000])
    return made


TAKING_TIME = {
    **ROS_MAKERS,
    "packed arrays": partial(make_npz, packed=True),
    "torn native": torn_native,
}


@pytest.mark.parametrize("name", TAKING_TIME)
def test_opening_tells_how_far_it_is_and_can_be_ended(tmp_path, rng, name):
    path = TAKING_TIME[name](tmp_path / "made", rng).path
    told: list[tuple[str, float]] = []
    open_session(path, report=lambda text, share: told.append((text, share)))
    assert told
    assert all(text and 0 <= share <= 1 for text, share in told)
    for text in {text for text, _ in told}:
        shares = [share for each, share in told if each == text]
        assert shares == sorted(shares)

    def stop(text: str, share: float) -> None:
        raise StoppedError

    with pytest.raises(StoppedError):
        open_session(path, report=stop)
