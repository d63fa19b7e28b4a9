"""The three pictures of the dashboard and the reports, as scenes: particles, trajectories, reconstruction.

They take plain arrays in the camera frame and in metres, so that any tracker's result can be drawn.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from spf.render.palette import FAINT, HAND, OBSERVED, OPTIMISED, PREDICTED, RESIDUAL, gradient
from spf.render.scene import Colour, Lines, Mesh, Points, Scene

__all__ = ["particles_scene", "reconstruction_scene", "trajectories_scene"]

#: Opacity of a hand without weight, and of the heaviest.
OPACITY_RANGE = (0.25, 0.9)

#: Observed points beyond this number are thinned out: a closed sheet of them would hide the hand.
POINTS_AT_MOST = 4000

#: Brightness of the farthest observed point; the nearest has 1. It shows their relief.
FAR_BRIGHTNESS = 0.55

#: Distance from the model, in metres, at which an observed point has the full colour of a residual.
RESIDUAL_FULL = 0.010


def particles_scene(
    predicted: ArrayLike | None,
    optimised: ArrayLike | None,
    faces: ArrayLike,
    *,
    predicted_weights: ArrayLike | None = None,
    optimised_weights: ArrayLike | None = None,
    points: ArrayLike | None = None,
    at_most: int = 8,
) -> Scene:
    """Show the particles before and after optimisation, the heavier the more solid (Fig. 6, c and e).

    Args:
        predicted: (N, V, 3) vertices of the predicted hands in metres, or None where the tracker has none.
        optimised: (N, V, 3) vertices of the optimised hands, particle for particle, or None where the tracker has none.
        faces: (F, 3) vertex indices, counter-clockwise seen from outside.
        predicted_weights, optimised_weights: (N,) weights of the two halves, on one scale; None draws all alike.
        points: (M, 3) observed points, or None.
        at_most: draw only the particles whose heavier half is among the heaviest so many.

    Raises:
        ValueError: shapes do not fit together, or a weight is negative or not finite.
    """
    nothing = np.zeros((0, 0, 3), np.float32)
    after = nothing if optimised is None else np.asarray(optimised, dtype=np.float32)
    before = nothing if predicted is None else np.asarray(predicted, np.float32)
    if len(before) and len(after) and len(before) != len(after):
        raise ValueError(f"there are {len(before)} predicted and {len(after)} optimised hands")
    weights_before = _weights(predicted_weights, len(before))
    weights_after = _weights(optimised_weights, len(after))
    heaviest = max(weights_before.max(initial=0.0), weights_after.max(initial=0.0)) or 1.0
    halves = [weights for weights in (weights_before, weights_after) if len(weights)]
    rank = np.max(halves, axis=0) if halves else np.empty(0)
    drawn = np.sort(np.argsort(-rank, kind="stable")[:at_most])
    indices = np.asarray(faces, dtype=np.int32)
    low, high = OPACITY_RANGE
    hands = tuple(
        Mesh(half[n], indices, colour, low + (high - low) * float(weights[n] / heaviest))
        for half, weights, colour in ((before, weights_before, PREDICTED), (after, weights_after, OPTIMISED))
        for n in drawn
        if len(half)
    )
    return Scene(meshes=hands, points=_backdrop(points))


def trajectories_scene(paths: ArrayLike, *, weights: ArrayLike | None = None, points: ArrayLike | None = None) -> Scene:
    """Show how Stochastic Meta-Descent moved some joints of every particle, from a start dot to an end dot (Fig. 10).

    Args:
        paths: (N, I, J, 3) of N ≥ 0 particles, I ≥ 1 iterations and J joints (the wrist and the five fingertips), metres; a
            particle that converged early repeats its last position.
        weights: (N,) weights after optimisation: lighter particles fade into the background; None draws all alike.
        points: (M, 3) observed points, or None.

    Raises:
        ValueError: shapes do not fit together, or a number is negative (weights) or not finite.
    """
    steps = np.asarray(paths, dtype=np.float32)
    if steps.ndim != 4 or steps.shape[1] < 1 or steps.shape[3] != 3:
        raise ValueError(f"paths have shape {steps.shape}, expected (N, I, J, 3) with at least one iteration")
    particles, iterations, joints, _ = steps.shape
    if not particles:  # a tracker that optimises nothing
        return Scene(points=_backdrop(points))
    given = _weights(weights, particles)
    strength = 0.35 + 0.65 * np.repeat(given / (given.max(initial=0.0) or 1.0), joints)[:, None, None]
    along = gradient(PREDICTED, OPTIMISED, np.linspace(0.0, 1.0, iterations))
    colours = np.asarray(FAINT) * (1 - strength) + along * strength
    lines = steps.transpose(0, 2, 1, 3).reshape(particles * joints, iterations, 3)
    return Scene(
        points=(
            *_backdrop(points),
            Points(lines[:, 0], colours[:, 0], size=5.0, ball=True),
            Points(lines[:, -1], colours[:, -1], size=9.0, ball=True),
        ),
        lines=(Lines(lines, colours, width=2.0),),
    )


def reconstruction_scene(
    vertices: ArrayLike,
    faces: ArrayLike,
    *,
    points: ArrayLike | None = None,
    residuals: ArrayLike | None = None,
    colour: Colour = HAND,
) -> Scene:
    """Show the reconstructed hand among the observed points (Fig. 9).

    Args:
        vertices: (V, 3) of the posed mesh, metres.
        faces: (F, 3) vertex indices, counter-clockwise seen from outside.
        points: (M, 3) observed points, or None.
        residuals: (M,) distance of each point from the model, metres: the farther, the redder; None draws all alike.
        colour: of the hand.

    Raises:
        ValueError: shapes do not fit together or a number is not finite.
    """
    hand = Mesh(np.asarray(vertices), np.asarray(faces), colour)
    if points is None:
        return Scene(meshes=(hand,))
    xyz = np.asarray(points, dtype=np.float32)
    thin = _thin(len(xyz))
    drawn = xyz[thin]
    plain: NDArray[np.float64] = np.asarray(OBSERVED)
    if residuals is not None:
        far = np.asarray(residuals, dtype=np.float64)
        if far.shape != xyz.shape[:1] or not np.isfinite(far).all():
            raise ValueError(f"residuals have shape {far.shape}, expected ({len(xyz)},), all finite")
        plain = gradient(OBSERVED, RESIDUAL, far[thin] / RESIDUAL_FULL)
    return Scene(meshes=(hand,), points=(Points(drawn, plain * _relief(drawn), size=2.0),))


def _backdrop(points: ArrayLike | None) -> tuple[Points, ...]:
    if points is None:
        return ()
    xyz = np.asarray(points, dtype=np.float32)
    drawn = xyz[_thin(len(xyz))]
    return (Points(drawn, np.asarray(FAINT) * _relief(drawn), size=2.0),)


def _thin(count: int) -> NDArray[np.bool_]:
    """Return which points to draw: chosen at random, since every k-th of an image's pixels makes stripes."""
    return np.random.default_rng(0).random(count) * count <= POINTS_AT_MOST


def _relief(xyz: NDArray[np.float32]) -> NDArray[np.float64]:
    """Return (M, 1) brightness that falls with the distance from the sensor."""
    if xyz.ndim != 2 or not len(xyz):
        return np.ones((1, 1))
    near, far = np.percentile(xyz[:, 2], [2, 98])
    return 1 - (1 - FAR_BRIGHTNESS) * np.clip((xyz[:, 2:] - near) / max(far - near, 1e-3), 0, 1)


def _weights(weights: ArrayLike | None, count: int) -> NDArray[np.float64]:
    values = np.ones(count) if weights is None else np.asarray(weights, dtype=np.float64)
    if values.shape != (count,):
        raise ValueError(f"weights have shape {values.shape}, expected ({count},)")
    if not np.isfinite(values).all() or (values < 0).any():
        raise ValueError("weights must be finite and not negative")
    return values
