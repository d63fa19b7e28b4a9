"""Run a tracker over a session: Frame → observe → step, loss noticed and recovered, every frame's result kept.

``track_frame(tracking, state, frame)`` is a pure function of its arguments: a frame's randomness comes from the run's seed
and the frame's index, so that any frame can be repeated, and a run is repeated bit for bit by what its manifest stores.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from spf.cost.spheres import digit_spheres
from spf.filters.step import State, StepInfo, start_at
from spf.frame import Frame
from spf.hand.kinematics import joints_of, relative_to_camera
from spf.hand.model import Hand, load_hand
from spf.initialise import Start
from spf.kernels.cost import Spheres
from spf.learned.guesses import extent_of, guesses
from spf.learned.network import Network, available_network
from spf.lens import as_stated, seen_through
from spf.locate import reach_of
from spf.observation import Observation, Suggestion, observe
from spf.parallel import map_threads
from spf.recover import recover
from spf.settings import Settings
from spf.trackers import TRACKERS

__all__ = ["TrackState", "TrackedFrame", "Tracking", "begin", "run", "stated_joints", "track_frame"]

Array = NDArray[np.float64]
_HISTORY = 30  # golden energies that a loss is judged against
_PATIENCE = 3  # bad frames in a row that make a loss
_FIRST_EFFORT = 3.0
_FRAME = 1.0 / 30.0  # s
_NEAR, _STRIDE = 0.15, 0.03  # m around its last place that a lost hand is believed in, and how much it grows a frame


class Tracking(NamedTuple):
    """What stays the same during a run.

    Attributes:
        tracker: name in the table of trackers.
        settings: of that tracker.
        start: first pose and hand shape.
        hand: of that shape.
        spheres: of the collision term.
        seed: of all randomness.
        network: suggests poses; None where it is not asked.
    """

    tracker: str
    settings: Settings
    start: Start
    hand: Hand
    spheres: Spheres
    seed: int
    network: Network | None


class TrackState(NamedTuple):
    """What a run carries from frame to frame.

    Attributes:
        filter: state of the tracker.
        lost: whether the hand is lost.
        history: recent golden energies of good frames.
        bad: bad frames in a row.
        fresh: whether the pose was just found and no frame has refined it.
        golden: golden energy of the last estimate; 1 when there is none.
        missing: frames since the hand was lost.
    """

    filter: State
    lost: bool
    history: tuple[float, ...]
    bad: int
    fresh: bool
    golden: float
    missing: int


class TrackedFrame(NamedTuple):
    """The result of one frame.

    Attributes:
        index, time: of the frame.
        pose: (D,) the estimate, relative to ``reference``; the last one known while the hand is lost.
        reference: (3, 3) R_ref.
        joints: (21, 3) m, as the stated camera shows them: where the start doubted its focal length
            (:mod:`spf.lens`), the pose is that of the corrected camera.
        lost: whether the hand is lost in this frame.
        recovered: whether it was found again in this frame.
        log_likelihood: of the estimate; nan while lost.
        ess: effective sample size; nan while lost.
        golden, overlap: how well the render of the estimate explains the depth; nan while lost.
        seconds: spent on the frame, observation included.
        timings: seconds by stage.
        info: everything that happened in the filter; None while lost.
        observation: what was seen; None while lost.
    """

    index: int  # type: ignore[assignment]  # a frame has an index; a tuple's method of that name is not missed
    time: float
    pose: Array
    reference: Array
    joints: Array
    lost: bool
    recovered: bool
    log_likelihood: float
    ess: float
    golden: float
    overlap: float
    seconds: float
    timings: dict[str, float]
    info: StepInfo | None
    observation: Observation | None


def begin(
    tracker: str, settings: Settings, start: Start, seed: int, *, time: float = 0.0, free_dip: bool = False
) -> tuple[Tracking, TrackState]:
    """Set up a run from a first pose, which holds a thirtieth of a second before ``time``, its frame's, in seconds."""
    hand = start.shape.hand(free_dip=free_dip)
    tracking = Tracking(tracker, settings, start, hand, digit_spheres(hand), seed, available_network()[0])
    return tracking, _restart(tracking, start.pose, start.reference, time - _FRAME)


def _restart(tracking: Tracking, pose: Array, reference: Array, time_: float) -> TrackState:
    count = getattr(tracking.settings, "n", 1)
    state = start_at(tracking.hand, pose, reference, time_, count)
    return TrackState(state, False, (), 0, True, 1.0, 0)


def track_frame(
    tracking: Tracking, state: TrackState, frame: Frame, *, record: bool = False
) -> tuple[TrackState, TrackedFrame]:
    """Track one frame.

    Args:
        tracking: the run; replace its settings and they take effect with this frame.
        state: after the last frame.
        frame: the depth image.
        record: whether to keep the trajectories of SMD in the frame's info.

    Returns:
        (state, result).
    """
    began = time.perf_counter()
    frame = seen_through(frame, tracking.start.shape.lens)
    rng = np.random.default_rng([tracking.seed, frame.index])
    was_lost = state.lost
    if was_lost:
        state = _sought(tracking, state, frame, rng)
    searched = time.perf_counter()
    observation = _look(tracking, state, frame)
    observed = time.perf_counter()
    if observation.is_empty:
        state = state._replace(lost=True, missing=state.missing + 1)
        return state, _lost(tracking, state, frame, began)
    filter_state, info = TRACKERS[tracking.tracker].step(
        rng, state.filter, observation, tracking.hand, tracking.settings,
        spheres=tracking.spheres, record=record, effort=_FIRST_EFFORT if state.fresh else 1.0,
    )  # fmt: skip
    new = _judged(tracking, state, filter_state, info)
    joints = stated_joints(tracking, info.estimate, info.reference)
    timings = {
        "search": searched - began,
        "observe": observed - searched,
        **info.timings,
    }
    seconds = time.perf_counter() - began
    result = TrackedFrame(
        frame.index, frame.time, info.estimate, info.reference, joints, new.lost, was_lost and not new.lost,
        info.estimate_log_likelihood, info.ess, info.estimate_golden, info.estimate_overlap, seconds, timings,
        info, observation,
    )  # fmt: skip
    return new, result


def stated_joints(tracking: Tracking, pose: Array, reference: Array) -> Array:
    """Return the joints (21, 3), m, of a pose (D,) relative to ``reference``, as the stated camera shows them."""
    return as_stated(joints_of(tracking.hand, pose, reference), tracking.start.shape.lens)


def _look(tracking: Tracking, state: TrackState, frame: Frame) -> Observation:
    """Observe the surface around where the hand was, while the network looks at the same place."""
    parts: list[Callable[[], Any]] = [
        lambda: observe(frame, state.filter.estimate[:3], reach_of(tracking.hand)),
        lambda: _suggestions(tracking, state, frame),
    ]
    observation, suggestions = map_threads(lambda part: part(), parts)
    return observation._replace(suggestions=suggestions)  # type: ignore[no-any-return]


def _suggestions(tracking: Tracking, state: TrackState, frame: Frame) -> tuple[Suggestion, ...]:
    """Ask the network, if the tracker listens to it."""
    if tracking.network is None or not getattr(tracking.settings, "learned", False):
        return ()
    middle = joints_of(tracking.hand, state.filter.estimate, state.filter.reference).mean(axis=0)
    size = tracking.hand.length / load_hand(tracking.hand.side).length
    seen = guesses(tracking.network, frame.depth, frame.camera, middle, extent_of(size), (tracking.hand.side,))
    return tuple(Suggestion(guess.pose, guess.reference) for guess in seen)


def _sought(tracking: Tracking, state: TrackState, frame: Frame, rng: np.random.Generator) -> TrackState:
    """Search for a lost hand; the state goes on from where it was when nothing better is found."""
    limit = min(_believable(state, tracking), 0.8 * state.golden)
    within = _NEAR + _STRIDE * state.missing
    last = relative_to_camera(state.filter.estimate, state.filter.reference)
    found = recover(frame, tracking.hand, limit, last, within, state.missing, tracking.network, rng)
    if found is None:
        return state
    fresh = _restart(tracking, found, np.eye(3), frame.time - _FRAME)
    return fresh._replace(history=state.history, lost=True)


def _usual(state: TrackState, tracking: Tracking) -> float:
    """Golden energy that the hand is tracked with when all is well."""
    return float(np.median(state.history)) if state.history else tracking.start.golden


def _believable(state: TrackState, tracking: Tracking) -> float:
    """Golden energy under which a hand that was lost counts as found."""
    return max(1.3 * _usual(state, tracking) + 0.06, 0.3)


def _judged(tracking: Tracking, state: TrackState, filter_state: State, info: StepInfo) -> TrackState:
    """Notice a loss, frames in a row that the estimate's render explains much worse than usual, and its end."""
    golden = info.estimate_golden
    bad = golden > max(1.6 * _usual(state, tracking) + 0.12, 0.45) or info.estimate_overlap < 0.3
    poor = golden > _believable(state, tracking)
    count = state.bad + 1 if bad else 0
    history = state.history if poor or state.lost else (*state.history, golden)[-_HISTORY:]
    lost = poor if state.lost else count >= _PATIENCE
    missing = state.missing + 1 if lost else 0
    return TrackState(filter_state, lost, history, count, False, golden, missing)


def _lost(tracking: Tracking, state: TrackState, frame: Frame, began: float) -> TrackedFrame:
    nan = float("nan")
    joints = stated_joints(tracking, state.filter.estimate, state.filter.reference)
    seconds = time.perf_counter() - began
    return TrackedFrame(
        frame.index, frame.time, state.filter.estimate, state.filter.reference, joints, True, False,
        nan, nan, nan, nan, seconds, {"search": seconds}, None, None,
    )  # fmt: skip


def run(
    tracking: Tracking, state: TrackState, frames: Iterator[Frame], *, record: bool = False
) -> Iterator[TrackedFrame]:
    """Track frames one after the other, lazily: stop asking and nothing more is computed."""
    for frame in frames:
        state, result = track_frame(tracking, state, frame, record=record)
        yield result
