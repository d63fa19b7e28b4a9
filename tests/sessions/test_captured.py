"""The readers on captured depth (skipped where there is none)."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest

from spf.errors import SessionError
from spf.frame import JOINT_NAMES, Camera, Frame
from spf.sessions import Session, open_session, write_session

#: Frames, and the length from the wrist to the middle finger's MCP in metres, as documented with the recordings.
CVAR = {"P1": (329, 0.085), "P4": (381, 0.0595), "P5": (371, 0.0595)}

KINECT2 = Camera(512, 424, 363.9, 363.9, 255.4, 206.3)


@pytest.fixture(scope="module", params=sorted(CVAR))
def cvar(request: pytest.FixtureRequest, data_dir: Path) -> Session:
    if not (data_dir / "cvar" / request.param).is_dir():
        pytest.skip(f"no CVAR recording {request.param} here")
    return open_session(data_dir / "cvar" / request.param)


@pytest.fixture(scope="module")
def kinect2_folder(data_dir: Path) -> Path:
    if not (data_dir / "kinect2").is_dir():
        pytest.skip("no Kinect recording here")
    return data_dir / "kinect2"


def every_fifth(session: Session) -> list[Frame]:
    return [session[index] for index in range(0, len(session), 5)]


def test_cvar_is_whole(cvar):
    frames, _ = CVAR[cvar.name]
    assert (cvar.format, len(cvar), cvar.warnings) == ("cvar", frames, ())
    assert cvar[0].depth.shape == (240, 320)
    assert 0 < cvar[0].depth.max() < 2


def test_cvar_joints_lie_in_the_hand(cvar):
    """Most joints project into the foreground, a little behind the skin that the sensor saw."""
    inside, behind = [], []
    for frame in every_fifth(cvar):
        u, v = np.rint(frame.camera.project(frame.truth.joints)).astype(int).T
        near = cv2.dilate((frame.depth > 0).astype(np.uint8), np.ones((5, 5), np.uint8))
        inside.append(near[v.clip(0, 239), u.clip(0, 319)].mean())
        seen = frame.depth[v.clip(0, 239), u.clip(0, 319)]
        behind.append(np.median((frame.truth.joints[:, 2] - seen)[seen > 0]))
    assert np.mean(np.array(inside) > 0.9) > 0.9
    assert 0 < np.median(behind) < 0.03


def test_cvar_hand_has_its_documented_size(cvar):
    joints = np.array([frame.truth.joints for frame in every_fifth(cvar)])
    palm = joints[:, JOINT_NAMES.index("middle_mcp")] - joints[:, JOINT_NAMES.index("wrist")]
    assert np.median(np.linalg.norm(palm, axis=-1)) == pytest.approx(CVAR[cvar.name][1], abs=0.001)


def test_cvar_tips_are_where_people_clicked(cvar):
    """An independent annotation in pixels; it settles which finger is which."""
    tips = [JOINT_NAMES.index(f"{finger}_tip") for finger in ("little", "ring", "middle", "index", "thumb")]
    clicks = {}
    for line in (Path(cvar.uri) / "all_fingertips.txt").read_text().splitlines():
        name, *numbers = line.split()
        clicks[name] = np.array(numbers, dtype=float).reshape(5, 2)
    names = [path.name for path in sorted(Path(cvar.uri).glob("*.png"))]
    off = [
        np.linalg.norm(frame.camera.project(frame.truth.joints[tips]) - clicks[names[frame.index]], axis=-1)
        for frame in every_fifth(cvar)
    ]
    assert (np.median(off, axis=0) < 5).all()


def test_kinect2_needs_a_camera_and_takes_one(kinect2_folder):
    with pytest.raises(SessionError, match="no camera file"):
        open_session(kinect2_folder)
    session = open_session(kinect2_folder, camera=KINECT2)
    assert (session.format, len(session), session.side, session.has_truth) == ("png-folder", 167, None, False)
    assert session.camera == KINECT2
    depth = session[80].depth
    assert depth.shape == (424, 512)
    assert 0.5 < depth[depth > 0].min() < 0.7  # the hand is nearest


def test_kinect2_survives_the_native_format(kinect2_folder, tmp_path):
    session = open_session(kinect2_folder, camera=KINECT2)
    write_session(session, tmp_path / "kinect2.mcap")
    assert open_session(tmp_path / "kinect2.mcap").fingerprint() == session.fingerprint()
