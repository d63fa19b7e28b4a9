"""Torn and damaged session files: what is complete is read, the rest is said."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from spf.errors import SessionError
from spf.sessions import open_session
from tests.sessions.makers import make_mcap

FRAMES = 6


@pytest.fixture
def made(tmp_path: Path, rng: np.random.Generator):
    return make_mcap(tmp_path / "whole.mcap", rng, frames=FRAMES)


def ends_of_frames(path: Path) -> list[int]:
    """Where the chunk of each depth message ends, found by the file's own index."""
    from mcap.reader import make_reader

    with path.open("rb") as file:
        summary = make_reader(file).get_summary()
    depth = next(id for id, channel in summary.channels.items() if channel.topic == "/depth/image_rect_raw")
    chunks = [index for index in summary.chunk_indexes if depth in index.message_index_offsets]
    return sorted(index.chunk_start_offset + index.chunk_length for index in chunks)


def test_any_truncation_keeps_all_complete_frames(made, tmp_path):
    data, ends = made.path.read_bytes(), ends_of_frames(made.path)
    torn = tmp_path / "torn.mcap"
    close = [end + step for end in ends for step in (-2, -1, 0, 1, 2)]
    counts = set()
    for size in sorted({*range(8, len(data), len(data) // 150), *close, len(data) - 1, len(data) - 8}):
        torn.write_bytes(data[:size])
        complete = sum(end <= size for end in ends)
        counts.add(complete)
        if complete == 0:
            with pytest.raises(SessionError, match=r"torn\.mcap (was torn before|is torn or damaged)"):
                open_session(torn)
            continue
        session = open_session(torn)
        assert len(session) == complete
        assert f"torn.mcap was torn: {complete} complete frames were recovered" in session.warnings[0]
        last = session[-1]
        np.testing.assert_array_equal(session.raw_depth(complete - 1), made.raw[complete - 1])
        np.testing.assert_array_equal(last.truth.joints, made.joints[complete - 1])
        assert last.truth.pose.shape == (26,)
        assert (session.side, session.camera) == ("right", made.camera)
    assert counts == set(range(FRAMES + 1))


def test_what_was_lost_is_stated_in_bytes(made, tmp_path):
    data, ends = made.path.read_bytes(), ends_of_frames(made.path)
    (tmp_path / "torn.mcap").write_bytes(data[: ends[3]] + b"\x06" + bytes(30))
    assert (
        "the last 31 bytes, an incomplete record, could not be read" in open_session(tmp_path / "torn.mcap").warnings[0]
    )


@pytest.mark.parametrize("hit", [0, 3, 41, 200])
def test_frames_behind_a_damaged_one_are_recovered(made, tmp_path, hit):
    """Of a file without its index, only the frame that was hit is lost, wherever in its chunk."""
    data, ends = bytearray(made.path.read_bytes()), ends_of_frames(made.path)
    start = data.rindex(b"\x04\0\0\0zstd", 0, ends[2]) - 37  # the chunk of the third frame's depth
    data[start + hit] ^= 0x55
    (tmp_path / "hit.mcap").write_bytes(data[: ends[-1]])
    session = open_session(tmp_path / "hit.mcap")
    assert [round(stamp / 1e9 * 30) for stamp in session.stamps] == [0, 1, 3, 4, 5]
    np.testing.assert_array_equal(session.raw_depth(2), made.raw[3])
    assert "5 complete frames were recovered; 1 damaged stretch in the middle" in session.warnings[0]


def test_garbage_after_the_start_is_told(tmp_path, rng):
    for seed in range(40):
        noise = np.random.default_rng(seed).integers(0, 256, 3000, dtype=np.uint8).tobytes()
        (tmp_path / "noise.mcap").write_bytes(b"\x89MCAP0\r\n" + noise)
        with pytest.raises(SessionError, match=r"noise\.mcap is torn or damaged from its start"):
            open_session(tmp_path / "noise.mcap")


def test_garbage_in_the_middle_never_passes_for_depth(made, tmp_path):
    """Whatever byte is hit, a frame is what was written or an error, and an error is one of ours."""
    data = made.path.read_bytes()
    hit = tmp_path / "hit.mcap"
    errors = 0
    for offset in range(8, len(data), len(data) // 300):
        changed = bytearray(data)
        changed[offset] ^= 0x55
        hit.write_bytes(changed)
        try:
            session = open_session(hit)
            assert len(session) <= FRAMES
            for index, stamp in enumerate(session.stamps):
                number = round(stamp / 1e9 * 30)
                np.testing.assert_array_equal(session.raw_depth(index), made.raw[number])
        except SessionError:
            errors += 1
    assert errors > 50


def test_a_file_changed_while_open_is_told(made):
    session = open_session(made.path)
    made.path.write_bytes(made.path.read_bytes()[:100])
    with pytest.raises(SessionError, match="is damaged or was changed while it was open"):
        session[0]
    made.path.unlink()
    with pytest.raises(SessionError, match="is damaged or was changed while it was open"):
        session[0]


RECORDER = """
import sys
import numpy as np
from spf.frame import Camera, Frame, Truth
from spf.sessions import MCAPWriter

camera = Camera(64, 48, 60.0, 60.0, 31.5, 23.5)
writer = MCAPWriter(sys.argv[1], camera=camera)
number = 0
while True:
    rng = np.random.default_rng(number)
    depth = rng.integers(300, 900, (48, 64)) * np.float32(0.001)
    writer.write(Frame(number, number / 30, depth, camera, truth=Truth(rng.normal(size=(21, 3)))))
    print(number, flush=True)
    number += 1
"""


@pytest.mark.skipif(not hasattr(signal, "SIGKILL"), reason="no SIGKILL on this system")
def test_every_acknowledged_frame_survives_kill_9(tmp_path):
    path = tmp_path / "live.mcap"
    recorder = subprocess.Popen([sys.executable, "-c", RECORDER, str(path)], stdout=subprocess.PIPE, text=True)
    with recorder:
        assert recorder.stdout is not None
        acknowledged = [int(recorder.stdout.readline()) for _ in range(40)]
        growing = open_session(path)  # a file that grows can be followed
        assert len(growing) >= 40
        os.kill(recorder.pid, signal.SIGKILL)
        acknowledged += [int(line) for line in recorder.stdout if line.endswith("\n")]
    session = open_session(path)
    assert len(session) in (len(acknowledged), len(acknowledged) + 1)
    assert f"live.mcap was torn: {len(session)} complete frames were recovered" in session.warnings[0]
    for frame in session:
        rng = np.random.default_rng(frame.index)
        np.testing.assert_array_equal(session.raw_depth(frame.index), rng.integers(300, 900, (48, 64)))
        np.testing.assert_array_equal(frame.truth.joints, rng.normal(size=(21, 3)))
