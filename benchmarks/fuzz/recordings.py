"""Small good recordings of every format that is read, made by the tests' makers."""

from __future__ import annotations

from tests.sessions.file_makers import FILE_MAKERS, make_hdf5
from tests.sessions.makers import MAKERS
from tests.sessions.ros_makers import ROS_MAKERS, make_ros_rvl

__all__ = ["RECORDINGS"]

#: Name → function of a path and a random generator that makes the recording.
RECORDINGS = {**MAKERS, **ROS_MAKERS, **FILE_MAKERS, "arrays-hdf5": make_hdf5, "ros-rvl": make_ros_rvl}
