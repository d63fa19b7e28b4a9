"""One frame's pose and hand by hand: a pose to begin with, a fit of the pose, a fit of the hand's shape."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from spf.calibrate import fit_shape, size_by_render
from spf.cost.problem import Problem, golden, make_problem
from spf.cost.spheres import digit_spheres
from spf.errors import StartError
from spf.filters import smart
from spf.filters.step import start_at
from spf.frame import Frame
from spf.hand.handles import Stance, turned_home
from spf.hand.model import Hand
from spf.hand.shape import HandShape
from spf.learned.network import available_network
from spf.lens import Through, seen_through
from spf.locate import reach_of, suggested
from spf.observation import Observation, observe
from spf.optimisers.smd import optimise
from spf.progress import Report, part_of, silent
from spf.segmentation import Region, find_regions
from spf.shape_equations import View

__all__ = ["Explained", "calibrated_from", "explained", "first_stance", "fitted_from", "open_hand"]

Array = NDArray[np.float64]

#: Palm towards the camera, fingers up: the columns are the model's x, y (back of the hand) and z (to the arm).
_FACING = np.array([[-1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, 1.0, 0.0]])
_IN_THE_MIDDLE = 0.5  # m, how far a hand is put where the frame shows nothing
_CURL = 0.2  # rad that the fingers of a pose to begin with are bent
_DESCENTS, _ROUNDS = 6, 2  # descents a round; the next round begins where the best one ended
_MOVED, _ANGLE = 0.008, 0.12  # m and rad around the pose from which most descents begin
_FRAMES, _VIEWS = 48, 12  # frames that a shape is fitted on, and how many of them are looked at
_SIZE_STEPS, _SHAPE_STEPS = 3, 6


class Explained(NamedTuple):
    """How well a posed hand explains a frame: golden energy (0 all, 1 and more nothing) and silhouette overlap (0-1)."""

    golden: float
    overlap: float


def first_stance(frame: Frame, shape: HandShape, rng: np.random.Generator) -> Stance:
    """Return a pose to begin with: what the network suggests for the nearest thing of a hand's size, else an open hand there.

    Args:
        frame: as its session states it.
        shape: of the hand.
        rng: randomness.
    """
    frame, hand = seen_through(frame, shape.lens), shape.hand()
    regions = find_regions(frame)
    network, _ = available_network()
    if regions and network is not None:
        size = hand.length / HandShape(shape.side).hand().length
        found = suggested(network, frame, regions[0], (shape.side,), size)[shape.side]
        if found:
            return _likeliest(frame, hand, np.concatenate([seeds.poses for seeds in found]), rng)
    return _open(frame, hand, regions)


def open_hand(frame: Frame, shape: HandShape) -> Stance:
    """Return an open hand, its palm to the camera, where the nearest thing of a hand's size is; at once."""
    frame = seen_through(frame, shape.lens)
    return _open(frame, shape.hand(), find_regions(frame))


def _open(frame: Frame, hand: Hand, regions: Sequence[Region]) -> Stance:
    camera, pose = frame.camera, hand.neutral_pose()
    pose[:3] = (
        regions[0].centre if regions else camera.back_project(camera.width / 2, camera.height / 2, _IN_THE_MIDDLE)
    )
    pose[[i for i, name in enumerate(hand.dof_names) if "flexion" in name]] = _CURL
    return Stance(pose, _FACING.copy())


def _likeliest(frame: Frame, hand: Hand, poses: Array, rng: np.random.Generator) -> Stance:
    """The pose, of some (N, D) relative to the camera's axes, whose render explains the frame best."""
    best, least = poses[0], np.inf
    for pose in poses:
        observation = observe(frame, pose[:3], reach_of(hand))
        if not observation.is_empty:
            energy = _judged(_problem(hand, observation, Stance(pose, np.eye(3)), rng), Stance(pose, np.eye(3))).golden
            if energy < least:
                best, least = pose, energy
    return turned_home(Stance(best, np.eye(3)))


def explained(frame: Frame, shape: HandShape, stance: Stance) -> Explained | None:
    """Judge a posed hand by its render; None where the frame shows nothing at that place.

    Args:
        frame: as its session states it.
        shape, stance: of the hand.
    """
    hand = shape.hand()
    observation = observe(seen_through(frame, shape.lens), stance.pose[:3], reach_of(hand))
    if observation.is_empty:
        return None
    return _judged(_problem(hand, observation, stance, np.random.default_rng(0)), stance)


def _problem(hand: Hand, observation: Observation, stance: Stance, rng: np.random.Generator) -> Problem:
    return make_problem(hand, observation, smart.SpfSettings(), stance.reference, rng)


def _judged(problem: Problem, stance: Stance) -> Explained:
    energies, overlaps = golden(problem, stance.pose[None])
    return Explained(float(energies[0]), float(overlaps[0]))


def fitted_from(
    frame: Frame, shape: HandShape, stance: Stance, rng: np.random.Generator, progress: Report | None = None
) -> Stance:
    """Fit the pose to one frame: SMD from the given pose and from poses around it, the best by its render.

    Args:
        frame: as its session states it.
        shape: of the hand.
        stance: to begin from; returned as it is where nothing explains the frame better.
        rng: randomness.
        progress: called with what is being done and the share done.

    Raises:
        StartError: the frame shows nothing where the pose puts the hand.
    """
    hand = shape.hand()
    observation = observe(seen_through(frame, shape.lens), stance.pose[:3], reach_of(hand))
    if observation.is_empty:
        raise StartError(
            f"Frame {frame.index} shows nothing where the hand is: drag it over the hand, and set its depth."
        )
    problem, settings = _problem(hand, observation, stance, rng), smart.SpfSettings()
    best, least = stance.pose, _judged(problem, stance).golden
    for done in range(_ROUNDS * _DESCENTS):
        if progress is not None:
            progress("Fitting the pose", done / (_ROUNDS * _DESCENTS))
        if done % _DESCENTS == 0:
            middle = best
        begin = middle if done % _DESCENTS < 2 else _near(hand, middle, rng)
        end, _, _ = optimise(problem, settings, rng, begin)
        energy = float(golden(problem, end[None])[0][0])
        if energy < least:
            best, least = end, energy
    return turned_home(Stance(hand.constrain(best), stance.reference))


def _near(hand: Hand, pose: Array, rng: np.random.Generator) -> Array:
    spread = np.full(hand.dofs, _ANGLE)
    spread[:3] = _MOVED
    return hand.constrain(pose + spread * rng.standard_normal(hand.dofs))


def calibrated_from(
    frames: Sequence[Frame],
    shape: HandShape,
    stance: Stance,
    rng: np.random.Generator,
    progress: Report | None = None,
) -> tuple[HandShape, Stance]:
    """Fit size and shape of a hand to what is tracked from a pose on: its size, its lengths and thicknesses, its size again.

    Args:
        frames: as their session states them; the first is that of the pose, at most 48 are tracked.
        shape: of the hand; its side and lens stay.
        stance: of the hand in the first frame.
        rng: randomness.
        progress: called with what is being done and the share done.

    Returns:
        The shape, and the pose of a hand of that shape in the first frame.

    Raises:
        StartError: the first frame shows nothing where the pose puts the hand.
    """
    report = progress or silent
    seen = Through(frames, shape.lens)[:_FRAMES]
    for steps, refine, share in ((_SIZE_STEPS, False, 0.0), (_SHAPE_STEPS, True, 0.4)):
        views = _views(seen, shape, stance, rng, report, share)
        within = part_of(report, share + 0.2, share + 0.4)
        shape, views, _ = fit_shape(views, shape, rng, iterations=steps, refine=refine, progress=within)
        stance = turned_home(Stance(views[0].pose, views[0].reference))
    report("Fitting the hand's size", 0.9)
    shape, views, _ = size_by_render(views, shape, rng)
    stance = turned_home(Stance(views[0].pose, views[0].reference))
    return shape, fitted_from(frames[0], shape, stance, rng, part_of(report, 0.95, 1.0))


def _views(
    frames: Sequence[Frame], shape: HandShape, stance: Stance, rng: np.random.Generator, report: Report, share: float
) -> list[View]:
    """Track a hand from a pose on until nothing is seen, and return some of the frames with their poses."""
    hand, settings = shape.hand(), smart.SpfSettings()
    spheres = digit_spheres(hand)
    state = start_at(hand, stance.pose, stance.reference, frames[0].time - 1 / 30, settings.n)
    tracked = []
    for number, frame in enumerate(frames):
        report("Tracking to see the hand's shape", share + 0.2 * number / len(frames))
        observation = observe(frame, state.estimate[:3], reach_of(hand))
        if observation.is_empty:
            break
        state, _ = smart.step(rng, state, observation, hand, settings, spheres=spheres)
        tracked.append(View(observation, state.estimate, state.reference))
    if not tracked:
        raise StartError("There is nothing where the hand is: drag it over the hand, and set its depth.")
    return tracked[:: max(1, len(tracked) // _VIEWS)]
