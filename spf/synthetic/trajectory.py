"""From a motion's script to the pose of every frame: human timing, sway and tremor, viewpoint, and the wanted speed."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from spf.hand.kinematics import joints_of, rotation_about
from spf.hand.model import FINGERS, MIRROR, Hand
from spf.synthetic.motions import Key, Motion

__all__ = [
    "PALM_TO_SENSOR",
    "Trajectory",
    "View",
    "joint_speed",
    "make_trajectory",
    "minimum_jerk",
    "mirrored_trajectory",
]

Array = NDArray[np.float64]

#: Orientation of a hand held up with its palm to the sensor: fingers (−z) up, back of the hand (+y) away from it.
PALM_TO_SENSOR: Array = np.array([[-1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, 1.0, 0.0]])

_LAG = 0.12  # largest fraction of a move by which a finger starts late
_TREMOR_ANGLE = np.radians(0.06)  # a joint's; about 0.2 mm at a fingertip
_TREMOR_SHIFT = 0.0001  # m
_SWAY_SHIFT = np.array([0.022, 0.014, 0.016])  # m
_SWAY_TURN = np.radians([6.0, 6.0, 5.0])
_MAX_ROUNDS = 12
_SPEED_TOLERANCE = 0.01
_JUDGED_FRAMES = 1000  # of which the speed is measured
_DIGIT_OF_ENTRY = np.repeat(np.arange(5), 4)


class View(NamedTuple):
    """Where the hand is held.

    Attributes:
        position: (3,) m, of the palm's centre, camera frame.
        yaw, pitch, roll: radians away from "palm to the sensor, fingers up".
    """

    position: Array
    yaw: float
    pitch: float
    roll: float


class Trajectory(NamedTuple):
    """The hand in every frame.

    Attributes:
        poses: (F, 26) with zero palm angles: the palm's rotation is all in ``orientations``.
        orientations: (F, 3, 3) rotation of the palm, model to camera: the R_ref of each pose.
    """

    poses: Array
    orientations: Array


class _Script(NamedTuple):
    """Keys on a time line: ``start[i]`` to ``end[i]`` is the move to key i + 1."""

    keys: list[Key]
    start: Array
    end: Array
    lags: Array


class _Unrest(NamedTuple):
    """What no hand is without.

    Attributes:
        sway: (6, 3, 2) sinusoids of the palm's slow shifts and turns.
        tremor: (26, 3, 2) sinusoids of the physiological tremor of all entries of the pose.
        reach: factor on the sway's shifts; a faster hand reaches further.
    """

    sway: Array
    tremor: Array
    reach: float


def minimum_jerk(phase: Array) -> Array:
    """Return the fraction 0-1 of a move that is done at a fraction of its time (Flash and Hogan 1985)."""
    s = np.clip(phase, 0.0, 1.0)
    return s**3 * (10.0 - 15.0 * s + 6.0 * s**2)


def make_trajectory(
    hand: Hand, motion: Motion, view: View, frames: int, speed_mm: float, fps: float, rng: np.random.Generator
) -> Trajectory:
    """Play a motion at the pace at which the 21 joints move ``speed_mm`` millimetres a frame on the average.

    Args:
        hand: a **right** hand with 26 degrees of freedom; see :func:`mirrored_trajectory` for the other side.
        motion: a row of :data:`~spf.synthetic.motions.MOTIONS`.
        view: where the hand is held.
        frames: number of frames, F.
        speed_mm: mean over joints and frames of the way from one frame to the next, millimetres; met within 1 % by most
            motions, within 10 % where a fast one is sampled at few frames a stroke.
        fps: frames a second; sets the tremor's frequency in frames.
        rng: draws the variation of the motion.
    """
    frame_times = np.arange(frames) / fps
    source = motion.script(hand, np.random.default_rng(rng.integers(2**63)))
    unrest = _Unrest(_sines(rng, 6, low=0.12, high=0.5), _sines(rng, 26, low=6.0, high=11.0), min(speed_mm / 9.0, 1.5))
    script, pace = _first_key(source), speed_mm / 9.0
    judged = frame_times[:_JUDGED_FRAMES]
    tried: list[tuple[float, float]] = []  # error and pace
    while len(judged) > 1 and len(tried) < _MAX_ROUNDS:
        script = _extended(script, source, pace * judged[-1], rng)
        ratio = joint_speed(hand, _play(hand, motion, view, script, pace * judged, judged, unrest)) / speed_mm
        tried.append((abs(ratio - 1.0), pace))
        if tried[-1][0] < _SPEED_TOLERANCE:
            break
        pace *= float(np.clip(1.0 / max(ratio, 1e-3), 0.5, 2.0))
    pace = min(tried, default=(0.0, pace))[1]
    script = _extended(script, source, pace * frame_times[-1], rng)
    return _play(hand, motion, view, script, pace * frame_times, frame_times, unrest)


def joint_speed(hand: Hand, trajectory: Trajectory) -> float:
    """Return the mean over joints and frames of the way from one frame to the next, millimetres."""
    joints = np.array([joints_of(hand, p, r) for p, r in zip(*trajectory, strict=True)])
    if len(joints) < 2:
        return 0.0
    return 1e3 * float(np.linalg.norm(np.diff(joints, axis=0), axis=2).mean())


def mirrored_trajectory(trajectory: Trajectory) -> Trajectory:
    """Return the trajectory of the other hand, mirrored in the camera's plane x = 0."""
    poses = trajectory.poses.copy()
    poses[:, 0] *= -1.0
    return Trajectory(poses, MIRROR[:, None] * trajectory.orientations * MIRROR)


def _first_key(source: Iterator[Key]) -> _Script:
    return _Script([next(source)], np.empty(0), np.empty(0), np.empty((0, len(FINGERS))))


def _extended(script: _Script, source: Iterator[Key], seconds: float, rng: np.random.Generator) -> _Script:
    """Read keys from a motion's script until they last for ``seconds``."""
    keys, start, end, lags = list(script.keys), list(script.start), list(script.end), list(script.lags)
    clock = end[-1] if end else 0.0
    while clock <= seconds or not end:
        key = next(source)
        start.append(clock + keys[-1].dwell * rng.uniform(0.5, 1.5))
        clock = start[-1] + key.seconds * rng.uniform(0.85, 1.15)
        end.append(clock)
        keys.append(key)
        lags.append(rng.uniform(0.0, _LAG, len(FINGERS)))
    return _Script(keys, np.array(start), np.array(end), np.array(lags))


def _progress(script: _Script, move: NDArray[np.intp], times: Array) -> tuple[Array, Array]:
    """Fractions done of the palm's and the five digits' part of each frame's move: (F,) and (F, 5)."""
    delay = np.array([key.thumb_delay for key in script.keys[1:]])
    late = script.lags.copy()
    late[:, 0] += np.maximum(delay, 0.0)
    late[:, 1:] += np.maximum(-delay, 0.0)[:, None]
    length = 1.0 - (np.abs(delay) + _LAG)
    phase = (times - script.start[move]) / (script.end - script.start)[move]
    digits = (phase[:, None] - late[move]) / length[move, None]
    return minimum_jerk(phase), minimum_jerk(digits)


def _play(
    hand: Hand,
    motion: Motion,
    view: View,
    script: _Script,
    script_times: Array,
    frame_times: Array,
    unrest: _Unrest,
) -> Trajectory:
    """Pose the hand at moments of the script; tremor keeps to real time, whatever the script's pace."""
    move = np.clip(np.searchsorted(script.start, script_times, side="right") - 1, 0, len(script.start) - 1)
    palm, digits = _progress(script, move, script_times)
    articulation = np.array([key.articulation for key in script.keys])
    turns = np.radians([key.turn for key in script.keys])
    shifts = np.array([key.shift for key in script.keys])
    swing, shake = _sum_sines(unrest.sway, script_times), _sum_sines(unrest.tremor, frame_times)
    poses = np.zeros((len(script_times), hand.dofs))
    blended = articulation[move] + digits[:, _DIGIT_OF_ENTRY] * (articulation[move + 1] - articulation[move])
    poses[:, 6:26] = blended + _TREMOR_ANGLE * shake[:, 6:26]
    poses = hand.constrain(poses)
    angles = turns[move] + palm[:, None] * (turns[move + 1] - turns[move])
    angles += _SWAY_TURN * swing[:, 3:] + _TREMOR_ANGLE * shake[:, 3:6]
    orientations = np.array([_orientation(view, turn) for turn in angles])
    poses[:, :3] = view.position + shifts[move] + palm[:, None] * (shifts[move + 1] - shifts[move])
    poses[:, :3] += _SWAY_SHIFT * unrest.reach * swing[:, :3] + _TREMOR_SHIFT * shake[:, :3]
    pivot = np.array([0.0, 0.0, motion.pivot])
    poses[:, :3] += (_orientation(view, np.zeros(3)) - orientations) @ pivot
    return Trajectory(poses, orientations)


def _orientation(view: View, turn: Array) -> Array:
    yaw, pitch, roll = turn
    held = rotation_about([0.0, 0.0, view.roll]) @ rotation_about([view.pitch, view.yaw, 0.0])
    return held @ rotation_about([0.0, 0.0, roll]) @ rotation_about([pitch, yaw, 0.0]) @ PALM_TO_SENSOR


def _sines(rng: np.random.Generator, channels: int, *, low: float, high: float) -> Array:
    """Draw three sinusoids a channel: (channels, 3, 2) of frequency in Hz and phase."""
    return np.stack(
        [rng.uniform(low, high, (channels, 3)), rng.uniform(0.0, 2.0 * np.pi, (channels, 3))],
        axis=-1,
    )


def _sum_sines(sines: Array, times: Array) -> Array:
    """(F, channels) of about unit amplitude."""
    waves = np.sin(2.0 * np.pi * sines[None, :, :, 0] * times[:, None, None] + sines[None, :, :, 1])
    return waves.sum(axis=2) / np.sqrt(3.0)
