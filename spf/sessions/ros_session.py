"""Depth sessions in ROS recordings: ROS 1 bags, ROS 2 bags (SQLite, MCAP), MCAP of other programs, and RealSense's own.

A recording may hold many topics. The one with depth is found by what its images are; where there are several the user
chooses. The camera is the CameraInfo beside the images; where none belongs to them it is asked for.
"""

from __future__ import annotations

import struct
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from spf.errors import SessionError
from spf.progress import Report
from spf.sessions.bag import Bag, damaged
from spf.sessions.camera_file import EXAMPLE
from spf.sessions.choice import Choice
from spf.sessions.files import check_depth_unit
from spf.sessions.realsense_bag import RealSenseStream, realsense_stream
from spf.sessions.rectify import Lens, Rectify, rectification
from spf.sessions.ros_wire import (
    CAMERA_INFO,
    COMPRESSED,
    IMAGE,
    CameraInfo,
    Image,
    Wire,
    decode_camera_info,
    decode_image,
)
from spf.sessions.session import Session
from spf.sessions.streams import choose_stream

__all__ = ["RosSession", "open_ros"]

#: Metres per count: of integers as REP 118 has it, and what floating point metres are rounded to.
_INTEGER_UNIT, _FLOAT_UNIT = 0.001, 0.0001

_HEAD = 16  # bytes of a message that hold its time stamp
_OFTEN = 100  # messages between two reports


@dataclass(frozen=True, kw_only=True, eq=False)
class RosSession(Session):
    """A session in a ROS recording.

    Attributes:
        bag: the recording.
        topic: of the depth images.
        positions: of the N frames among the messages of the topic.
        rectify: takes out the lens distortion, None if there is none.
    """

    bag: Bag
    topic: str
    positions: NDArray[np.int64]
    rectify: Rectify | None

    def raw_depth(self, index: int) -> NDArray[np.uint16]:
        """Return the (H, W) raw counts of a frame."""
        position = int(self.positions[index])
        image = _image(self.bag, self.topic, position)
        if image.pixels is None:  # damage to its encoding: the topic as a whole has depth
            raise damaged(self.bag.path, f"image {position} of {self.topic}")
        raw = image.counts(self.depth_unit)
        size = (self.camera.width, self.camera.height)
        if raw.shape[::-1] != size:
            raise SessionError(
                f"Frame {index} of {self.uri} is {raw.shape[1]}×{raw.shape[0]}, but its camera is {size[0]}×{size[1]}: "
                "give the camera of these images with --camera."
            )
        return raw if self.rectify is None else self.rectify(raw)


class _Depth(NamedTuple):
    """A topic with depth images, and the first of them that can be read."""

    topic: str
    image: Image


def open_ros(bag: Bag, name: str, form: str, uri: str, choice: Choice, report: Report) -> Session:
    """Open a recording as a session.

    Args:
        bag: the recording.
        name, form, uri: of the session.
        choice: what was chosen of it.
        report: is told how far reading the time stamps is.

    Raises:
        SessionError: there is no depth, or several topics with depth and none is chosen; no camera belongs to it; the
            unit is not believable; or the recording is damaged.
    """
    depth = _find_depth(bag, uri, choice)
    stream = realsense_stream(bag, depth.topic)
    lens, notes = _lens(bag, depth, stream, uri, choice)
    positions, times, warnings = _times(bag, depth.topic, stream, uri, report)
    is_float = depth.image.encoding == "32FC1"
    unit = choice.depth_unit or (stream and stream.unit) or (_FLOAT_UNIT if is_float else _INTEGER_UNIT)
    if is_float:
        notes["depth"] = f"floating point, rounded to {unit:g} m"
    if stream:
        notes["sensor"] = stream.sensor
    session = RosSession(
        uri=uri,
        name=name,
        format=form,
        camera=lens.camera,
        times_ns=times - times[0],
        depth_unit=unit,
        start_time_ns=int(times[0]) if times[0] > 10**18 else 0,  # smaller: a clock that began with the recording
        metadata={"topic": depth.topic, "frame_id": depth.image.frame_id, **notes},
        contents=tuple(f"{topic.name}: {topic.messages} × {topic.kind}" for topic in sorted(bag.topics.values())),
        warnings=(*bag.warnings, *warnings),
        bag=bag,
        topic=depth.topic,
        positions=positions,
        rectify=rectification(lens, uri),
    )
    check_depth_unit(session, leave_damaged=True)
    return session


def _image(bag: Bag, topic: str, position: int) -> Image:
    try:
        return decode_image(bag.read(topic, position), bag.topics[topic].kind, bag.cdr)
    except (ValueError, struct.error, OverflowError) as error:
        raise damaged(bag.path, f"image {position} of {topic}") from error


def _first_image(bag: Bag, topic: str) -> Image | None:
    """Return the first image of a topic that can be read, None if none of the first few can."""
    for position in range(min(bag.topics[topic].messages, 3)):
        try:
            return _image(bag, topic, position)
        except SessionError:
            continue  # a damaged image does not tell that another one is
    return None


def _find_depth(bag: Bag, uri: str, choice: Choice) -> _Depth:
    images = [topic.name for topic in bag.topics.values() if topic.kind in (IMAGE, COMPRESSED) and topic.messages]
    if choice.topic and choice.topic not in images:
        listed = ", ".join(sorted(images)) or "none"
        raise SessionError(f"{uri}: there is no topic {choice.topic} with images; those with images are: {listed}.")
    first = {name: _first_image(bag, name) for name in ([choice.topic] if choice.topic else images)}
    found = {name: image for name, image in first.items() if image is not None and image.pixels is not None}
    # The same stream recorded twice: the plain images are what the compressed ones were made of.
    twice = {
        name for name in found if name.endswith("/compressedDepth") and name.removesuffix("/compressedDepth") in found
    }
    found = {name: image for name, image in found.items() if name not in twice}
    if not found:
        seen = ", ".join(f"{name} ({image.encoding if image else 'damaged'})" for name, image in sorted(first.items()))
        others = ", ".join(sorted(bag.topics)) or "none"
        raise SessionError(
            f"{bag.path} is a {bag.kind} without depth images (16UC1, mono16, 32FC1 or compressedDepth): "
            + (f"its images are {seen}." if seen else f"its topics are {others}.")
        )
    name = choose_stream(uri, "topics", {name: f"{bag.topics[name].messages} images" for name in found}, choice.topic)
    return _Depth(name, found[name])


def _lens(
    bag: Bag, depth: _Depth, stream: RealSenseStream | None, uri: str, choice: Choice
) -> tuple[Lens, dict[str, str]]:
    assert depth.image.pixels is not None
    height, width = depth.image.pixels.shape
    if choice.camera is not None:
        camera = choice.fitting((width, height), uri)
        return Lens(*camera[:6]), {"camera": "given by the user"}
    topic = choice.camera_info or (stream and stream.camera_info) or _camera_topic(bag, depth, (width, height), uri)
    info = _camera_info(bag, topic, uri)
    lens = info.lens
    if (lens.width, lens.height) != (width, height) or not lens.is_calibrated:
        what = f"is for images of {lens.width}×{lens.height}" if lens.is_calibrated else "was never calibrated"
        raise SessionError(
            f"{uri}: the depth images are {width}×{height}, but their camera ({topic}) {what}: give the camera with "
            f"--camera FILE, a file like {EXAMPLE}."
        )
    if not lens.is_distorted:
        return lens, {"camera_info": topic}
    if _is_rectified(depth.topic):
        return Lens(width, height, *info.rectified), {"camera_info": f"{topic} (rectified)"}
    return lens, {"camera_info": topic, "rectified": f"lens distortion ({lens.model}) was taken out on reading"}


def _is_rectified(topic: str) -> bool:
    """Tell by its name, as ROS has it, whether the images of a topic were rectified before they were recorded."""
    return topic.removesuffix("/compressedDepth").endswith(("image_rect", "image"))


def _camera_info(bag: Bag, topic: str, uri: str) -> CameraInfo:
    found = bag.topics.get(topic)
    if found is None or found.kind != CAMERA_INFO or not found.messages:
        listed = ", ".join(sorted(other.name for other in bag.topics.values() if other.kind == CAMERA_INFO)) or "none"
        raise SessionError(f"{uri}: there is no CameraInfo in the topic {topic}; the topics with one are: {listed}.")
    try:
        return decode_camera_info(bag.read(topic, 0), bag.cdr)
    except (ValueError, struct.error, OverflowError) as error:
        raise damaged(bag.path, f"the camera in {topic}") from error


def _camera_topic(bag: Bag, depth: _Depth, size: tuple[int, int], uri: str) -> str:
    """Return the CameraInfo topic that belongs to the depth: its neighbour, or the only one of its frame and size."""
    neighbour = depth.topic.removesuffix("/compressedDepth").rpartition("/")[0] + "/camera_info"
    infos = [topic.name for topic in bag.topics.values() if topic.kind == CAMERA_INFO and topic.messages]
    if neighbour in infos:
        return neighbour
    found = {name: _camera_info(bag, name, uri) for name in infos}
    fitting = [
        name
        for name, info in found.items()
        if info.frame_id == depth.image.frame_id != "" and (info.lens.width, info.lens.height) == size
    ]
    if len(fitting) == 1:
        return fitting[0]
    listed = f"choose one of its CameraInfo topics with ?camera_info= ({', '.join(sorted(infos))}) or " if infos else ""
    raise SessionError(
        f"{uri} does not say which camera took {depth.topic} ({neighbour} is missing): {listed}give the camera with "
        f"--camera FILE, a file like {EXAMPLE}."
    )


def _times(
    bag: Bag, topic: str, stream: RealSenseStream | None, uri: str, report: Report
) -> tuple[NDArray[np.int64], NDArray[np.int64], tuple[str, ...]]:
    """Return which messages are frames, in order, their times in ns, and what is to be said of them."""
    count = bag.topics[topic].messages
    stamps, readable = np.zeros(count, np.int64), np.zeros(count, bool)
    for done, (position, head) in enumerate(bag.heads(topic, _HEAD)):
        stamp = _stamp(head, bag.cdr)
        if stamp is not None:
            stamps[position], readable[position] = stamp, True
        if done % _OFTEN == 0:
            report("Reading the time stamps", done / count)
    if not readable.any():
        raise SessionError(f"{uri}: no message of {topic} can be read; copy the recording again.")
    if stream is not None and stream.stamps_ns is not None:
        stamps = np.array(stream.stamps_ns, dtype=np.int64)
    warnings = []
    if not readable.all():
        warnings.append(f"{int((~readable).sum())} of the {count} depth images are damaged and were left out.")
    positions = np.flatnonzero(readable)
    # Sensors that set no clock leave zeros, or the same time again and again: then the time of recording is the better.
    times = stamps[positions]
    if len(np.unique(times)) < 0.5 * len(times) or (len(times) > 1 and not times.any()):
        times = bag.times(topic)[positions]
        warnings.append("The images have no time stamps of their own: the times of recording were taken.")
    order = np.argsort(times, kind="stable")
    positions, times = positions[order], times[order]
    fresh = np.concatenate([[True], np.diff(times) > 0])
    if not fresh.all():
        warnings.append(f"{int((~fresh).sum())} depth images have the time of the one before and were left out.")
    return positions[fresh], times[fresh], tuple(warnings)


def _stamp(head: bytes, cdr: bool) -> int | None:
    try:
        return Wire(head, cdr).stamp()
    except (ValueError, struct.error):
        return None
