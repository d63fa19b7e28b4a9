"""A sensor over the network: what comes is what was sent; senders that go away, damage and bombs are told."""

from __future__ import annotations

import json
import threading

import numpy as np
import pytest
import zstandard

from spf.errors import SensorError
from spf.live import Capture, Feed, network, open_live
from spf.live.network import Publisher, decode, encode
from spf.sessions import open_session
from tests.live.sources import ABOUT, Scripted, finish, raw_of

CAPTURE = Capture(7, 123_456_789, 0.0, raw_of(7))


@pytest.fixture
def publisher():
    made = Publisher("tcp://127.0.0.1:*")
    yield made
    made.close()


def uri_of(publisher: Publisher) -> str:
    return publisher.address.replace("tcp:", "zmq:")


def test_a_message_is_exact():
    message = decode(encode("s", ABOUT, CAPTURE))
    assert message[:4] == ("s", ABOUT, 7, 123_456_789)
    np.testing.assert_array_equal(message.raw, CAPTURE.raw)


def changed(**entries: object) -> list[bytes]:
    magic, header, packed = encode("s", ABOUT, CAPTURE)
    return [magic, json.dumps({**json.loads(header), **entries}).encode(), packed]


CAMERA = ABOUT.camera._asdict()


@pytest.mark.parametrize(
    "parts",
    [
        [],
        [b"spf1"],
        [b"spf2", *encode("s", ABOUT, CAPTURE)[1:]],
        [*encode("s", ABOUT, CAPTURE)[:2], b"torn"],
        [*encode("s", ABOUT, CAPTURE)[:2], zstandard.compress(bytes(1 << 28))],  # a bomb: 256 MB in some kB
        [b"spf1", b"[" * 60_000, b""],
        changed(camera={**CAMERA, "width": 10**9, "height": 10**9}),
        changed(camera={**CAMERA, "width": -32, "height": -24}),
        changed(camera={**CAMERA, "fx": float("nan")}),
        changed(camera={**CAMERA, "model": "fisheye"}),
        changed(camera=3),
        changed(depth_unit=0),
        changed(depth_unit="much"),
        changed(number=float("inf")),
        changed(metadata=[]),
    ],
)
def test_what_is_no_depth_is_told(parts):
    with pytest.raises(SensorError, match="is no depth of 'spf stream'"):
        decode(parts)


def test_noise_never_passes_for_depth():
    rng, good = np.random.default_rng(1), encode("s", ABOUT, CAPTURE)
    for _ in range(500):
        parts = [bytearray(part) for part in good]
        part = parts[rng.integers(3)]
        part[rng.integers(len(part))] ^= 1 << rng.integers(8)
        try:
            decoded = decode([bytes(part) for part in parts])
        except SensorError:
            continue
        assert decoded.raw.shape == (24, 32)


def test_what_is_sent_is_recorded_elsewhere(tmp_path, publisher):
    """A sender that is there first, a receiver that comes later: all from then on, with the sender's times."""
    receiving = threading.Event()

    def script():
        number = 0
        while not receiving.is_set():
            yield number
            yield 0.002
            number += 1
        yield from range(number, number + 40)

    source = Scripted(script())
    with Feed(source, send=publisher.send) as sender:
        receiver = Feed(open_live(uri_of(publisher)))
        receiver.record(tmp_path / "r.mcap")
        with receiver:
            first = receiver.newest(timeout=10).capture.number
            receiving.set()
            finish(sender)
            total = sender.state.taken
            while receiver.newest().capture.number < total - 1:
                pass
            assert receiver.state.missing == 0
    session = open_session(tmp_path / "r.mcap")
    assert first >= total - len(session)
    for index in range(len(session)):
        np.testing.assert_array_equal(session.raw_depth(index), raw_of(total - len(session) + index))
    assert (session.camera, session.side, session.metadata["serial"]) == (ABOUT.camera, "left", "F7")
    assert session.times[-1] == pytest.approx((len(session) - 1) / 30)


def test_a_sender_that_begins_anew_is_taken_up_again(monkeypatch):
    monkeypatch.setattr(network, "_SILENCE", 0.3)
    first = Publisher("tcp://127.0.0.1:*")
    said = set()
    with Feed(open_live(uri_of(first)), retry=0.01) as receiver:
        while receiver.state.taken < 3:
            first.send(
                ABOUT, CAPTURE._replace(time_ns=CAPTURE.time_ns + receiver.state.taken + receiver.state.repeated)
            )
            receiver.newest(timeout=0.01)
        first.close()
        while receiver.state.connected:
            pass
        said.add(receiver.state.message)
        second = Publisher(first.address)
        before = receiver.state.taken
        while receiver.state.taken < before + 3:
            second.send(ABOUT, CAPTURE._replace(time_ns=receiver.state.taken + receiver.state.repeated))
            receiver.newest(timeout=0.01)
        second.close()
        assert receiver.state.reconnected == 1
    assert "Nothing comes from" in said.pop()


def test_nothing_there_and_wrong_addresses(monkeypatch, publisher):
    monkeypatch.setattr(network, "_FIRST", 0.05)
    with pytest.raises(SensorError, match=r"Nothing comes from tcp://127\.0\.0\.1:.* start 'spf stream"):
        open_live(uri_of(publisher)).open()
    monkeypatch.setattr(network, "_FIRST", 1e6)
    with pytest.raises(SensorError, match="Nothing comes from"):
        open_live(uri_of(publisher)).open(lambda: True)
    with pytest.raises(SensorError, match="must name a host and a port"):
        open_live("zmq://box")
    with pytest.raises(SensorError, match="ports go up to 65535"):  # ZeroMQ would take 34463
        open_live("zmq://box:99999")
    with pytest.raises(SensorError, match="ports go up to 65535"):
        Publisher("tcp://*:99999")
    with pytest.raises(SensorError, match="cannot be offered here"):
        Publisher("tcp://192.0.2.1:5555")
    with pytest.raises(SensorError, match="cannot be offered here"):
        Publisher(publisher.address)


def test_it_can_be_closed_and_opened_again(publisher):
    done = threading.Event()

    def send():
        number = 0
        while not done.wait(0.002):
            publisher.send(ABOUT, CAPTURE._replace(number=number, time_ns=number))
            number += 1

    thread = threading.Thread(target=send)
    thread.start()
    source = open_live(uri_of(publisher))
    for _ in range(2):
        assert source.open() == ABOUT
        assert next(iter(source.captures())) is not None
        source.close()
    done.set()
    thread.join()
