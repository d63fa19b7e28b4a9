"""Particles, their paths, the hand and the points in one scene, layer by layer, in colours that say something."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from bokeh.palettes import Viridis256
from numpy.typing import NDArray

from app.look import Shown
from app.results import Entry
from app.views.scenes import drawn_of, particles_of, reconstruction_of, trajectories_of
from spf.filters.step import StepInfo
from spf.hand.distance import distances_to_surface
from spf.hand.kinematics import pose_hand
from spf.render import Mesh, Scene, reconstruction_scene
from spf.render.scenes import RESIDUAL_FULL

__all__ = ["SCALE_COLOURS", "Scale", "layered", "scale_of"]

Array = NDArray[np.float64]
_MOST_HANDS = 8  # particles drawn as hands
_GLASS = 0.75  # opacity of a hand whose colour says something
_FAR = 0.010  # m, median distance from the points that has the last colour
_MOST_POINTS = 400  # observed points that a particle's distance is the median of
#: From the first to the last colour: the part of viridis that stands out from the background.
SCALE_COLOURS = tuple(Viridis256[70:])


class Scale(NamedTuple):
    """What the first and the last colour of particles stand for, with unit."""

    title: str
    low: float
    high: float
    unit: str


def layered(entry: Entry, shown: Shown) -> Scene | None:
    """Return the scene of a frame with the layers shown; None while the hand is lost."""
    info, seen = entry.result.info, entry.seen
    if info is None or seen is None:
        return None
    layers, drawn = set(shown.layers), drawn_of(info, shown.selected, _MOST_HANDS)
    parts: list[Scene] = []
    halves = [half for half in ("predicted", "optimised") if half in layers]
    if halves:
        parts.append(_hands(entry, info, shown, drawn, halves))
    if "paths" in layers:
        paths = trajectories_of(entry, shown.selected)
        if paths is not None:
            parts.append(Scene(points=paths.points[1:], lines=paths.lines))  # the first are the observed points
    backdrop = particles_of(entry, (int(drawn[0]),))
    assert backdrop is not None
    if "residuals" in layers:
        parts.append(_residuals(entry, info))
    elif "points" in layers:
        parts.append(Scene(points=backdrop.points))
    if "hand" in layers:
        hand = reconstruction_of(entry)
        assert hand is not None
        glass = halves or "residuals" in layers
        parts.append(Scene(meshes=tuple(_glass(mesh) if glass else mesh for mesh in hand.meshes)))
    return Scene(
        meshes=tuple(mesh for part in parts for mesh in part.meshes),
        points=tuple(points for part in parts for points in part.points),
        lines=tuple(lines for part in parts for lines in part.lines),
    )


def scale_of(entry: Entry, colouring: str) -> Scale | None:
    """Return what the colours of a frame's particles stand for; None where they only say before and after."""
    info = entry.result.info
    if info is None or colouring == "stage":
        return None
    if colouring == "weight":
        heaviest = float(np.exp(info.log_weights.max()))
        return Scale("weight", 0.0, 100 * heaviest, "%")
    if colouring == "cost":
        costs = np.concatenate([info.cost_before, info.cost_after])
        return Scale("cost E", float(costs.min()), float(costs.max()), "")
    return Scale("median distance of the points", 0.0, 1000 * _FAR, "mm")


def _hands(entry: Entry, info: StepInfo, shown: Shown, drawn: NDArray[np.intp], halves: Sequence[str]) -> Scene:
    """The particles drawn, as hands, the one half before the other."""
    if shown.colouring == "stage":
        both = particles_of(entry, tuple(int(index) for index in drawn))
        assert both is not None
        count = len(both.meshes) // 2 if len(info.optimised) else len(both.meshes)
        parts = {"predicted": both.meshes[:count], "optimised": both.meshes[count:]}
        return Scene(meshes=tuple(mesh for half in halves for mesh in parts[half]))
    hand, scale = entry.hand, scale_of(entry, shown.colouring)
    assert scale is not None
    meshes = []
    for half in halves:
        poses = info.predicted if half == "predicted" else info.optimised
        for index in drawn if len(poses) else ():
            vertices = pose_hand(hand, poses[index], info.reference).vertices
            place = int(index) if half == "predicted" else len(info.predicted) + int(index)
            value = _value(entry, info, shown.colouring, place, vertices)
            meshes.append(Mesh(np.asarray(vertices, np.float32), hand.faces, _colour(value, scale), _GLASS))
    return Scene(meshes=tuple(meshes))


def _value(entry: Entry, info: StepInfo, colouring: str, sample: int, vertices: Array) -> float:
    """What the colour of a sample stands for, in the unit of its scale."""
    if colouring == "weight":
        return 100 * float(np.exp(info.log_weights[sample]))
    if colouring == "cost":
        return float(np.concatenate([info.cost_before, info.cost_after])[sample])
    assert entry.seen is not None
    points = entry.seen.points[:: max(1, len(entry.seen.points) // _MOST_POINTS)]
    # The median, since the points of the forearm, which the model lacks, are far from every particle.
    return 1000 * float(np.median(distances_to_surface(points, vertices, entry.hand.faces)))


def _colour(value: float, scale: Scale) -> tuple[float, float, float]:
    share = (value - scale.low) / ((scale.high - scale.low) or 1.0)
    text = SCALE_COLOURS[int(np.clip(share, 0.0, 1.0) * (len(SCALE_COLOURS) - 1))]
    red, green, blue = (int(text[at : at + 2], 16) / 255 for at in (1, 3, 5))
    return red, green, blue


def _residuals(entry: Entry, info: StepInfo) -> Scene:
    """The observed points, each the redder the farther it is from the estimated hand."""
    assert entry.seen is not None
    hand, points = entry.hand, entry.seen.points
    vertices = pose_hand(hand, info.estimate, info.reference).vertices
    far = np.minimum(distances_to_surface(points, vertices, hand.faces), RESIDUAL_FULL)
    return Scene(points=reconstruction_scene(vertices, hand.faces, points=points, residuals=far).points)


def _glass(mesh: Mesh) -> Mesh:
    return Mesh(mesh.vertices, mesh.faces, mesh.colour, 0.6)
