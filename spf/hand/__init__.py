"""The hand: mesh and skeleton from a ``.glb``, pose, forward kinematics, skinning and its derivatives, hand shape."""

from spf.hand.model import BONES, DOF_NAMES, FREE_DIP_NAMES, Hand, load_hand
from spf.hand.pose_file import SavedPose, read_pose, write_pose
from spf.hand.shape import HandShape, read_hand_shape, write_hand_shape

__all__ = [
    "BONES",
    "DOF_NAMES",
    "FREE_DIP_NAMES",
    "Hand",
    "HandShape",
    "SavedPose",
    "load_hand",
    "read_hand_shape",
    "read_pose",
    "write_hand_shape",
    "write_pose",
]
