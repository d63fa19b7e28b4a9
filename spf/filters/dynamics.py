"""Dynamics (Fig. 6b): p ← p + f·ṗ·Δt + noise, with f of the model that is chosen."""

from __future__ import annotations

import dataclasses

import numpy as np
from numpy.typing import NDArray

from spf.hand.model import Hand
from spf.settings import Settings, setting

__all__ = ["DynamicsSettings", "drift", "noise_scale", "predict"]

Array = NDArray[np.float64]
_DYNAMICS = "Dynamics"
DYNAMICS = ("first-order", "damped", "random-walk")
_FRAME = 1.0 / 30.0  # s: the noise below is that of a frame at 30 frames/s


@dataclasses.dataclass(frozen=True)
class DynamicsSettings(Settings):
    """How particles spread between frames."""

    noise_translation: float = setting(
        0.005, "noise of the palm's place per frame", group=_DYNAMICS, low=1e-5, high=0.2, unit="m"
    )
    noise_rotation: float = setting(
        0.06, "noise of the palm's rotation per frame", group=_DYNAMICS, low=1e-4, high=2.0, unit="rad"
    )
    noise_digits: float = setting(
        0.12, "noise of the digits' angles per frame", group=_DYNAMICS, low=1e-4, high=2.0, unit="rad"
    )
    dynamics: str = setting(
        "damped",
        "what happens to the last velocity: all of it is kept (the paper's first-order model), a share, or nothing",
        group=_DYNAMICS,
        choices=DYNAMICS,
    )
    velocity: float = setting(
        0.5,
        "share of the last velocity that the damped model keeps",
        group=_DYNAMICS,
        low=0.0,
        high=1.0,
    )


def noise_scale(hand: Hand, settings: DynamicsSettings, interval: float = _FRAME) -> Array:
    """Standard deviation (D,) of the process noise over an interval, m and rad; it grows with the root of time."""
    scale = np.full(hand.dofs, settings.noise_digits)
    scale[:3], scale[3:6] = settings.noise_translation, settings.noise_rotation
    scale[[name.endswith("twist") for name in hand.dof_names]] = settings.noise_digits / 6.0
    return np.asarray(scale * np.sqrt(max(interval, 1e-3) / _FRAME))


def drift(hand: Hand, poses: Array, velocities: Array, interval: float, settings: DynamicsSettings) -> Array:
    """Move poses (N, D) by what is kept of their velocity, within the joint limits: the mean of the prediction."""
    kept = {"first-order": 1.0, "damped": settings.velocity, "random-walk": 0.0}[settings.dynamics]
    return hand.constrain(poses + kept * velocities * interval)


def predict(
    hand: Hand, expected: Array, interval: float, settings: DynamicsSettings, rng: np.random.Generator
) -> Array:
    """Add the process noise of an interval to drifted poses (N, D), within the joint limits."""
    return hand.constrain(expected + rng.normal(size=expected.shape) * noise_scale(hand, settings, interval))
