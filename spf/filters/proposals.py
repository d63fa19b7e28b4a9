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

from spf.cost.problem import Problem, golden, golden_of_many
from spf.hand.kinematics import angles_of, rotation_about
from spf.hand.model import DIP_PER_PIP
from spf.settings import Settings, setting

__all__ = ["ProposalSettings", "origins_of", "recombine", "restructure", "with_suggestion"]

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
_BETTER = 0.98  # of the golden energy, from which a changed digit is kept
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
    learned: bool = setting(
        True, "add a particle where the network sees the hand, in the frames that it is asked in", group=_PROPOSALS
    )
    learned_prior: float = setting(
        0.1, "prior of the network's particle, relative to one of the others", group=_PROPOSALS, low=1e-6, high=1.0
    )
    recombination: float = setting(
        0.3,
        "share of SMD's rounds that a recombination of the particles' digits is given; 0 for none",
        group=_PROPOSALS, low=0.0, high=1.0,
    )  # fmt: skip


def with_suggestion(problem: Problem, predicted: Array, settings: ProposalSettings) -> tuple[Array, int]:
    """Add the best of the frame's suggested poses to the predicted ones (N, D), judged by rendering.

    Returns:
        (predicted (N, D), or (N + 1, D) with a suggestion; number of renders).
    """
    if not (settings.learned and problem.observation.suggestions):
        return predicted, 0
    poses = _suggested(problem)
    energies, _ = golden(problem, poses)
    return np.concatenate([predicted, poses[[np.argmin(energies)]]]), len(poses)


def origins_of(count: int, total: int, settings: ProposalSettings) -> tuple[str, ...]:
    """Say which proposal each of ``total`` particles is for: ``count`` of the filter's own, the last of them structured."""
    structured = int(settings.structured * count)
    return ("dynamics",) * (count - structured) + ("structured",) * structured + ("learned",) * (total - count)


def restructure(
    problem: Problem, estimate: Array, predicted: Array, settings: ProposalSettings, rng: np.random.Generator
) -> tuple[Array, int]:
    """Change a prediction (D,) to the best of the structured changes of it and of the last estimate (D,).

    Returns:
        (pose (D,), number of renders).
    """
    candidates = palm_changes(problem, predicted, estimate, settings.palm_proposals, rng)
    energies, _ = golden(problem, candidates)
    pose, used = curl_digits(problem, candidates[int(np.argmin(energies))], float(energies.min()))
    return pose, len(candidates) + used


def _suggested(problem: Problem) -> Array:
    """The suggested poses (K, D), relative to the problem's R_ref."""
    hand, poses = problem.hand, []
    for pose, reference in problem.observation.suggestions:
        palm = rotation_about(pose[3:6]) @ reference @ problem.reference.T
        full = hand.neutral_pose()
        full[:26], full[26:] = pose, DIP_PER_PIP * pose[13:26:4][: hand.dofs - 26]
        full[3:6] = angles_of(palm)
        poses.append(full)
    return hand.constrain(np.array(poses))


def palm_changes(problem: Problem, predicted: Array, estimate: Array, count: int, rng: np.random.Generator) -> Array:
    """The prediction, fingers moved by one place to either side, and palms turned and shifted at random, (≤ count + 3, D)."""
    chosen = np.where(rng.random((count, 1)) < 0.5, estimate, predicted)
    axes = rng.normal(size=(count, 3))
    chosen[:, 3:6] += axes / np.linalg.norm(axes, axis=1, keepdims=True) * rng.uniform(0.15, 0.6, (count, 1))
    chosen[:, :3] += rng.normal(scale=0.01, size=(count, 3))
    bent = rng.random((count, 1)) < 0.5
    chosen[:, 6:] += bent * rng.normal(scale=0.25, size=(count, len(predicted) - 6))
    shifted = [_shifted_fingers(problem, estimate, direction) for direction in (1, -1)]
    return problem.hand.constrain(np.concatenate([predicted[None], shifted, chosen]))


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
        if energies.min() < _BETTER * energy:
            energy = float(energies.min())
            best = problem.hand.constrain(options[int(np.argmin(energies))])
    return best, renders


def recombine(problem: Problem, poses: Array, energies: Array) -> tuple[Array | None, int]:
    """Give the best of some poses the digits of the others, or canonical ones, where its render gets better by that.

    Partitioned sampling (MacCormick and Isard 2000) in its simplest form: a digit is nearly independent of the others.

    Args:
        problem: the frame's cost; its render judges.
        poses: (N, D).
        energies: (N,) their golden energies.

    Returns:
        (pose (D,), or None where nothing got better; number of renders).
    """
    order = np.argsort(energies)
    best, energy = poses[order[0]].copy(), float(energies[order[0]])
    before, renders = energy, 0
    for digit in range(5):
        options = _digit_options(best, digit)
        others = np.repeat(best[None], len(poses) - 1, axis=0)
        columns = _digit_entries(len(best), digit)
        others[:, columns] = poses[order[1:]][:, columns]
        options = problem.hand.constrain(np.concatenate([others, options]))
        tried, _ = golden_of_many(problem, options)
        renders += len(options)
        if tried.min() < _BETTER * energy:
            energy = float(tried.min())
            best = options[int(np.argmin(tried))]
    return (best, renders) if energy < before else (None, renders)


def _digit_entries(dofs: int, digit: int) -> list[int]:
    """Entries of a pose that belong to a digit."""
    return [*range(6 + 4 * digit, 10 + 4 * digit), *([25 + digit] if dofs > 26 and digit > 0 else [])]


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
