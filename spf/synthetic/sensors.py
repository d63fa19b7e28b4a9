"""Sensor models by name: from clean depth to what such a sensor delivers, seeded.

In the order of the light: ragged edges, flying pixels, the stereo shadow, noise, disparity steps, lost surfaces, holes
and counts. Noise is Gaussian with the standard deviation

    σ(z) = floor + quadratic · z²

of which a part is grainy (correlated over a few pixels), as a sensor's own filter leaves it. On captured hands the
residual of a local fit is 1.3 mm (Kinect v2) and 1.5 mm (Senz3D), and neighbours are correlated by 0.6 and 0.2; of the
models it is 1.4 and 2.1 mm.
"""

from __future__ import annotations

from typing import NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from spf.frame import Camera

__all__ = ["SENSORS", "Sensor", "measure", "noise_sd"]

Image = NDArray[np.float32]

_EDGE_STEP = 0.02  # m of depth between neighbours that makes an edge
_STEEP_LOST = 0.7  # of the pixels on surfaces that are too steep


class Sensor(NamedTuple):
    """A depth sensor.

    Attributes:
        meaning: one line.
        camera: its depth camera.
        fps: frames a second.
        depth_unit: metres per count.
        near, far: m, the range in which it reads.
        distance: m, where a hand is usually held.
        noise_floor: m, and ``noise_quadratic``: 1/m: the two terms of σ(z).
        grain: pixels over which a part of the noise is correlated; 1 for none.
        grainy: that part, a fraction of the variance.
        ragged: pixels, standard deviation by which edges are displaced.
        flying: probability that an edge pixel reads somewhere between the two surfaces.
        baseline: m between the two eyes of a stereo or structured-light sensor, 0 for none: it shadows and has …
        disparity_step: … depth in steps of this many pixels of disparity.
        steepest: slope of the surface (tangent of the angle to the line of sight) above which it mostly reads nothing.
        holes: fraction of the area without reading.
        missing_phalanx, pushed_finger: fraction of the frames with these faults.
    """

    meaning: str
    camera: Camera
    fps: float
    depth_unit: float
    near: float
    far: float
    distance: float
    noise_floor: float = 0.0
    noise_quadratic: float = 0.0
    grain: int = 1
    grainy: float = 0.0
    ragged: float = 0.0
    flying: float = 0.0
    baseline: float = 0.0
    disparity_step: float = 0.0
    steepest: float = 0.0
    holes: float = 0.0
    missing_phalanx: float = 0.0
    pushed_finger: float = 0.0


#: All sensors by name.
SENSORS: dict[str, Sensor] = {
    "ideal": Sensor(
        meaning="no noise, steps of 0.1 mm",
        camera=Camera(640, 480, 475.0, 475.0, 319.5, 239.5),
        fps=30.0,
        depth_unit=0.0001,
        near=0.1,
        far=4.0,
        distance=0.45,
    ),
    "kinect2": Sensor(
        meaning="time of flight, Kinect v2: 1-3 mm of noise, flying pixels at the edges",
        camera=Camera(512, 424, 363.9, 363.9, 255.4, 206.3),
        fps=30.0,
        depth_unit=0.001,
        near=0.45,
        far=4.5,
        distance=0.65,
        noise_floor=0.0014,
        noise_quadratic=0.0012,
        grain=3,
        grainy=0.9,
        ragged=0.5,
        flying=0.5,
        steepest=6.0,
        holes=0.003,
    ),
    "senz3d": Sensor(
        meaning="time of flight, Creative Senz3D: 3-8 mm of noise, ragged edges",
        camera=Camera(320, 240, 224.5, 230.5, 160.0, 120.0),
        fps=30.0,
        depth_unit=0.001,
        near=0.15,
        far=1.0,
        distance=0.38,
        noise_floor=0.0015,
        noise_quadratic=0.018,
        grain=7,
        grainy=0.85,
        ragged=0.8,
        flying=0.3,
        steepest=4.0,
        holes=0.01,
    ),
    "realsense": Sensor(
        meaning="active stereo, RealSense D415: noise and steps that grow with the distance squared, shadows, holes",
        camera=Camera(640, 480, 610.0, 610.0, 319.5, 239.5),
        fps=30.0,
        depth_unit=0.001,
        near=0.3,
        far=3.0,
        distance=0.5,
        noise_floor=0.0002,
        noise_quadratic=0.0045,
        grain=7,
        grainy=0.8,
        ragged=1.2,
        baseline=0.055,
        disparity_step=0.03125,
        steepest=3.0,
        holes=0.02,
    ),
    "structured_light": Sensor(
        meaning="the paper's Fig. 2: orthographic, holes, a phalanx missing, a finger pushed into the scene",
        camera=Camera(480, 360, 1200.0, 1200.0, 239.5, 179.5, "orthographic"),
        fps=12.5,
        depth_unit=0.0001,
        near=0.1,
        far=2.0,
        distance=0.5,
        noise_floor=0.0008,
        grain=5,
        grainy=0.7,
        ragged=1.5,
        steepest=2.5,
        holes=0.04,
        missing_phalanx=0.25,
        pushed_finger=0.2,
    ),
}


def noise_sd(sensor: Sensor, z: Image) -> Image:
    """Return σ(z) in metres for depths in metres."""
    return np.float32(sensor.noise_floor) + np.float32(sensor.noise_quadratic) * z * z


def measure(sensor: Sensor, depth: Image, rng: np.random.Generator) -> NDArray[np.uint16]:
    """Take a picture of a clean depth map.

    Args:
        sensor: the sensor.
        depth: (H, W) m; 0 or beyond the range where there is nothing.
        rng: the frame's own generator.

    Returns:
        (H, W) counts of ``sensor.depth_unit``, 0 where there is no reading.
    """
    in_range = (depth >= sensor.near) & (depth <= sensor.far)
    counts = np.zeros(depth.shape, np.uint16)
    rows, columns = np.flatnonzero(in_range.any(axis=1)), np.flatnonzero(in_range.any(axis=0))
    if len(rows) == 0:
        return counts
    margin = int(np.ceil(3.0 * sensor.ragged)) + 1
    window = (
        slice(max(rows[0] - margin, 0), rows[-1] + 1 + margin),
        slice(max(columns[0] - margin, 0), columns[-1] + 1 + margin),
    )
    z = _measured(sensor, np.where(in_range[window], depth[window], np.float32(0.0)), rng)
    z[(z < sensor.near) | (z > sensor.far)] = 0.0
    counts[window] = (z * np.float32(1.0 / sensor.depth_unit) + np.float32(0.5)).astype(np.uint16)
    return counts


def _measured(sensor: Sensor, clean: Image, rng: np.random.Generator) -> Image:
    """What the sensor makes of the part of a picture that it can see; 0 is nothing."""
    z = clean.copy()
    if sensor.ragged > 0.0:
        z = _ragged(z, sensor.ragged, rng)
    if sensor.flying > 0.0:
        z = _flying(z, sensor.flying, rng)
    if sensor.baseline > 0.0:
        z = _shadowed(sensor, z)
    if sensor.noise_floor > 0.0 or sensor.noise_quadratic > 0.0:
        z += (z > 0.0) * noise_sd(sensor, z) * _noise(z.shape, sensor, rng)
    if sensor.disparity_step > 0.0:
        z = _stepped(sensor, z)
    if sensor.steepest > 0.0:
        steep = np.flatnonzero(_slope(sensor, clean) > sensor.steepest)
        z.ravel()[steep[rng.random(len(steep)) < _STEEP_LOST]] = 0.0
    if sensor.holes > 0.0:
        z = _holed(z, sensor.holes, rng)
    return z


def _slope(sensor: Sensor, z: Image) -> Image:
    """Tangent of the angle between the line of sight and the surface's normal, by central differences."""
    du, dv = cv2.Sobel(z, cv2.CV_32F, 1, 0, scale=0.125), cv2.Sobel(z, cv2.CV_32F, 0, 1, scale=0.125)
    slope = cv2.magnitude(du * np.float32(sensor.camera.fx), dv * np.float32(sensor.camera.fy))
    if sensor.camera.model == "pinhole":
        slope = slope / np.maximum(z, np.float32(sensor.near))
    return np.asarray(slope, dtype=np.float32)


def _ragged(z: Image, spread: float, rng: np.random.Generator) -> Image:
    """Let every pixel near an edge read a little beside itself."""
    reach = 2 * int(np.ceil(2.0 * spread)) + 1
    kernel = np.ones((reach, reach), np.uint8)
    edge = np.flatnonzero(cv2.dilate(z, kernel) - cv2.erode(z, kernel) > _EDGE_STEP)
    height, width = z.shape
    dv, du = np.rint(rng.normal(0.0, spread, (2, len(edge)))).astype(np.intp)
    v, u = np.clip(edge // width + dv, 0, height - 1), np.clip(edge % width + du, 0, width - 1)
    result = z.copy()
    result.ravel()[edge] = z[v, u]
    return result


def _flying(z: Image, probability: float, rng: np.random.Generator) -> Image:
    """Mix near and far surface at depth edges; beside nothing, some centimetres are made up."""
    kernel = np.ones((3, 3), np.uint8)
    farthest = cv2.dilate(z, kernel)
    nothing = (cv2.erode(z, kernel) == 0.0) & (z > 0.0)
    edge = np.flatnonzero((((farthest - z) > _EDGE_STEP) & (z > 0.0)) | nothing)
    edge = edge[rng.random(len(edge)) < probability]
    beyond = np.maximum(farthest.ravel()[edge] - z.ravel()[edge], 0.04 * nothing.ravel()[edge])
    result = z.copy()
    result.ravel()[edge] += (rng.random(len(edge)) * beyond).astype(np.float32)
    return result


def _shadowed(sensor: Sensor, z: Image) -> Image:
    """Blank what the right eye cannot see: the band beside a nearer surface, as wide as the jump in disparity."""
    reach = sensor.camera.fx * sensor.baseline
    disparity = np.divide(reach, z, out=np.zeros_like(z), where=z > 0.0)
    columns = np.arange(z.shape[1], dtype=np.float32)
    seen_at = columns - disparity  # column in the right eye; a nearer surface further right may already cover it
    after = np.minimum.accumulate(np.where(z > 0.0, seen_at, np.inf)[:, ::-1], axis=1)[:, ::-1]
    covered = np.zeros(z.shape, dtype=bool)
    covered[:, :-1] = after[:, 1:] < seen_at[:, :-1]
    return np.where(covered, np.float32(0.0), z)


def _stepped(sensor: Sensor, z: Image) -> Image:
    reach = np.float32(sensor.camera.fx * sensor.baseline)
    step = np.float32(sensor.disparity_step)
    disparity = np.divide(reach, z, out=np.zeros_like(z), where=z > 0.0)
    steps = np.maximum(np.rint(disparity / step), 1.0) * step
    return np.where(z > 0.0, reach / steps, z).astype(np.float32)


def _noise(shape: tuple[int, ...], sensor: Sensor, rng: np.random.Generator) -> Image:
    """Unit normal noise, of which a part is correlated over the sensor's grain."""
    white = rng.standard_normal(shape, dtype=np.float32)
    if sensor.grain <= 1:
        return white
    grain = sensor.grain
    grainy = np.float32(grain) * cv2.blur(rng.standard_normal(shape, dtype=np.float32), (grain, grain))
    return np.float32(np.sqrt(1.0 - sensor.grainy)) * white + np.float32(np.sqrt(sensor.grainy)) * grainy


def _holed(z: Image, fraction: float, rng: np.random.Generator) -> Image:
    """Blank blobs that take this fraction of the pixels that have a reading."""
    height, width = z.shape
    coarse = rng.standard_normal((height // 4 + 2, width // 4 + 2), dtype=np.float32)
    field = cv2.resize(coarse, (width, height), interpolation=cv2.INTER_LINEAR)
    inside = field[z > 0.0]
    if len(inside) == 0:
        return z
    return np.where(field > np.quantile(inside, 1.0 - fraction), np.float32(0.0), z)
