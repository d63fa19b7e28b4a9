"""How well a run did (spec 9): joint errors against the truth, agreement with the depth, losses and time."""

from spf.evaluate.depth_agreement import Agreement, agreement_with_depth
from spf.evaluate.joint_errors import JointMeasures, joint_errors, measure_joints
from spf.evaluate.losses import Losses, count_losses
from spf.evaluate.report import evaluate_run

__all__ = [
    "Agreement",
    "JointMeasures",
    "Losses",
    "agreement_with_depth",
    "count_losses",
    "evaluate_run",
    "joint_errors",
    "measure_joints",
]
