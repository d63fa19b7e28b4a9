"""ROS recordings as people have them: any topics, encodings, clocks and faults; all written by rosbags."""

from __future__ import annotations

import json

import cv2
import numpy as np
import pytest
from rosbags.rosbag1 import Writer as Writer1

from spf.errors import SessionError
from spf.frame import Camera
from spf.sessions import open_session
from tests.sessions.makers import scene
from tests.sessions.ros_makers import (
    CAMERA,
    HEIGHT,
    START,
    STEP,
    WIDTH,
    Topics,
    depth_messages,
    make_realsense,
    make_ros1_bag,
    make_ros_mcap,
    stamps,
    write_ros1,
    write_ros2,
)

ROS2 = Topics(ros1=False)


@pytest.fixture
def raw(rng):
    return scene(rng, 4, WIDTH, HEIGHT)


def write(folder, messages):
    """Write a ROS 2 MCAP; returns its path as text."""
    return str(write_ros2(folder / "bag", messages, mcap=True))


def infos(topic="/cam/camera_info", camera=CAMERA, **options):
    return [(topic, stamp, ROS2.camera_info(camera, stamp, **options)) for stamp in stamps(4)]


def depths(raw, topic="/cam/image_raw", encoding="16UC1", **options):
    return [
        (topic, time, ROS2.image(image, encoding, time, **options)) for image, time in zip(raw, stamps(4), strict=True)
    ]


def check(session, raw):
    np.testing.assert_array_equal(np.stack([session.raw_depth(i) for i in range(len(session))]), raw)


def test_times_are_those_of_the_sensor(tmp_path, raw):
    messages = depth_messages(ROS2, raw)
    jittered = [(topic, time + 7_000_000 * (n % 3), message) for n, (topic, time, message) in enumerate(messages)]
    session = open_session(write(tmp_path, jittered))
    assert session.times_ns.tolist() == [0, STEP, 2 * STEP, 3 * STEP]
    assert session.start_time_ns == START
    assert "/head/depth/camera_info: 4 × sensor_msgs/msg/CameraInfo" in session.contents


def test_frames_out_of_order_are_sorted_by_their_time(tmp_path, raw):
    swapped = [(t, time, m) for (t, _, m), (_, time, _) in zip(depths(raw)[::-1], depths(raw), strict=True)]
    session = open_session(write(tmp_path, infos() + swapped))
    check(session, raw)
    assert session.times_ns.tolist() == [0, STEP, 2 * STEP, 3 * STEP]


def test_without_clock_the_times_of_recording_are_taken_and_told(tmp_path, raw):
    messages = [
        ("/cam/image_raw", time, ROS2.image(image, "16UC1", 0)) for image, time in zip(raw, stamps(4), strict=True)
    ]
    session = open_session(write(tmp_path, infos() + messages))
    assert session.times_ns.tolist() == [0, STEP, 2 * STEP, 3 * STEP]
    assert session.warnings == ("The images have no time stamps of their own: the times of recording were taken.",)


@pytest.mark.parametrize("order", "<>")
def test_padded_rows_in_both_byte_orders(tmp_path, raw, order):
    session = open_session(write(tmp_path, infos() + depths(raw.astype(order + "u2"), padding=6)))
    check(session, raw)


def test_floating_point_metres(tmp_path, raw):
    metres = (raw * np.float32(0.001)).astype(np.float32)
    metres[raw == 0] = np.nan
    metres[:, 0, :4] = [np.inf, -np.inf, -1, 7]  # beyond 6.5535 m there is no reading
    session = open_session(write(tmp_path, infos() + depths(metres, encoding="32FC1")))
    assert session.depth_unit == 0.0001
    raw[:, 0, :4] = 0
    check(session, raw * 10)
    assert session.metadata["depth"] == "floating point, rounded to 0.0001 m"
    coarse = open_session(f"{session.uri}?unit=0.001")
    assert coarse.depth_unit == 0.001
    raw[:, 0, 3] = 7000
    check(coarse, raw)


@pytest.mark.parametrize(
    "layout", ["16UC1; compressedDepth", "16UC1; compressedDepth png", "16UC1; compressedDepth rvl"]
)
def test_compressed_depth(tmp_path, raw, layout):
    messages = [
        ("/cam/image_raw/compressedDepth", time, ROS2.compressed(image, time, layout))
        for image, time in zip(raw, stamps(4), strict=True)
    ]
    session = open_session(write(tmp_path, infos() + messages))
    check(session, raw)
    assert session.camera == CAMERA
    both = open_session(write(tmp_path / "both", infos() + messages + depths(raw)))
    assert both.metadata["topic"] == "/cam/image_raw"


@pytest.mark.parametrize("code", ["png", "rvl"])
def test_compressed_floating_point_depth(tmp_path, raw, code):
    # Inverse depth, as compressed_depth_image_transport quantises it: stored = a / depth + b.
    a, b = 5050.0, -504.0
    with np.errstate(divide="ignore"):
        stored = np.where(raw > 0, np.rint(a / (raw * 0.001) + b), 0).astype(np.uint16)
    messages = [
        ("/cam/image/compressedDepth", time, ROS2.compressed(image, time, f"32FC1; compressedDepth {code}", a, b))
        for image, time in zip(stored, stamps(4), strict=True)
    ]
    session = open_session(write(tmp_path, infos() + messages))
    for index, image in enumerate(raw):
        np.testing.assert_array_equal(session[index].depth > 0, image > 0)
        np.testing.assert_allclose(session[index].depth, image * 0.001, atol=1.5e-4)


def test_several_depth_topics_are_left_to_choose(tmp_path, raw, rng):
    other = scene(rng, 4, WIDTH, HEIGHT)
    wide = CAMERA._replace(fx=99.0)
    path = write(
        tmp_path, depths(raw) + infos() + depths(other, topic="/b/depth") + infos("/b/camera_info", camera=wide)
    )
    with pytest.raises(SessionError, match=r"several topics with depth.*\?topic=/b/depth'.*/b/depth \(4 images\), "):
        open_session(path)
    check(open_session(f"{path}?topic=/cam/image_raw"), raw)
    session = open_session(f"{path}?topic=/b/depth")
    check(session, other)
    assert session.camera == wide
    assert open_session(session.uri).fingerprint() == session.fingerprint()
    with pytest.raises(SessionError, match=r"no topic /c with images; those with images are: /b/depth, /cam/image_raw"):
        open_session(f"{path}?topic=/c")


def test_no_depth_says_what_is_there(tmp_path, raw):
    colour = np.zeros((HEIGHT, WIDTH * 3), np.uint8)
    path = write(tmp_path, [("/rgb", START, ROS2.image(colour, "rgb8", START)), *infos()])
    with pytest.raises(SessionError, match=r"MCAP file without depth images .*its images are /rgb \(rgb8\)"):
        open_session(path)
    with pytest.raises(SessionError, match=r"without depth images .*its topics are /cam/camera_info"):
        open_session(write(tmp_path / "infos", infos()))


def test_a_camera_elsewhere_is_taken_only_if_it_is_certain(tmp_path, raw):
    fitting = open_session(write(tmp_path / "a", depths(raw) + infos("/lens")))
    assert fitting.camera == CAMERA
    cases = [
        infos("/lens", frame="other"),
        infos("/lens") + infos("/lens2"),
        infos("/lens", camera=CAMERA._replace(width=41)),
    ]
    for number, others in enumerate(cases):
        path = write(tmp_path / str(number), depths(raw) + others)
        with pytest.raises(
            SessionError, match=r"does not say which camera took /cam/image_raw .*\?camera_info=.*--camera"
        ):
            open_session(path)
    assert open_session(f"{tmp_path}/1/bag/bag.mcap?camera_info=/lens2").camera == CAMERA


def test_wrong_missing_and_empty_cameras_are_asked_for(tmp_path, raw):
    missing = write(tmp_path / "missing", depths(raw))
    with pytest.raises(SessionError, match=r"does not say which camera took .*--camera FILE"):
        open_session(missing)
    uncalibrated = write(tmp_path / "none", depths(raw) + infos(camera=Camera(WIDTH, HEIGHT, 0, 0, 0, 0)))
    with pytest.raises(SessionError, match="was never calibrated: give the camera"):
        open_session(uncalibrated)
    small = write(tmp_path / "small", depths(raw) + infos(camera=CAMERA._replace(width=20)))
    with pytest.raises(SessionError, match=r"are 40×30, but their camera \(/cam/camera_info\) is for images of 20×30"):
        open_session(small)
    file = tmp_path / "camera.json"
    file.write_text(json.dumps({"fx": 50, "fy": 51, "cx": 20, "cy": 15}))
    for path in (missing, uncalibrated, small):
        for session in (open_session(path, camera=file), open_session(f"{path}?camera={file}")):
            assert session.camera == Camera(WIDTH, HEIGHT, 50, 51, 20, 15)
            assert session.metadata["camera"] == "given by the user"


def test_lens_distortion_is_taken_out(tmp_path):
    """Points on a plane, seen through a lens: after reading, every pixel shows what its straight ray hits."""
    camera, d = Camera(160, 120, 120.0, 118.0, 80.0, 61.0), (-0.28, 0.09, 0.002, -0.003, 0.01)
    v, u = np.mgrid[0:120, 0:160]
    points = cv2.undistortPoints(
        np.stack([u, v], -1).reshape(-1, 1, 2).astype(np.float64),
        np.array([[camera.fx, 0, camera.cx], [0, camera.fy, camera.cy], [0, 0, 1]]),
        np.array(d),
    ).reshape(120, 160, 2)
    tilted = np.rint(500 + 300 * points[..., 0] - 200 * points[..., 1]).astype(np.uint16)  # of the ray's direction
    raw = np.repeat(tilted[None], 4, axis=0)
    for topic, straight in (("/cam/image_raw", True), ("/cam/image_rect", False)):
        messages = depths(raw, topic) + infos(camera=camera, d=d)
        session = open_session(write(tmp_path / topic.rpartition("/")[2], messages))
        if not straight:  # rectified when it was recorded: P tells its camera, and nothing is to be taken out
            assert session.camera == Camera(160, 120, 121.0, 119.0, 81.0, 62.0)
            check(session, raw)
            continue
        assert session.camera == camera
        expected = 500 + 300 * (u - camera.cx) / camera.fx - 200 * (v - camera.cy) / camera.fy
        seen = session.raw_depth(0)
        assert (seen > 0).mean() > 0.9
        assert np.abs(seen - expected)[seen > 0].max() < 4  # mm: the nearest pixel is up to 0.7 pixels away
        assert np.abs(tilted - expected).max() > 20


def test_unknown_distortion_is_refused(tmp_path, raw):
    path = write(tmp_path, depths(raw) + infos(model="mystery", d=(0.1, 0.2, 0.3)))
    with pytest.raises(SessionError, match=r"lens distortion of an unknown model \(mystery, 3"):
        open_session(path)


def test_the_wrong_unit_is_refused_and_can_be_given(tmp_path, raw):
    path = write(tmp_path, infos() + depths(raw * 100))
    with pytest.raises(SessionError, match="wrong unit"):
        open_session(path)
    session = open_session(f"{path}?unit=1e-5")
    assert session.depth_unit == 1e-5
    with pytest.raises(SessionError, match="no positive number"):
        open_session(f"{path}?unit=mm")
    with pytest.raises(SessionError, match="cannot be chosen"):
        open_session(f"{path}?units=1")


@pytest.mark.parametrize("compression", [None, *Writer1.CompressionFormat])
@pytest.mark.parametrize("chunk", [1, 2**20])
def test_ros1_chunks(tmp_path, rng, compression, chunk):
    options = {"chunk": chunk} if compression is None else {"chunk": chunk, "compression": compression}
    made = make_ros1_bag(tmp_path / "a.bag", rng, **options)
    check(open_session(made.path), made.raw)


@pytest.mark.parametrize("packed", [False, True])
@pytest.mark.parametrize("mcap", [False, True])
def test_ros2_folder_and_its_file(tmp_path, raw, mcap, packed):
    file = write_ros2(tmp_path / "bag", depth_messages(ROS2, raw), mcap, packed)
    check(open_session(tmp_path / "bag"), raw)
    if not packed:
        check(open_session(file), raw)


def test_ros2_folder_of_several_files(tmp_path, raw):
    first = write_ros2(tmp_path / "bag", depth_messages(ROS2, raw)[:4], mcap=False)
    second = write_ros2(tmp_path / "second", depth_messages(ROS2, raw)[4:], mcap=False)
    second.rename(tmp_path / "bag" / "bag_1.db3")
    session = open_session(tmp_path / "bag")
    check(session, raw)
    assert first.parent.name == session.name == "bag"


def test_realsense_1_bag(tmp_path, rng):
    """As librealsense until 2.56 wrote it: mono16 with four bytes too many, the unit and the camera in their own topics."""
    ros1, raw = Topics(ros1=True), scene(rng, 4, WIDTH, HEIGHT) * 4
    sensor = "/device_0/sensor_0"
    messages = [
        (f"{sensor}/option/Depth_Units/value", 1, ros1.make("std_msgs/msg/Float32", data=np.float32(0.00025))),
        ("/device_0/info", 1, ros1.make("diagnostic_msgs/msg/KeyValue", key="Name", value="Intel RealSense D435")),
        ("/device_0/info", 1, ros1.make("diagnostic_msgs/msg/KeyValue", key="Serial Number", value="8277")),
        (f"{sensor}/Depth_0/info/camera_info", 1, ros1.camera_info(CAMERA, 0)),
        *[
            (f"{sensor}/Depth_0/image/data", 9 + n, ros1.image(image, "mono16", time))
            for n, (image, time) in enumerate(zip(raw, stamps(4), strict=True))
        ],
        (f"{sensor}/Infrared_1/image/data", 99, ros1.image(raw[0].astype(np.uint8), "mono8", START)),
    ]
    write_ros1(tmp_path / "d435.bag", messages, tail=b"\1\2\3\4")
    session = open_session(tmp_path / "d435.bag")
    check(session, raw)
    assert (session.format, session.depth_unit, session.camera) == ("realsense", 0.00025, CAMERA)
    assert session.metadata["sensor"] == "Intel RealSense D435 8277"
    assert session.times_ns.tolist() == [0, STEP, 2 * STEP, 3 * STEP]


def test_realsense_times_are_those_of_the_frames(tmp_path, rng):
    session = open_session(make_realsense(tmp_path / "rs", rng).path)
    np.testing.assert_allclose(session.times_ns, np.arange(5) * STEP, atol=1000)  # stored as ms with 6 places


@pytest.mark.parametrize("maker", [make_ros1_bag, make_ros_mcap])
def test_a_torn_bag_gives_its_whole_chunks(tmp_path, rng, maker):
    made = maker(tmp_path / "whole", rng, frames=40)
    data = made.path.read_bytes()
    torn, counts, refused = tmp_path / "torn", set(), []
    for size in range(2000, len(data) - 1, len(data) // 40):
        torn.write_bytes(data[:size])
        try:
            session = open_session(torn)
        except SessionError as error:
            refused.append(str(error))
            continue
        assert session.warnings[0].startswith("torn was torn or is damaged: ")
        counts.add(len(session))
        for index in range(len(session)):
            number = round(session.times_ns[index] / STEP)
            np.testing.assert_array_equal(session.raw_depth(index), made.raw[number])
    assert max(counts) == 40
    assert all("torn" in sentence for sentence in refused)
