"""Synthetic sessions: a hand that moves as told, seen by a modelled sensor, with exact truth."""

from __future__ import annotations

import json
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from spf.errors import SettingError
from spf.frame import Truth
from spf.hand.kinematics import joints_of, pose_hand
from spf.hand.model import Hand, mirrored
from spf.hand.shape import HandShape
from spf.kernels.render import FAR
from spf.sessions import Session
from spf.settings import Settings, setting
from spf.synthetic.clutter import CLUTTER, Clutter, Place, moving_meshes
from spf.synthetic.faults import Fault, apply_fault, draw_fault
from spf.synthetic.hands import SHAPES, hand_shape
from spf.synthetic.motions import MOTIONS
from spf.synthetic.sensors import SENSORS, Sensor, measure
from spf.synthetic.solids import Mesh, draw
from spf.synthetic.trajectory import Trajectory, View, make_trajectory, minimum_jerk, mirrored_trajectory

__all__ = ["SyntheticSession", "SyntheticSettings", "synthesise"]

_AS_SENSOR = -1.0
_GOING = 10  # frames that the hand takes to leave the view, and to come back
_ARM_REACH = 0.3  # m beyond the edge of the view at which hand and forearm are out of it


@dataclass(frozen=True)
class SyntheticSettings(Settings):
    """What a synthetic session shows; the same settings give the same bytes."""

    motion: str = setting("open_close", "what the hand does", group="motion", choices=tuple(MOTIONS))
    frames: int = setting(120, "number of frames", group="motion", low=1, high=100_000)
    speed_mm: float = setting(
        9.0, "mean motion of the joints from frame to frame (4 slow, 9 medium, 16 fast), mm",
        group="motion", low=0.5, high=60.0, unit="mm",
    )  # fmt: skip
    seed: int = setting(0, "seed of everything random", group="motion", low=0, high=2**31 - 1)
    absent_from: int = setting(0, "first frame without the hand", group="motion", low=0, high=100_000)
    absent_frames: int = setting(0, "frames without the hand, 0 for none", group="motion", low=0, high=100_000)
    side: str = setting("right", "which hand", group="hand", choices=("left", "right"))
    shape: str = setting("standard", "shape of the hand", group="hand", choices=(*SHAPES, "random"))
    distance: float = setting(
        0.0, "distance of the palm from the sensor, 0 for its usual one", group="view", low=0.0, high=3.0, unit="m"
    )  # fmt: skip
    yaw: float = setting(0.0, "palm turned about the forearm", group="view", low=-3.1416, high=3.1416, unit="rad")
    pitch: float = setting(0.0, "fingers tipped towards the sensor", group="view", low=-1.6, high=1.6, unit="rad")
    roll: float = setting(0.0, "hand turned in the image", group="view", low=-3.1416, high=3.1416, unit="rad")
    variation: float = setting(1.0, "how much the viewpoint varies with the seed", group="view", low=0.0, high=5.0)
    sensor: str = setting("senz3d", "sensor model", group="sensor", choices=tuple(SENSORS))
    clutter: str = setting("forearm", "what else is in the scene", group="sensor", choices=tuple(CLUTTER))
    ragged: float = setting(-1.0, "displacement of edges in pixels, -1 as the sensor", group="sensor", low=-1, high=10)
    holes: float = setting(-1.0, "fraction of area without reading, -1 as the sensor", group="sensor", low=-1, high=0.9)
    missing_phalanx: float = setting(
        -1.0, "fraction of frames with a phalanx missing, -1 as the sensor", group="sensor", low=-1, high=1
    )
    pushed_finger: float = setting(
        -1.0, "fraction of frames with a finger pushed into the scene, -1 as the sensor", group="sensor", low=-1, high=1
    )


class _Stage(NamedTuple):
    """Everything that the frames of a session share."""

    settings: SyntheticSettings
    sensor: Sensor
    hand: Hand
    trajectory: Trajectory
    clutter: Clutter


@dataclass(frozen=True, kw_only=True, eq=False)
class SyntheticSession(Session):
    """A session whose frames are made when they are asked for, each the same every time.

    Attributes:
        settings: what it shows.
        stage: what its frames share.
    """

    settings: SyntheticSettings
    stage: _Stage

    def raw_depth(self, index: int) -> NDArray[np.uint16]:
        """Render and measure a frame: (H, W) counts."""
        rng = np.random.default_rng([self.settings.seed, 2, index])
        return measure(self.stage.sensor, self.clean_depth(index), rng)

    def clean_depth(self, index: int) -> NDArray[np.float32]:
        """Return the depth map (H, W) in metres before the sensor, faults included; FAR where there is nothing."""
        stage = self.stage
        if self.is_absent(index):
            return self._drawn([], moving_meshes(stage.clutter, stage.hand, None, index))
        posed = pose_hand(stage.hand, stage.trajectory.poses[index], stage.trajectory.orientations[index])
        hand = [Mesh(posed.vertices, stage.hand.faces)]
        depth = self._drawn(hand, moving_meshes(stage.clutter, stage.hand, posed, index))
        fault = draw_fault(self.settings.seed, index, stage.sensor.missing_phalanx, stage.sensor.pushed_finger)
        return depth if fault == Fault() else apply_fault(fault, depth, stage.hand, posed, self.camera)

    def hand_mask(self, index: int) -> NDArray[np.bool_]:
        """Return the (H, W) pixels in which the tracked hand is seen, before the sensor; for tests and pictures."""
        stage = self.stage
        if self.is_absent(index):
            return np.zeros((self.camera.height, self.camera.width), dtype=bool)
        posed = pose_hand(stage.hand, stage.trajectory.poses[index], stage.trajectory.orientations[index])
        alone = draw([Mesh(posed.vertices, stage.hand.faces)], self.camera)
        others = self._drawn([], moving_meshes(stage.clutter, stage.hand, posed, index))
        return (alone < FAR) & (alone <= others)

    def truth(self, index: int) -> Truth | None:
        """Return the exact joints, pose and orientation; None while the hand is away."""
        if self.is_absent(index):
            return None
        pose, orientation = self.stage.trajectory.poses[index], self.stage.trajectory.orientations[index]
        return Truth(joints_of(self.stage.hand, pose, orientation), pose, orientation)

    def is_absent(self, index: int) -> bool:
        """Tell whether the hand is away in a frame."""
        return 0 <= index - self.settings.absent_from < self.settings.absent_frames

    def _drawn(self, hand: list[Mesh], others: list[Mesh]) -> NDArray[np.float32]:
        return np.minimum(draw(hand + others, self.camera), self.stage.clutter.background)

    @cached_property
    def hand(self) -> Hand:
        """The hand that it shows, in its true shape."""
        return self.stage.hand


def synthesise(settings: SyntheticSettings | None = None, *, shape: HandShape | None = None) -> SyntheticSession:
    """Make a synthetic session.

    Args:
        settings: what to show; the defaults when None.
        shape: an own hand shape in place of the table's; its side wins over the settings'.

    Raises:
        SettingError: the hand would stand where the sensor reads nothing.
        HandError: the shape does not fit its mesh.
    """
    asked = settings or SyntheticSettings()
    if shape is None:
        shape = hand_shape(asked.shape, asked.side, np.random.default_rng([asked.seed, 0]))  # type: ignore[arg-type]
    stage = _stage(asked.replace(side=shape.side), shape)
    return SyntheticSession(
        uri="synthetic:" + ",".join(_differences(asked)),
        name=f"{asked.motion}-{asked.sensor}-{asked.seed}",
        format="synthetic",
        camera=stage.sensor.camera,
        times_ns=np.rint(np.arange(asked.frames) * 1e9 / stage.sensor.fps).astype(np.int64),
        depth_unit=stage.sensor.depth_unit,
        side=shape.side,
        has_truth=True,
        hand_shape=shape.to_dict(),
        metadata={"sensor": asked.sensor, "synthetic": json.dumps(asked.to_dict())},
        settings=stage.settings,
        stage=stage,
    )


def _stage(settings: SyntheticSettings, shape: HandShape) -> _Stage:
    sensor = _sensor(settings)
    if not sensor.near < sensor.distance < sensor.far:
        raise SettingError(
            f"A hand at {sensor.distance:g} m is out of the range of {settings.sensor}, "
            f"{sensor.near:g} to {sensor.far:g} m; choose another distance."
        )
    hand = shape.hand()
    rng = np.random.default_rng([settings.seed, 1])
    view = _view(settings, sensor, rng)
    mover = hand if shape.side == "right" else mirrored(hand)  # motions are written for a right hand
    trajectory = make_trajectory(
        mover, MOTIONS[settings.motion], view, settings.frames, settings.speed_mm, sensor.fps, rng
    )
    if shape.side == "left":
        trajectory = mirrored_trajectory(trajectory)
    centre = trajectory.poses[:, :3].mean(axis=0)
    clutter = CLUTTER[settings.clutter](Place(sensor.camera, hand, centre, settings.frames, sensor.fps, rng))
    return _Stage(settings, sensor, hand, _with_absence(settings, sensor, trajectory), clutter)


def _sensor(settings: SyntheticSettings) -> Sensor:
    """The sensor of the table with what the settings say otherwise."""
    sensor = SENSORS[settings.sensor]
    faults = {name: getattr(settings, name) for name in ("ragged", "holes", "missing_phalanx", "pushed_finger")}
    sensor = sensor._replace(**{name: value for name, value in faults.items() if value >= 0.0})
    return sensor._replace(distance=settings.distance) if settings.distance > 0.0 else sensor


def _view(settings: SyntheticSettings, sensor: Sensor, rng: np.random.Generator) -> View:
    """Draw the viewpoint around the one asked for; the palm a little above the image's middle, for the forearm."""
    spread = settings.variation * np.radians([14.0, 10.0, 10.0])
    yaw, pitch, roll = np.array([settings.yaw, settings.pitch, settings.roll]) + spread * rng.normal(size=3).clip(-2, 2)
    z = sensor.distance * (1.0 + 0.06 * settings.variation * rng.uniform(-1.0, 1.0))
    camera = sensor.camera
    u = camera.cx + 0.05 * settings.variation * camera.width * rng.uniform(-1.0, 1.0)
    v = camera.cy + 0.04 * settings.variation * camera.height * rng.uniform(-1.0, 1.0)
    return View(camera.back_project(u, v, z), float(yaw), float(pitch), float(roll))


def _with_absence(settings: SyntheticSettings, sensor: Sensor, trajectory: Trajectory) -> Trajectory:
    """Let the hand leave the view sideways before its absence and come back after it."""
    if settings.absent_frames == 0:
        return trajectory
    frame = np.arange(settings.frames)
    last = settings.absent_from + settings.absent_frames
    leaving = minimum_jerk((frame - (settings.absent_from - _GOING)) / _GOING)
    coming = minimum_jerk((frame - last + 1) / _GOING)
    edge = sensor.camera.back_project(sensor.camera.width, sensor.camera.cy, sensor.distance)[0]
    outward = 1.0 if settings.side == "right" else -1.0
    poses = trajectory.poses.copy()
    poses[:, 0] += outward * (edge + _ARM_REACH) * (leaving - coming)
    return trajectory._replace(poses=poses)


def _differences(settings: SyntheticSettings) -> list[str]:
    """``name=value`` of what is not the default."""
    return [
        f"{i.name}={getattr(settings, i.name)}" for i in settings.describe() if getattr(settings, i.name) != i.default
    ]
