"""Structured proposals between predict and optimise: what a hand does when a tracker loses it (spec, findings).

One particle of four is moved to the best of a set of structured changes of the estimate, judged by rendering: fingers
fitted to their neighbours are shifted back, the palm is turned, digits are curled or stretched. The other particles keep
their prediction by the dynamics. The proposal's density is not known in closed form: the kernel density estimate f is
taken over the predicted set with these samples in it, as if the dynamics had drawn them.
"""

from __future__ import annotations

import dataclasses

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from spf.cost.problem import Problem, golden
from spf.hand.kinematics import angles_of, rotation_about
from spf.parallel import map_threads, threads
from spf.settings import Settings, setting

__all__ = ["ProposalSettings", "propose"]

Array = NDArray[np.float64]
_PROPOSALS = "Proposals"
_CURLS = ((0.0, 0.0), (0.5, 0.6), (0.2, 1.3), (1.2, 0.4), (1.35, 1.6))  # (MP, PIP) flexion, rad
_THUMBS = (
    (0.0, 0.0, 0.0, 0.0),
    (0.3, 0.2, 0.2, 0.2),
    (-0.3, 0.4, 0.5, 0.5),
    (0.0, 0.5, 0.8, 0.9),
    (0.5, -0.2, 0.0, 0.0),
)
_NEIGHBOUR = 0.22  # rad between neighbouring fingers, seen from the wrist


@dataclasses.dataclass(frozen=True)
class ProposalSettings(Settings):
    """Where particles are sent besides where the dynamics puts them."""

    structured: float = setting(
        0.25, "share of the particles that are given a structured proposal", group=_PROPOSALS, low=0.0, high=1.0
    )
    palm_proposals: int = setting(
        24, "palm changes that are screened per structured particle", group=_PROPOSALS, low=0, high=1000
    )


def propose(
    problem: Problem, estimate: Array, predicted: Array, settings: ProposalSettings, rng: np.random.Generator
) -> tuple[Array, tuple[str, ...], int]:
    """Replace the last particles' predictions by structured proposals.

    Args:
        problem: the frame's cost; its render judges the proposals.
        estimate: (D,) of the last frame.
        predicted: (N, D) by the dynamics.
        settings: how many.
        rng: randomness.

    Returns:
        (predicted (N, D), origin of each, number of renders).
    """
    count = int(settings.structured * len(predicted))
    origins = ["dynamics"] * (len(predicted) - count) + ["structured"] * count
    result, renders = predicted.copy(), 0
    for index in range(len(predicted) - count, len(predicted)):
        candidates = palm_changes(problem, predicted[index], estimate, settings.palm_proposals, rng)
        parts = np.array_split(candidates, min(threads(), len(candidates)))
        energies = np.concatenate(map_threads(lambda part: golden(problem, part)[0], parts))
        pose, used = curl_digits(problem, candidates[int(np.argmin(energies))], float(energies.min()))
        result[index], renders = pose, renders + len(candidates) + used
    return result, tuple(origins), renders


def palm_changes(problem: Problem, predicted: Array, estimate: Array, count: int, rng: np.random.Generator) -> Array:
    """The prediction, fingers moved by one place to either side, and palms turned and shifted at random, (≤ count + 3, D)."""
    changes = [predicted]
    for direction in (1, -1):
        changes.append(_shifted_fingers(problem, estimate, direction))
    for _ in range(count):
        pose = (estimate if rng.random() < 0.5 else predicted).copy()
        axis = rng.normal(size=3)
        pose[3:6] += axis / np.linalg.norm(axis) * rng.uniform(0.15, 0.6)
        pose[:3] += rng.normal(scale=0.01, size=3)
        if rng.random() < 0.5:
            pose[6:] += rng.normal(scale=0.25, size=len(pose) - 6)
        changes.append(pose)
    return problem.hand.constrain(np.array(changes))


def _shifted_fingers(problem: Problem, pose: Array, direction: int) -> Array:
    """Turn the palm by one finger about its normal at the wrist; each finger takes over its neighbour's angles."""
    hand = problem.hand
    shifted = pose.copy()
    fingers = pose[10:26].reshape(4, 4)
    shifted[10:26] = fingers[np.clip(np.arange(4) + direction, 0, 3)].reshape(-1)
    palm = rotation_about(pose[3:6]) @ problem.reference
    mirror = 1.0 if hand.side == "right" else -1.0
    turn = Rotation.from_rotvec(mirror * direction * _NEIGHBOUR * palm[:, 1]).as_matrix()
    shifted[3:6] = angles_of(turn @ rotation_about(pose[3:6]))
    wrist = palm @ hand.skeleton.bind[0, :, 3]
    shifted[:3] += wrist - turn @ wrist
    return shifted


def curl_digits(problem: Problem, pose: Array, energy: float) -> tuple[Array, int]:
    """Give each digit in turn the canonical curl that lowers the golden energy most; keeps what it has otherwise."""
    best, renders = pose.copy(), 0
    for digit in range(5):
        options = _digit_options(best, digit)
        energies, _ = golden(problem, problem.hand.constrain(options))
        renders += len(options)
        if energies.min() < 0.98 * energy:
            energy = float(energies.min())
            best = problem.hand.constrain(options[int(np.argmin(energies))])
    return best, renders


def _digit_options(pose: Array, digit: int) -> Array:
    if digit == 0:
        options = np.repeat(pose[None], len(_THUMBS), axis=0)
        options[:, 6:10] = _THUMBS
        return options
    options = np.repeat(pose[None], len(_CURLS), axis=0)
    first = 6 + 4 * digit
    for option, (flexion, bend) in zip(options, _CURLS, strict=True):
        option[first + 1], option[first + 3] = flexion, bend
        if len(pose) > 26:
            option[25 + digit] = bend * 2.0 / 3.0
    return options
