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

from spf.filters.step import State, StepInfo, start_at
from spf.frame import Frame
from spf.hand.kinematics import joints_of, relative_to_camera
from spf.hand.model import Hand
from spf.hand.shape import UNCHANGED, varied
from spf.initialise import Start
from spf.kernels.cost import Spheres
from spf.learned.guesses import Guess
from spf.learned.network import Network, available_network
from spf.lens import as_stated, seen_through
from spf.locate import FAMILIAR, reach_of, seen_at, strangeness_to
from spf.observation import Observation, Suggestion, observe
from spf.parallel import map_threads
from spf.recover import glance, recover, unlikely
from spf.refine import Refinement, agreement, is_due, modelled, refined, unrefined
from spf.settings import Settings
from spf.shape_equations import View
from spf.trackers import TRACKERS

__all__ = ["TrackState", "TrackedFrame", "Tracking", "begin", "reshaped", "run", "stated_joints", "track_frame"]

Array = NDArray[np.float64]
_HISTORY = 30  # golden energies that a loss is judged against
_PATIENCE = 3  # bad frames in a row that make a loss
_FIRST_EFFORT = 3.0
_FRAME = 1.0 / 30.0  # s
_SEEN = 0.3  # presence of a hand where it is tracked, in the network's eyes, under which a frame is bad
_STRANGE = 0.3  # golden energy that an estimate is charged by the network, over which it is doubted
_CLEARLY = 0.05  # golden energy that a hand elsewhere must be better by than a doubted one, or where a lost one was
_NEAR, _STRIDE = 0.15, 0.03  # m around its last place that a hand is looked for in, and how much it grows a frame


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
        golden: golden energy of the last estimate, and what it is charged for being strange; 1 when there is none.
        missing: frames since the hand was lost.
        held: (D,) the last estimate before those bad frames, relative to the camera's axes: where a hand is looked for.
        refinement: what is known of the hand's shape.
        doubts: frames in a row in which the estimate may be on something else than the hand.
    """

    filter: State
    lost: bool
    history: tuple[float, ...]
    bad: int
    fresh: bool
    golden: float
    missing: int
    held: Array
    refinement: Refinement
    doubts: int = 0


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
        place: (3,) m, around which it was looked for; None while lost, and of a run that was read.
        shape_change: (9,) of the hand that it was tracked with, from the start's: see :func:`spf.hand.shape.varied`.
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
    place: Array | None = None
    shape_change: Array = UNCHANGED


def begin(
    tracker: str, settings: Settings, start: Start, seed: int, *, time: float = 0.0, free_dip: bool = False
) -> tuple[Tracking, TrackState]:
    """Set up a run from a first pose, which holds a thirtieth of a second before ``time``, its frame's, in seconds."""
    hand, spheres = modelled(start.shape, free_dip=free_dip)
    tracking = Tracking(tracker, settings, start, hand, spheres, seed, available_network()[0])
    return tracking, _restart(tracking, start.pose, start.reference, time - _FRAME, unrefined())


def _restart(tracking: Tracking, pose: Array, reference: Array, time_: float, refinement: Refinement) -> TrackState:
    count = getattr(tracking.settings, "n", 1)
    state = start_at(tracking.hand, pose, reference, time_, count)
    return TrackState(state, False, (), 0, True, 1.0, 0, relative_to_camera(pose, reference), refinement)


def reshaped(tracking: Tracking, change: Array) -> Tracking:
    """Return what a frame was tracked with whose hand had another shape (:attr:`TrackedFrame.shape_change`) than the start's."""
    shape = varied(tracking.start.shape, change)
    hand, spheres = modelled(shape, free_dip=tracking.hand.free_dip)
    return tracking._replace(hand=hand, spheres=spheres)


def track_frame(
    tracking: Tracking, state: TrackState, frame: Frame, *, record: bool = False
) -> tuple[TrackState, TrackedFrame]:
    """Track one frame.

    Args:
        tracking: the run; replace its settings and they take effect with this frame. Its hand is the state's in any case.
        state: after the last frame.
        frame: the depth image.
        record: whether to keep the trajectories of SMD in the frame's info.

    Returns:
        (state, result).
    """
    began = time.perf_counter()
    frame = seen_through(frame, tracking.start.shape.lens)
    tracking = reshaped(tracking, state.refinement.change)
    rng = np.random.default_rng([tracking.seed, frame.index])
    was_lost = state.lost
    if was_lost:
        state = _sought(tracking, state, frame, rng)
    searched = time.perf_counter()
    looked = _look(tracking, state, frame)
    observed = time.perf_counter()
    if looked.observation.is_empty:
        state = state._replace(lost=True, missing=state.missing + 1)
        return state, _lost(tracking, state, frame, began)
    new, info = _stepped(tracking, state, looked, rng, record)
    doubts = _doubts(tracking, state, new, info, looked.seen)
    # A glance takes several frames' time: it is taken at the first doubt in a row, the second, the fourth, …
    if doubts and doubts & (doubts - 1) == 0:
        elsewhere = _glanced(tracking, state, new, info, looked.seen, frame, rng)
        if elsewhere is not None:
            state, doubts = elsewhere, 0
            looked = _look(tracking, state, frame)
            new, info = _stepped(tracking, state, looked, rng, record)
    began_refining = time.perf_counter()
    refinement = _refined(tracking, state, new, info, looked.observation, frame.index)
    new = new._replace(doubts=doubts, refinement=refinement)
    joints = stated_joints(tracking, info.estimate, info.reference)
    timings = {
        "search": searched - began,
        "observe": observed - searched,
        **info.timings,
        "refine": time.perf_counter() - began_refining,
    }
    seconds = time.perf_counter() - began
    result = TrackedFrame(
        frame.index, frame.time, info.estimate, info.reference, joints, new.lost, was_lost and not new.lost,
        info.estimate_log_likelihood, info.ess, info.estimate_golden, info.estimate_overlap, seconds, timings,
        info, looked.observation, state.filter.estimate[:3], state.refinement.change,
    )  # fmt: skip
    return new, result


def stated_joints(tracking: Tracking, pose: Array, reference: Array) -> Array:
    """Return the joints (21, 3), m, of a pose (D,) relative to ``reference``, as the stated camera shows them."""
    return as_stated(joints_of(tracking.hand, pose, reference), tracking.start.shape.lens)


class _Looked(NamedTuple):
    """What is seen of a frame, and what the network makes of it where the hand was: nothing if it is not asked."""

    observation: Observation
    seen: list[Guess]


def _look(tracking: Tracking, state: TrackState, frame: Frame) -> _Looked:
    """Observe the surface around where the hand was, while the network looks at the same place."""
    parts: list[Callable[[], Any]] = [
        lambda: observe(frame, state.filter.estimate[:3], reach_of(tracking.hand)),
        lambda: _seen(tracking, state, frame),
    ]
    observation, seen = map_threads(lambda part: part(), parts)
    suggestions = tuple(Suggestion(guess.pose, guess.reference) for guess in seen)
    return _Looked(observation._replace(suggestions=suggestions), seen)


def _seen(tracking: Tracking, state: TrackState, frame: Frame) -> list[Guess]:
    """Ask the network, if the tracker listens to it."""
    if tracking.network is None or not getattr(tracking.settings, "learned", False):
        return []
    return seen_at(tracking.network, frame, tracking.hand, state.filter.estimate, state.filter.reference)


def _stepped(
    tracking: Tracking, state: TrackState, looked: _Looked, rng: np.random.Generator, record: bool
) -> tuple[TrackState, StepInfo]:
    filter_state, info = TRACKERS[tracking.tracker].step(
        rng, state.filter, looked.observation, tracking.hand, tracking.settings,
        spheres=tracking.spheres, record=record, effort=_FIRST_EFFORT if state.fresh else 1.0,
    )  # fmt: skip
    return _judged(tracking, state, filter_state, info, looked.seen), info


def _strangeness(tracking: Tracking, info: StepInfo, seen: list[Guess]) -> float:
    """Golden energy that the estimate is charged for being strange to the network."""
    return strangeness_to(seen, tracking.hand, joints_of(tracking.hand, info.estimate, info.reference))


def _doubts(tracking: Tracking, state: TrackState, new: TrackState, info: StepInfo, seen: list[Guess]) -> int:
    """Count the frames in a row whose estimate explains the depth poorly, or is no hand in the network's eyes."""
    if not seen or state.lost or state.fresh:
        return 0
    strange = _strangeness(tracking, info, seen)
    doubted = strange > _STRANGE or (info.estimate_golden > _believable(state, tracking) and strange > FAMILIAR)
    return new.doubts + 1 if doubted else 0


def _glanced(
    tracking: Tracking, state: TrackState, new: TrackState, info: StepInfo, seen: list[Guess], frame: Frame,
    rng: np.random.Generator,
) -> TrackState | None:  # fmt: skip
    """Look elsewhere when the estimate is doubted; a state that begins there, when a hand explains clearly more there."""
    assert tracking.network is not None
    within = _within(new)
    found = glance(frame, tracking.hand, state.held, within, tracking.network, rng)
    here = relative_to_camera(info.estimate, info.reference)
    charged = info.estimate_golden + _strangeness(tracking, info, seen) + unlikely(here, state.held, within)
    if found is None or found[0] > charged - _CLEARLY:
        return None
    fresh = _restart(tracking, found[1], np.eye(3), frame.time - _FRAME, state.refinement)
    return fresh._replace(history=new.history, held=state.held)


def _sought(tracking: Tracking, state: TrackState, frame: Frame, rng: np.random.Generator) -> TrackState:
    """Search for a lost hand; the state goes on from where it was when nothing better is found."""
    limit = min(_believable(state, tracking), 0.8 * state.golden)
    within = _within(state)
    here = relative_to_camera(state.filter.estimate, state.filter.reference)
    better = state.golden + unlikely(here, state.held, within) - _CLEARLY
    found = recover(frame, tracking.hand, limit, better, state.held, within, state.missing, tracking.network, rng)
    if found is None:
        return state
    fresh = _restart(tracking, found, np.eye(3), frame.time - _FRAME, state.refinement)
    return fresh._replace(history=state.history, lost=True, bad=state.bad, missing=state.missing, held=state.held)


def _within(state: TrackState) -> float:
    """Metres that a hand can be away from where it was held: the more, the longer that is ago."""
    return _NEAR + _STRIDE * max(state.bad, state.missing, 1)


def _usual(state: TrackState, tracking: Tracking) -> float:
    """Golden energy that the hand is tracked with when all is well."""
    return float(np.median(state.history)) if state.history else tracking.start.golden


def _believable(state: TrackState, tracking: Tracking) -> float:
    """Golden energy under which a hand that was lost counts as found."""
    return max(1.3 * _usual(state, tracking) + 0.06, 0.3)


def _judged(
    tracking: Tracking, state: TrackState, filter_state: State, info: StepInfo, seen: list[Guess]
) -> TrackState:
    """Notice a loss, and its end: frames in a row that the estimate's render explains much worse than usual, or in which the
    network sees no hand there, for an elbow can be rendered as well as a hand. Where it sees just this hand, something else
    is within reach that no render of a hand explains."""
    golden = info.estimate_golden
    absent = bool(seen) and max(guess.presence for guess in seen) < _SEEN
    strange = _strangeness(tracking, info, seen)
    familiar = bool(seen) and strange < FAMILIAR
    unexplained = golden > max(1.6 * _usual(state, tracking) + 0.12, 0.45) or info.estimate_overlap < 0.3
    usual = golden < _believable(state, tracking)
    bad = absent or (unexplained and not familiar)
    count = state.bad + 1 if bad else 0
    history = (*state.history, golden)[-_HISTORY:] if usual and not (absent or state.lost) else state.history
    lost = absent or not (usual or familiar) if state.lost else count >= _PATIENCE
    missing = state.missing + 1 if lost else 0
    held = state.held if bad or lost else relative_to_camera(filter_state.estimate, filter_state.reference)
    return TrackState(
        filter_state, lost, history, count, False, golden + strange, missing, held, state.refinement, state.doubts
    )


def _refined(
    tracking: Tracking, state: TrackState, new: TrackState, info: StepInfo, observation: Observation, index: int
) -> Refinement:
    """Refine the hand's shape where the frame is a good view of it: the hand is held, explained as usual, and sure."""
    refinement = state.refinement._replace(waited=state.refinement.waited + 1)
    good = not (new.lost or new.bad or new.doubts) and info.estimate_golden < _believable(state, tracking)
    if not (getattr(tracking.settings, "refine_shape", False) and good and is_due(refinement)):
        return refinement
    counts = agreement(tracking.hand, info)
    if not counts:
        return refinement
    view = View(observation, info.estimate, info.reference)
    return refined(refinement, tracking.start.shape, view, counts, [tracking.seed, index, 1])


def _lost(tracking: Tracking, state: TrackState, frame: Frame, began: float) -> TrackedFrame:
    nan = float("nan")
    joints = stated_joints(tracking, state.filter.estimate, state.filter.reference)
    seconds = time.perf_counter() - began
    return TrackedFrame(
        frame.index, frame.time, state.filter.estimate, state.filter.reference, joints, True, False,
        nan, nan, nan, nan, seconds, {"search": seconds}, None, None, None, state.refinement.change,
    )  # fmt: skip


def run(
    tracking: Tracking, state: TrackState, frames: Iterator[Frame], *, record: bool = False
) -> Iterator[TrackedFrame]:
    """Track frames one after the other, lazily: stop asking and nothing more is computed."""
    for frame in frames:
        state, result = track_frame(tracking, state, frame, record=record)
        yield result
