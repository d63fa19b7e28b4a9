"""The automatic first pose: hand found, its side and size estimated, hypotheses believed only after several frames.

No human and no truth is involved. Hypotheses of both sides are looked for in some frames (:mod:`spf.hypotheses`); the best of
each side are then tracked for some more, and the one that goes on explaining the depth wins. A wrong side or size may explain
one frame, but seldom a hand that moves.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from spf.calibrate import fit_shape, size_by_render
from spf.cost.spheres import digit_spheres
from spf.errors import StartError
from spf.filters import smart
from spf.filters.step import State, StepInfo, start_at
from spf.frame import Frame
from spf.hand.kinematics import relative_to_camera
from spf.hand.model import Side
from spf.hand.shape import HandShape
from spf.hypotheses import Hypothesis, hypotheses_of
from spf.learned.network import Network, available_network
from spf.lens import Through, is_believable, lens_of, lenses_for
from spf.locate import reach_of, seen_at, strangeness
from spf.observation import Observation, Suggestion, observe
from spf.progress import Report, silent
from spf.search import SearchSettings, size_penalty
from spf.shape_equations import View

__all__ = ["Doubted", "Start", "find_start"]

Array = NDArray[np.float64]
Doubted = Literal["pose", "side"]

DOUBTFUL = 0.46  # mean golden energy over the validation, strangeness included, above which a start is not believed
_SIDE_MARGIN = 0.01  # by which the other side has to be worse for the side to be believed
_SIDES: tuple[Side, Side] = ("right", "left")
_INSTANTS = (0, 15, 30)  # frames in which a hand is looked for, until one convinces
_CONVINCING = 0.4  # the same under which nothing better is looked for …
_CLEAR_MARGIN = 0.03  # … when the other side is this much worse
_VALIDATION_FRAMES = 16
_CALIBRATION_FRAMES = 48
_VIEWS = 12
_LEAST_FRAMES = 4  # that a hypothesis is fitted in


class Start(NamedTuple):
    """A first pose.

    Attributes:
        frame: index of the frame that it is for.
        pose: (D,) relative to ``reference``, of the hand of ``shape``.
        reference: (3, 3) R_ref.
        shape: side, size and shape of the hand.
        golden: mean golden energy over the validation: 0 explains all, above DOUBTFUL is not believed.
        margin: by how much the other side explained less.
    """

    frame: int
    pose: Array
    reference: Array
    shape: HandShape
    golden: float
    margin: float

    @property
    def doubted(self) -> Doubted | None:
        """What of the start may be wrong; an interface says by it what to do."""
        if self.golden > DOUBTFUL:
            return "pose"
        return "side" if self.margin < _SIDE_MARGIN else None

    @property
    def doubt(self) -> str:
        """One sentence why the start may be wrong, or ""."""
        sentences: dict[Doubted | None, str] = {
            "pose": f"The first pose may be wrong: its render explains the depth poorly, {self.golden:.2f}.",
            "side": f"The side may be wrong: a {self.shape.side} hand explains the depth hardly better than the other.",
            None: "",
        }
        return sentences[self.doubted]

    @property
    def remark(self) -> str:
        """One sentence on a camera that was not believed, or ""."""
        lens = self.shape.lens
        if lens == 1.0:
            return ""
        length = 100.0 * lens * self.shape.hand().length
        return (
            f"The stated focal length makes this hand {length:.0f} cm long: it is tracked as if that were {lens:.2f} times "
            "as long, and its joints are given as the stated camera shows them; check the camera file."
        )


class _Followed(NamedTuple):
    """A hypothesis that was tracked for some frames.

    Attributes:
        frame: the first of them.
        shape, pose, reference: the hand there.
        energy: mean golden energy, strangeness and unlikely sizes included.
        margin: lead over the other side.
        explained: mean golden energy of the calibrated hand.
    """

    frame: int
    shape: HandShape
    pose: Array
    reference: Array
    energy: float
    margin: float
    explained: float = 1.0


def find_start(
    frames: Sequence[Frame],
    rng: np.random.Generator,
    *,
    side: Side | None = None,
    shape: HandShape | None = None,
    progress: Report | None = None,
) -> Start:
    """Find the first pose, and the hand's shape unless it is given.

    Args:
        frames: the session's frames from the first on; some dozens are looked at.
        rng: randomness.
        side: of the hand when the session states it; None to find out.
        shape: of the hand when it is known; None to calibrate it from the depth.
        progress: called with what is being done and the share done.

    Raises:
        StartError: no frame shows anything of a hand's size.
    """
    report = progress or silent
    sides = (shape.side,) if shape else (side,) if side else _SIDES
    network, _ = available_network()
    stated, frames = frames, Through(frames, shape.lens if shape else 1.0)
    best: _Followed | None = None
    for attempt, (index, thorough) in enumerate(_attempts(len(frames), network is not None)):
        if best is not None and (_clear(best) or (thorough and _believed(best)) or index > _INSTANTS[-1]):
            break
        report("Looking for a hand", min(0.1 * attempt, 0.5))
        hypotheses = hypotheses_of(frames[index], sides, shape, network, rng, thorough=thorough)
        if not hypotheses:
            continue
        report("Following the hypotheses", min(0.1 * attempt + 0.05, 0.6))
        followed = _best_followed(frames, index, hypotheses, shape, rng)
        if best is None or followed.energy < best.energy:
            best = followed
    if best is None:
        raise StartError(
            "No frame shows anything of a hand's size; check the depth unit and the camera with 'spf info'."
        )
    if shape is None:
        best = _through_a_lens(stated, _calibrated(frames, best, rng, report), rng, report)
        frames = Through(stated, best.shape.lens)
    index, pose, reference = _first_held(frames, best, rng)
    pose, reference = _settled(frames[index], best.shape, pose, reference, rng)
    report("Ready", 1.0)
    return Start(index, pose, reference, best.shape, best.energy, best.margin)


def _clear(start: _Followed) -> bool:
    """Whether nothing better need be looked for."""
    return start.energy < _CONVINCING and start.margin > _CLEAR_MARGIN


def _believed(start: _Followed) -> bool:
    """Whether neither its pose nor its side is doubted."""
    return start.energy < DOUBTFUL and start.margin >= _SIDE_MARGIN


def _attempts(count: int, quickly: bool) -> list[tuple[int, bool]]:
    """Frames to look for a hand in, and whether all that is there is searched: (index, thorough).

    First, where the network can be asked, what it suggests in some frames of the first second; then everything in the same
    frames, and in others farther and farther apart until one shows a hand.
    """
    near = [index for index in _INSTANTS if index < count]
    far, index = [], 45
    while index < count:
        far.append(index)
        index = index * 3 // 2
    quick = [(index, False) for index in near] if quickly else []
    return [*quick, *((index, True) for index in near), *((index, True) for index in far)]


def _best_followed(
    frames: Sequence[Frame],
    index: int,
    hypotheses: list[Hypothesis],
    shape: HandShape | None,
    rng: np.random.Generator,
) -> _Followed:
    """Track every hypothesis for some frames, at a size fitted to them, and return the one that explains them best."""
    network, _ = available_network()
    ahead = _some(frames[index : index + _VALIDATION_FRAMES])
    rated: list[tuple[float, Hypothesis]] = []
    for hypothesis in hypotheses:
        fitted = hypothesis
        if shape is None:
            tracked = _track(hypothesis, ahead[: _VALIDATION_FRAMES // 2], rng)
            views = [View(o, s.estimate, s.reference) for o, s, _ in tracked[::2]]
            if not views:
                continue
            sized, views, _ = fit_shape(views, hypothesis.shape, rng, iterations=4, refine=False)
            fitted = Hypothesis(sized, relative_to_camera(views[0].pose, views[0].reference), hypothesis.energy)
        infos = _track(fitted, ahead, rng)
        energy = float(np.mean([info.estimate_golden for _, _, info in infos])) if infos else 1.0
        energy += hypothesis.unfamiliar
        seen = [
            strangeness(network, frame, fitted.shape.hand(), s.estimate, s.reference)
            for frame, (_, s, _) in list(zip(ahead, infos, strict=False))[::4]
        ]
        energy += float(np.mean(seen)) if seen else 0.0
        if shape is None:
            energy += float(size_penalty(fitted.shape.scale, SearchSettings()))
        rated.append((energy + 0.5 * (len(ahead) - len(infos)) / len(ahead), fitted))
    rated.sort(key=lambda item: item[0])
    energy, chosen = rated[0]
    others = [e for e, h in rated if h.shape.side != chosen.shape.side]
    return _Followed(index, chosen.shape, chosen.pose, np.eye(3), energy, min(others) - energy if others else 1.0)


def _some(frames: Sequence[Frame]) -> Sequence[Frame]:
    """Frames enough to fit a hypothesis: a last one that is the only one or nearly so is shown again, as if nothing moved."""
    again = [
        frames[-1]._replace(time=frames[-1].time + step / 30) for step in range(1, _LEAST_FRAMES + 1 - len(frames))
    ]
    return [*frames, *again] if again else frames


def _settled(
    frame: Frame, shape: HandShape, pose: Array, reference: Array, rng: np.random.Generator
) -> tuple[Array, Array]:
    """Track a hand in one frame until its pose has settled: (pose, reference)."""
    network, _ = available_network()
    again = [frame._replace(time=frame.time + step / 30) for step in range(_LEAST_FRAMES)]
    tracked = _track(Hypothesis(shape, pose, 0.0), again, rng, reference, network)
    if not tracked:
        return pose, reference
    _, state, _ = min(tracked, key=lambda item: item[2].estimate_golden)
    return state.estimate, state.reference


def _first_held(frames: Sequence[Frame], start: _Followed, rng: np.random.Generator) -> tuple[int, Array, Array]:
    """Track backwards from where the start was found for as long as the hand is there: (frame, pose, reference)."""
    backwards = [frames[index]._replace(time=-frames[index].time) for index in range(start.frame, -1, -1)]
    held, pose, reference = start.frame, start.pose, start.reference
    tracked = _track(Hypothesis(start.shape, start.pose, start.energy), backwards, rng, start.reference)
    for back, (_, state, info) in enumerate(tracked):
        if back > 0:
            if info.estimate_golden > 1.5 * start.energy + 0.1:
                break
            held, pose, reference = start.frame - back, state.estimate, state.reference
    return held, pose, reference


def _track(
    hypothesis: Hypothesis,
    frames: Sequence[Frame],
    rng: np.random.Generator,
    reference: Array | None = None,
    network: Network | None = None,
) -> list[tuple[Observation, State, StepInfo]]:
    """Track a hypothesis with the default filter, until nothing is seen any more."""
    hand, settings = hypothesis.shape.hand(), smart.SpfSettings()
    spheres = digit_spheres(hand)
    axes = np.eye(3) if reference is None else reference
    state = start_at(hand, hypothesis.pose, axes, frames[0].time - 1 / 30, settings.n)
    result = []
    for frame in frames:
        observation = observe(frame, state.estimate[:3], reach_of(hand))
        if observation.is_empty:
            break
        if network is not None:
            seen = seen_at(network, frame, hand, state.estimate, state.reference)
            observation = observation._replace(suggestions=tuple(Suggestion(g.pose, g.reference) for g in seen))
        state, info = smart.step(rng, state, observation, hand, settings, spheres=spheres)
        result.append((observation, state, info))
    return result


def _calibrated(frames: Sequence[Frame], start: _Followed, rng: np.random.Generator, report: Report) -> _Followed:
    """Fit the shape to what the start tracks, its size first, and take the pose along."""
    ahead = frames[start.frame : start.frame + _CALIBRATION_FRAMES]
    shape, pose, energy = start.shape, start.pose, start.energy
    for turn, (refine_all, iterations) in enumerate(((False, 3), (True, 6))):
        report("Calibrating the hand", 0.7 + 0.15 * turn)
        tracked = _track(Hypothesis(shape, pose, energy), ahead, rng)
        every = max(1, len(tracked) // _VIEWS)
        views = [View(o, s.estimate, s.reference) for o, s, _ in tracked[::every]]
        shape, views, energy = fit_shape(views, shape, rng, iterations=iterations, refine=refine_all)
        pose = relative_to_camera(views[0].pose, views[0].reference)
    shape, views, energy = size_by_render(views, shape, rng)
    pose = relative_to_camera(views[0].pose, views[0].reference)
    return start._replace(shape=shape, pose=pose, energy=min(energy, start.energy), explained=energy)


def _through_a_lens(frames: Sequence[Frame], start: _Followed, rng: np.random.Generator, report: Report) -> _Followed:
    """Calibrate a hand of an unbelievable size again through other lenses, and take the likeliest."""
    length = start.shape.hand().length
    if is_believable(length):
        return start

    def calibrated(lens: float) -> _Followed:
        shape, pose = start.shape._replace(scale=start.shape.scale / lens, lens=lens), start.pose.copy()
        pose[:2] /= lens
        return _calibrated(Through(frames, lens), start._replace(shape=shape, pose=pose), rng, report)

    tried = [start, *(calibrated(lens) for lens in lenses_for(length))]
    lens = lens_of(
        [one.shape.lens for one in tried],
        [one.shape.hand().length for one in tried],
        [one.explained for one in tried],
    )
    return start if lens == 1.0 else calibrated(lens)
