"""Prepare a run: its first pose and hand shape, found automatically, taken from the truth or read from a file."""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Sequence
from pathlib import Path
from typing import overload

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from spf.calibrate import fit_shape
from spf.cost.problem import golden, make_problem
from spf.cost.settings import CostSettings
from spf.errors import HandError, StartError
from spf.frame import Frame
from spf.hand.kinematics import joints_of
from spf.hand.model import Hand, Side, load_hand
from spf.hand.pose_file import read_pose
from spf.hand.shape import HandShape
from spf.initialise import Start, find_start
from spf.lens import Through, seen_through
from spf.locate import reach_of
from spf.observation import observe
from spf.progress import Report
from spf.sessions import Session
from spf.shape_equations import View

__all__ = ["SessionFrames", "fit_pose", "prepare", "side_of"]

Array = NDArray[np.float64]
_KEPT = 64  # decoded frames that are kept: what one start looks at
_PALM = np.array([0, 1, 5, 9, 13, 17])  # joints that move with the palm, more or less
_CALIBRATED, _VIEWS = 48, 12  # frames that a hand is calibrated on, and how many of them are looked at
_PALM_REACH = 0.05  # m around the middle of the palm's joints
_REST = 0.001  # m per radian: how strongly a fit prefers the bind pose where the joints say nothing


class SessionFrames(Sequence[Frame]):
    """Frames ``[first, last)`` of a session as a sequence that decodes a frame when it is asked for.

    Args:
        session: what they are read from.
        first, last: range; None for the session's end.
    """

    def __init__(self, session: Session, first: int = 0, last: int | None = None) -> None:
        self._session = session
        self._range = range(first, len(session) if last is None else min(last, len(session)))
        self._kept: OrderedDict[int, Frame] = OrderedDict()

    def __len__(self) -> int:
        return len(self._range)

    @overload
    def __getitem__(self, index: int) -> Frame: ...

    @overload
    def __getitem__(self, index: slice) -> SessionFrames: ...

    def __getitem__(self, index: int | slice) -> Frame | SessionFrames:
        if isinstance(index, slice):
            part = SessionFrames(self._session)
            part._range, part._kept = self._range[index], self._kept
            return part
        position = self._range[index]
        if position not in self._kept:
            self._kept[position] = self._session[position]
            if len(self._kept) > _KEPT:
                self._kept.popitem(last=False)
        return self._kept[position]


def prepare(
    session: Session,
    *,
    init: str | Path = "auto",
    shape: HandShape | None = None,
    seed: int = 0,
    first: int = 0,
    last: int | None = None,
    progress: Report | None = None,
) -> Start:
    """Prepare the start of a run.

    Args:
        session: to track.
        init: ``"auto"``, ``"truth"`` or the path of a pose file.
        shape: of the hand when it is known; None to take that of the pose file or of the truth, else to calibrate it
            from the depth.
        seed: of all randomness.
        first, last: frames ``[first, last)`` are to be tracked; ``None``: to the end.
        progress: called with what is being done and the share done.

    Returns:
        The start; :attr:`Start.frame` counts from the session's first frame, and :attr:`Start.doubt` says whether it
        may be wrong.

    Raises:
        StartError: no frame shows a hand, or there is no truth.
        HandError: the pose file or the hand shape is for another hand.
        SessionError: a frame cannot be read.
    """
    if shape is not None and session.side is not None and shape.side != session.side:
        raise HandError(f"The hand shape is of a {shape.side} hand, and {session.name} shows a {session.side} hand.")
    frames = SessionFrames(session, first, last)
    rng = np.random.default_rng([seed, 1])
    if init == "auto":
        start = find_start(frames, rng, side=session.side, shape=shape, progress=progress)
        return start._replace(frame=first + start.frame)
    if init == "truth":
        return _from_truth(session, frames, shape, rng)
    return _from_file(session, frames, Path(init), shape, rng, progress)


def _from_file(
    session: Session,
    frames: SessionFrames,
    path: Path,
    shape: HandShape | None,
    rng: np.random.Generator,
    progress: Report | None,
) -> Start:
    saved = read_pose(path)
    side = shape.side if shape is not None else session.side
    if side is not None and side != saved.side:
        whose = f"the hand shape is of a {side}" if shape is not None else f"{session.name} shows a {side}"
        raise HandError(f"The pose file {path} is of a {saved.side} hand, and {whose} hand.")
    first, last = frames[0].index, frames[-1].index
    index = first if saved.frame is None else saved.frame
    if not first <= index <= last:
        raise HandError(f"The pose file {path} is for frame {index}, outside the frames {first} to {last} to track.")
    used = shape or saved.shape
    if used is None:
        used = find_start(frames[index - first :], rng, side=saved.side, progress=progress).shape
    return _judged(seen_through(frames[index - first], used.lens), used, saved.pose, saved.reference, rng)


def _from_truth(
    session: Session,
    frames: SessionFrames,
    shape: HandShape | None,
    rng: np.random.Generator,
) -> Start:
    """Take the exact pose where the truth has one and the hand is the exact one, else fit a pose to the true joints."""
    if not session.has_truth:
        raise StartError(f"{session.name} has no ground truth to start from; use --init auto or a pose file.")
    seen = Through(frames, 1.0 if shape is None else shape.lens)
    position = next((i for i, frame in enumerate(seen) if _shows_its_truth(frame)), None)
    if position is None:
        raise StartError(f"None of the frames of {session.name} to track shows a hand with truth; use --init auto.")
    frame = seen[position]
    truth = frame.truth
    assert truth is not None
    if shape is None and truth.pose is not None and session.hand_shape is not None:
        exact = HandShape.from_dict(session.hand_shape, f"The hand shape of {session.name}")
        orientation = np.eye(3) if truth.orientation is None else truth.orientation
        return _judged(frame, exact, truth.pose, orientation, rng)
    if shape is None:
        shape = _calibrated(session.side or side_of(truth.joints), frames[position : position + _CALIBRATED], rng)
    pose, reference = fit_pose(shape.hand(), truth.joints)
    return _judged(frame, shape, pose, reference, rng)


def _shows_its_truth(frame: Frame) -> bool:
    """Tell whether a frame has a truth and some surface where that puts the palm; a hand may be just out of view."""
    if frame.truth is None:
        return False
    palm = frame.truth.joints[_PALM]
    palm = palm[np.isfinite(palm).all(axis=1)]
    return len(palm) > 0 and not observe(frame, palm.mean(axis=0), _PALM_REACH).is_empty


def _calibrated(side: Side, frames: SessionFrames, rng: np.random.Generator) -> HandShape:
    """Calibrate a hand from the depth of frames whose true joints give its poses."""
    truth = frames[0].truth
    assert truth is not None
    shape = HandShape(side, scale=_size_ratio(load_hand(side), truth.joints))
    for refined in (False, True):
        hand = shape.hand()
        views = []
        for frame in (frames[i] for i in range(0, len(frames), _CALIBRATED // _VIEWS)):
            if frame.truth is not None:
                pose, reference = fit_pose(hand, frame.truth.joints)
                views.append(View(observe(frame, pose[:3], reach_of(hand)), pose, reference))
        shape = fit_shape([view for view in views if not view.observation.is_empty], shape, rng, refine=refined)[0]
    return shape


def _judged(frame: Frame, shape: HandShape, pose: Array, reference: Array, rng: np.random.Generator) -> Start:
    """Say how well a given pose explains its frame: what a loss is judged against later.

    Raises:
        StartError: there is nothing where the pose puts the hand.
    """
    hand = shape.hand()
    observation = observe(frame, pose[:3], reach_of(hand))
    if observation.is_empty:
        raise StartError(
            f"Frame {frame.index} shows nothing where the first pose puts the hand; check its units (metres) and frame."
        )
    problem = make_problem(hand, observation, CostSettings(), reference, rng)
    energy = float(golden(problem, pose[None])[0][0])
    return Start(frame.index, pose, reference, shape, energy, 1.0)


def fit_pose(hand: Hand, joints: Array) -> tuple[Array, Array]:
    """Fit a pose to joints by least squares, within the joint limits.

    Args:
        hand: the model.
        joints: (21, 3) m, camera frame; NaN where a joint is not known.

    Returns:
        (pose (D,), reference (3, 3)): the palm's rotation is in the reference, its angles are a small correction.

    Raises:
        StartError: fewer than three joints of the palm are known.
    """
    reference, translation = _palm_placed(hand, joints)
    known = _known(joints)
    first = hand.constrain(hand.neutral_pose())
    first[:3] = translation
    digits = np.zeros(hand.dofs)
    digits[6:] = _REST

    def residuals(pose: Array) -> Array:
        apart = (joints_of(hand, pose, reference) - joints)[known]
        return np.concatenate([apart.ravel(), digits * pose])

    fitted = least_squares(residuals, first, bounds=(hand.limits[:, 0] - 1e-9, hand.limits[:, 1] + 1e-9), x_scale=0.1)
    return hand.constrain(fitted.x), reference


def _palm_placed(hand: Hand, joints: Array) -> tuple[Array, Array]:
    """Rotation and translation that lay the palm's joints over the known ones (Kabsch 1976)."""
    known = _PALM[_known(joints)[_PALM]]
    if len(known) < 3:
        raise StartError("The ground truth of the first frame lacks the joints of the palm; use --init auto.")
    own = joints_of(hand, hand.neutral_pose())[known]
    own_middle, middle = own.mean(axis=0), joints[known].mean(axis=0)
    u, _, vt = np.linalg.svd((joints[known] - middle).T @ (own - own_middle))
    rotation = u @ np.diag([1.0, 1.0, np.linalg.det(u @ vt)]) @ vt
    return rotation, middle - rotation @ own_middle


def _known(joints: Array) -> NDArray[np.bool_]:
    """(21,) which joints are known."""
    return np.asarray(np.isfinite(joints).all(axis=1))


def _size_ratio(hand: Hand, joints: Array) -> float:
    """How much larger than a hand's palm that of the given joints (21, 3) is."""
    palm = _PALM[_known(joints)[_PALM]]
    own = joints_of(hand, hand.neutral_pose())[palm]
    return float(np.linalg.norm(joints[palm].std(axis=0)) / np.linalg.norm(own.std(axis=0)))


def side_of(joints: Array) -> Side:
    """Return the side of the hand whose joints (21, 3) are given: the one that they are fitted by more closely."""
    known = _known(joints)

    def misfit(side: Side) -> float:
        bind = load_hand(side)
        hand = bind.scaled(_size_ratio(bind, joints))
        pose, reference = fit_pose(hand, joints)
        return float(np.linalg.norm((joints_of(hand, pose, reference) - joints)[known]))

    return "right" if misfit("right") <= misfit("left") else "left"
