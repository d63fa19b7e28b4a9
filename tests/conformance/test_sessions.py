"""Every reader through the protocol of a session."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pytest

from spf.errors import SessionError
from spf.frame import Camera
from spf.sessions import FORMATS, Session, open_session, write_session
from tests.sessions.file_makers import FILE_MAKERS
from tests.sessions.makers import MAKERS as OWN_MAKERS
from tests.sessions.makers import Made
from tests.sessions.ros_makers import ROS_MAKERS

MAKERS = {**OWN_MAKERS, **ROS_MAKERS, **FILE_MAKERS}


@pytest.fixture(params=sorted(MAKERS))
def made(request: pytest.FixtureRequest, tmp_path: Path, rng: np.random.Generator) -> Made:
    return MAKERS[request.param](tmp_path / "session", rng)


@pytest.fixture
def session(made: Made) -> Session:
    return open_session(made.path)


def test_every_format_is_here():
    assert {form.name for form in FORMATS} == set(MAKERS)


def test_format_is_found_by_content(session, made, request):
    assert session.format == request.node.callspec.params["made"]
    assert session.uri == str(made.path)
    assert session.name
    assert session.warnings == ()


def test_depth_is_what_was_written(session, made):
    assert len(session) == len(made.raw)
    assert session.depth_unit == made.depth_unit
    for index, frame in enumerate(session):
        assert frame.index == index
        assert frame.depth.dtype == np.float32
        assert frame.depth.shape == (session.camera.height, session.camera.width)
        np.testing.assert_array_equal(np.rint(frame.depth / session.depth_unit), made.raw[index])
        np.testing.assert_array_equal(session.raw_depth(index), made.raw[index])
        np.testing.assert_allclose(frame.depth, made.raw[index] * made.depth_unit, rtol=1e-6)


def test_camera_is_the_one_of_the_layout(session, made):
    assert session.camera == made.camera
    assert all(frame.camera == made.camera for frame in session)


def test_truth_is_what_was_written(session, made):
    assert session.has_truth == (made.joints is not None)
    for index, frame in enumerate(session):
        if made.joints is None:
            assert frame.truth is None
        else:
            assert frame.truth.joints.shape == (21, 3)
            np.testing.assert_allclose(frame.truth.joints, made.joints[index], atol=1e-9)


def test_times_start_at_zero_and_increase(session):
    assert session.times.shape == (len(session),)
    assert session.times[0] == 0
    assert (np.diff(session.times) > 0).all()
    assert [frame.time for frame in session] == session.times.tolist()
    np.testing.assert_array_equal(np.rint(session.times * 1e9), session.times_ns)


def test_random_access(session, made):
    for index in (len(session) - 1, 0, np.int64(1), -1, -len(session)):
        frame = session[index]
        assert frame.index == int(index) % len(session)
        np.testing.assert_array_equal(np.rint(frame.depth / session.depth_unit), made.raw[index])
    for index in (len(session), -len(session) - 1):
        with pytest.raises(IndexError):
            session[index]


def test_a_frame_is_the_reader_s_own(session, made):
    session[0].depth[:] = 9  # writeable, and no other reader sees it
    if made.joints is not None:
        session[0].truth.joints[:] = 9
        np.testing.assert_allclose(session[0].truth.joints, made.joints[0], atol=1e-9)
    np.testing.assert_array_equal(np.rint(session[0].depth / session.depth_unit), made.raw[0])


def test_threads_read_what_one_reads(session, made):
    order = np.random.default_rng(1).integers(0, len(session), 80).tolist()
    with ThreadPoolExecutor(8) as pool:
        frames = list(pool.map(session.__getitem__, order))
    for index, frame in zip(order, frames, strict=True):
        assert frame.index == index
        np.testing.assert_array_equal(np.rint(frame.depth / session.depth_unit), made.raw[index])


def test_fingerprint_is_of_the_content(session, made, tmp_path):
    fingerprint = session.fingerprint()
    assert len(fingerprint) == 64
    assert open_session(made.path).fingerprint() == fingerprint
    write_session(session, tmp_path / "copy.mcap")
    assert open_session(tmp_path / "copy.mcap").fingerprint() == fingerprint


def test_fingerprint_tells_other_recordings_apart(session, tmp_path, request):
    maker = MAKERS[request.node.callspec.params["made"]]
    other = maker(tmp_path / "other", np.random.default_rng(99))
    assert open_session(other.path).fingerprint() != session.fingerprint()


def test_conversion_keeps_everything(session, tmp_path):
    seen: list[tuple[int, int]] = []
    write_session(session, tmp_path / "copy.mcap", progress=lambda done, total: seen.append((done, total)))
    copy = open_session(tmp_path / "copy.mcap")
    assert seen == [(done, len(session)) for done in range(1, len(session) + 1)]
    for name in ("camera", "depth_unit", "side", "joint_definition", "has_truth", "hand_shape", "metadata"):
        assert getattr(copy, name) == getattr(session, name), name
    np.testing.assert_array_equal(copy.times_ns, session.times_ns)
    for before, after in zip(session, copy, strict=True):
        np.testing.assert_array_equal(after.depth, before.depth)
        if before.truth is not None:
            np.testing.assert_array_equal(after.truth.joints, before.truth.joints)
    assert [path.name for path in tmp_path.iterdir() if path.name.endswith(".part")] == []


def test_closes_as_a_context(made):
    with open_session(made.path) as session:
        assert session[0].depth.any()


def test_a_camera_is_taken_only_where_one_may_be_missing(made, request):
    other = Camera(64, 48, 1.0, 2.0, 3.0, 4.0)
    form = next(form for form in FORMATS if form.name == request.node.callspec.params["made"])
    if "camera" in form.chosen:
        fitting = other._replace(width=made.camera.width, height=made.camera.height)
        assert open_session(made.path, camera=fitting).camera == fitting
        with pytest.raises(SessionError, match="camera given"):
            open_session(made.path, camera=other._replace(width=65))
    else:
        with pytest.raises(SessionError, match="its own camera"):
            open_session(made.path, camera=other)
