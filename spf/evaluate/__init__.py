"""How well a run did (spec 9): joint errors against the truth, agreement with the depth, losses and time."""

from spf.evaluate.contradictions import CONTRADICTED, label_energy, labelled_hand
from spf.evaluate.depth_agreement import Agreement, agreement_with_depth, beyond_wrist, surface_distances
from spf.evaluate.floor import Floor, floor_of, marked
from spf.evaluate.joint_errors import JointMeasures, joint_errors, measure_joints
from spf.evaluate.losses import Losses, count_losses
from spf.evaluate.report import Compared, compare_run, evaluate_run, measures_of

__all__ = [
    "CONTRADICTED",
    "Agreement",
    "Compared",
    "Floor",
    "JointMeasures",
    "Losses",
    "agreement_with_depth",
    "beyond_wrist",
    "compare_run",
    "count_losses",
    "evaluate_run",
    "floor_of",
    "joint_errors",
    "label_energy",
    "labelled_hand",
    "marked",
    "measure_joints",
    "measures_of",
    "surface_distances",
]
