"""Azure Kinect, TUM, Open3D, BOP and arrays: what the conformance table does not ask."""

from __future__ import annotations

import json
import subprocess

import h5py
import imageio_ffmpeg
import numpy as np
import pytest
from PIL import Image

from spf.errors import SessionError
from spf.frame import Camera
from spf.sessions import open_session
from spf.sessions.azure_mkv import calibration_lens
from spf.sessions.matroska import read_matroska
from tests.sessions.file_makers import (
    SDK_CAMERA,
    array_content,
    calibration,
    make_azure_mkv,
    make_bop,
    make_hdf5,
    make_npz,
    make_open3d,
    make_tum,
    write_mkv,
)
from tests.sessions.makers import scene


def check(session, raw):
    np.testing.assert_array_equal(np.stack([session.raw_depth(i) for i in range(len(session))]), raw)


def test_azure_ffmpeg_reads_the_same_depth(tmp_path, rng):
    made = make_azure_mkv(tmp_path / "a.mkv", rng)
    command = [imageio_ffmpeg.get_ffmpeg_exe(), "-loglevel", "error", "-i", str(made.path), "-map", "0:1"]
    data = subprocess.run([*command, "-f", "rawvideo", "-pix_fmt", "gray16le", "-"], capture_output=True, check=True)
    np.testing.assert_array_equal(np.frombuffer(data.stdout, "<u2").reshape(made.raw.shape), made.raw)
    session = open_session(made.path)
    check(session, made.raw)
    assert session.metadata["sensor"] == "Azure Kinect 000123"
    assert session.metadata["depth_mode"] == "NFOV_2X2BINNED"
    assert session.contents[1] == "track DEPTH: 4 × b16g, 320×288"
    assert session.contents[-1] == "attachment calibration.json"


def test_azure_camera_is_what_the_sdk_says(tmp_path):
    lens = calibration_lens(calibration(distorted=True), (640, 576))
    np.testing.assert_allclose(lens.camera[:6], SDK_CAMERA[:6], atol=1e-3)
    np.testing.assert_allclose(lens.distortion[:5], (3.130577, 2.324939, 0.000081, -0.000051, 0.130416), atol=1e-6)


def test_azure_lens_distortion_is_taken_out(tmp_path, rng):
    """A slanted plane as this lens shows it (the rational model written out) becomes the plane of straight rays."""
    lens = calibration_lens(calibration(distorted=True), (320, 288))
    k1, k2, p1, p2, k3, k4, k5, k6 = lens.distortion
    v, u = np.mgrid[0:288, 0:320].astype(float)
    x, y = (u - lens.cx) / lens.fx, (v - lens.cy) / lens.fy
    r2 = x * x + y * y
    radial = (1 + k1 * r2 + k2 * r2**2 + k3 * r2**3) / (1 + k4 * r2 + k5 * r2**2 + k6 * r2**3)
    where_u = lens.fx * (x * radial + 2 * p1 * x * y + p2 * (r2 + 2 * x * x)) + lens.cx
    where_v = lens.fy * (y * radial + p1 * (r2 + 2 * y * y) + 2 * p2 * x * y) + lens.cy
    ramp = np.rint(500 + u + 2 * v).astype(np.uint16)
    write_mkv(tmp_path / "a.mkv", np.repeat(ramp[None], 3, axis=0), calibration(distorted=True))
    session = open_session(tmp_path / "a.mkv")
    assert session.camera == lens.camera
    assert session.metadata["rectified"].startswith("lens distortion")
    seen = session.raw_depth(1).astype(float)
    expected = 500 + where_u + 2 * where_v
    assert (seen > 0).mean() > 0.95
    assert np.abs(seen - expected)[seen > 0].max() <= 2.05  # half a pixel in u and in v, and rounding
    assert np.abs(ramp - expected).max() > 20


def test_azure_tracks_without_a_name_for_depth_are_left_to_choose(tmp_path, rng):
    raw = scene(rng, 3, 320, 288)
    write_mkv(tmp_path / "a.mkv", raw, calibration(), names=("left", "right"))
    with pytest.raises(SessionError, match=r"several tracks with depth.*topic=left'.*left \(b16g, 320×288\), right"):
        open_session(tmp_path / "a.mkv")
    check(open_session(f"{tmp_path}/a.mkv?topic=left"), raw)
    with pytest.raises(SessionError, match="none of the tracks"):
        open_session(f"{tmp_path}/a.mkv?topic=up")


def test_azure_without_calibration_asks_for_the_camera(tmp_path, rng):
    raw = scene(rng, 3, 320, 288)
    write_mkv(tmp_path / "none.mkv", raw, None)
    with pytest.raises(SessionError, match=r"calibration\.json is not attached\): give --camera"):
        open_session(tmp_path / "none.mkv")
    camera = Camera(320, 288, 250.0, 250.0, 160.0, 144.0)
    session = open_session(tmp_path / "none.mkv", camera=camera)
    assert session.camera == camera
    check(session, raw)
    write_mkv(tmp_path / "torn.mkv", raw, '{"CalibrationInformation": ')
    with pytest.raises(SessionError, match=r"calibration in .* is damaged"):
        open_session(tmp_path / "torn.mkv")
    write_mkv(tmp_path / "other.mkv", scene(rng, 3, 64, 48), calibration())
    with pytest.raises(SessionError, match="64×48 is no depth mode"):
        open_session(tmp_path / "other.mkv")


def test_azure_torn_file_gives_its_whole_frames(tmp_path, rng):
    raw = scene(rng, 8, 320, 288)
    # With the attachment first, and a cluster of unknown size, as a recorder that cannot go back writes it.
    write_mkv(tmp_path / "a.mkv", raw, calibration(), options=("-live", "1", "-cluster_time_limit", "60"))
    data = (tmp_path / "a.mkv").read_bytes()
    torn, counts = tmp_path / "torn.mkv", []
    for size in range(len(data) // 12, len(data), len(data) // 12):
        torn.write_bytes(data[:size])
        if len(read_matroska(torn).attachments) == 0 or not any(
            t.name == "DEPTH" and t.blocks for t in read_matroska(torn).tracks
        ):
            continue
        session = open_session(torn)
        counts.append(len(session))
        assert session.warnings == () or "torn" in session.warnings[0]
        check(session, raw[: len(session)])
    assert max(counts) >= 7
    assert len(set(counts)) > 4


def test_tum_times_colour_and_missing_images(tmp_path, rng):
    made = make_tum(tmp_path / "desk", rng)
    session = open_session(made.path)
    assert session.start_time_ns == 1305031102_160407000
    assert session.times_ns.tolist() == [0, 33_000_000, 66_000_000, 99_000_000]
    np.testing.assert_array_equal(session[2].colour[0, 0], (2, 20, 230))
    session.depth_paths[1].unlink()
    fewer = open_session(made.path)
    check(fewer, made.raw[[0, 2, 3]])
    assert fewer.times_ns.tolist() == [0, 66_000_000, 99_000_000]
    assert "1 lines of depth.txt have no image" in fewer.warnings[0]
    (made.path / "camera.json").unlink()
    with pytest.raises(SessionError, match=r"does not say which camera took it: write .*camera\.json.*--camera"):
        open_session(made.path)
    assert open_session(made.path, camera=made.camera).camera == made.camera


@pytest.mark.parametrize(
    "line", ["noon depth/x.png", "1.5", "1.5 ../../etc/passwd", "1e400 depth/x.png", "-4 depth/x.png"]
)
def test_tum_damaged_list(tmp_path, rng, line):
    made = make_tum(tmp_path / "desk", rng)
    (made.path / "depth.txt").write_text(f"# x\n1.0 depth/a.png\n{line}\n")
    with pytest.raises(SessionError, match=r"Line 3 of .*depth\.txt is damaged"):
        open_session(made.path)


def test_open3d_says_unit_rate_and_device(tmp_path, rng):
    made = make_open3d(tmp_path / "room", rng, depth_scale=4000.0, fps=15, device_name="Intel RealSense L515")
    session = open_session(made.path)
    assert (session.depth_unit, session.metadata["sensor"]) == (1 / 4000, "Intel RealSense L515")
    np.testing.assert_allclose(np.diff(session.times), 1 / 15, atol=1e-9)
    np.testing.assert_allclose(session[1].colour[5, 5], (1, 20, 230), atol=8)  # JPEG


@pytest.mark.parametrize(
    ("said", "sentence"),
    [
        ({"intrinsic_matrix": [1, 2, 3]}, "is damaged"),
        ({"intrinsic_matrix": [0, 0, 0, 0, 53.5, 0, 31.5, 23.5, 1]}, "impossible numbers"),
        ({"intrinsic_matrix": [52.5, 0, 31.5, 0, 53.5, 23.5, 0, 0, 1]}, "impossible numbers"),  # row by row
        ({"width": 640}, "its camera is for 640×48"),
        ({"depth_scale": 1.0}, "wrong unit"),
    ],
)
def test_open3d_wrong_cameras(tmp_path, rng, said, sentence):
    made = make_open3d(tmp_path / "room", rng, **said)
    with pytest.raises(SessionError, match=sentence):
        open_session(made.path)


def test_colour_of_another_size_is_left_out_and_told(tmp_path, rng):
    made = make_open3d(tmp_path / "room", rng)
    for path in (made.path / "color").iterdir():
        Image.fromarray(np.zeros((96, 128, 3), np.uint8)).save(path)
    session = open_session(made.path)
    assert session[0].colour is None
    assert "not registered" in session.warnings[0]


def test_bop_numbers_cameras_and_units(tmp_path, rng):
    made = make_bop(tmp_path / "test" / "000001", rng)
    session = open_session(made.path)
    assert session.name == "test/000001"
    np.testing.assert_array_equal(session[3].colour[0, 0], (3, 20, 230))
    (made.path / "depth" / "000001.png").unlink()
    fewer = open_session(made.path)
    check(fewer, made.raw[[0, 2, 3]])
    np.testing.assert_allclose(fewer.times, np.array([0, 2, 3]) / 30, atol=1e-9)
    assert "1 images listed" in fewer.warnings[0]
    file = made.path / "scene_camera.json"
    entries = json.loads(file.read_text())
    entries["2"]["depth_scale"] = 1.0
    file.write_text(json.dumps(entries))
    with pytest.raises(SessionError, match="images 0 and 2 have different cameras or units"):
        open_session(made.path)
    file.write_text(json.dumps({"0": {"cam_K": [1, 2]}}))
    with pytest.raises(SessionError, match="should give cam_K"):
        open_session(made.path)


@pytest.mark.parametrize("maker", [make_npz, make_hdf5])
def test_arrays(tmp_path, rng, maker):
    made = maker(tmp_path / "take", rng)
    with open_session(made.path) as session:
        check(session, made.raw)
        assert (session.camera, session.depth_unit, session.format) == (made.camera, 0.001, "arrays")
        np.testing.assert_array_equal(session[2].truth.joints, made.joints[2])
        np.testing.assert_allclose(session.times, np.arange(4) / 60, atol=1e-9)
        assert any("4×48×64 uint16" in line for line in session.contents)


@pytest.mark.parametrize("how", ["external", "virtual"])
def test_arrays_that_lie_in_other_files_are_refused(tmp_path, how):
    """An upload could read any file of the server so."""
    secret, path = tmp_path / "secret", tmp_path / "take.h5"
    secret.write_bytes(bytes(2 * 48 * 64 * 2))
    with h5py.File(path, "w") as file:
        if how == "external":
            file.create_dataset("depth", (2, 48, 64), "u2", external=[(str(secret), 0, h5py.h5f.UNLIMITED)])
        else:
            layout = h5py.VirtualLayout((2, 48, 64), "u2")
            layout[:] = h5py.VirtualSource(str(secret), "depth", (2, 48, 64))
            file.create_virtual_dataset("depth", layout)
    with pytest.raises(SessionError, match="lie in other files"):
        open_session(path)


def test_compressed_and_single_arrays(tmp_path, rng):
    made = make_npz(tmp_path / "take", rng, packed=True)
    check(open_session(made.path), made.raw)
    np.save(tmp_path / "take.npy", made.raw)
    with pytest.raises(SessionError, match="does not say which camera"):
        open_session(tmp_path / "take.npy")
    check(open_session(tmp_path / "take.npy", camera=made.camera), made.raw)


@pytest.mark.parametrize("maker", [make_npz, make_hdf5])
def test_floating_point_arrays_are_metres_unless_told(tmp_path, rng, maker):
    made, _ = array_content(rng)
    metres = np.where(made.raw > 0, made.raw * 0.001, np.nan)
    for number, (stored, unit) in enumerate(((metres, 1.0), (metres.astype(np.float32), 1.0), (metres * 1000, 0.001))):
        path = maker(tmp_path / str(number), np.random.default_rng(5), depth=stored, depth_unit=unit).path
        with open_session(path) as session:
            assert session.depth_unit == 0.0001
            check(session, made.raw * 10)
    path = maker(tmp_path / "mm", rng, depth=metres * 1000, depth_unit=1.0).path
    with pytest.raises(SessionError, match="wrong unit"):
        open_session(path)
    with open_session(f"{path}?unit=0.001") as session:
        check(session, made.raw * 10)


def test_several_arrays_are_left_to_choose(tmp_path, rng):
    made = make_npz(tmp_path / "take", rng, infrared=scene(rng, 4, 64, 48))
    with pytest.raises(SessionError, match=r"several arrays with depth.*depth \(4×48×64 uint16\), infrared"):
        open_session(made.path)
    check(open_session(f"{made.path}?topic=depth"), made.raw)


@pytest.mark.parametrize(
    ("changes", "sentence"),
    [
        ({"K": np.zeros(3)}, "does not say which camera"),
        ({"K": np.zeros((3, 3))}, "impossible camera"),
        ({"times": np.arange(3.0)}, r"times for 4 frames"),
        ({"times": np.zeros(4)}, "do not increase"),
        ({"times": np.array([0, 1, np.nan, 2])}, "impossible ones"),
        ({"depth_unit": -1.0}, "impossible depth_unit"),
        ({"depth": np.zeros((4, 48, 64), np.uint16)}, "no depth reading"),
        ({"depth": np.zeros((48, 64), np.uint16)}, "no array of depth images"),
    ],
)
@pytest.mark.parametrize("maker", [make_npz, make_hdf5])
def test_arrays_with_faults(tmp_path, rng, changes, sentence, maker):
    with pytest.raises(SessionError, match=sentence):
        open_session(maker(tmp_path / "take", rng, **changes).path)


def test_objects_are_not_loaded(tmp_path, rng):
    made = make_npz(tmp_path / "take", rng, K=np.array([{"fx": 1}], dtype=object))
    with pytest.raises(SessionError, match="objects"):
        open_session(made.path)
