"""What a depth sensor makes of a clean depth map, fast enough for millions of pictures.

The same faults as :mod:`spf.synthetic.sensors`, in single passes over a small picture; all randomness is read from pools
of numbers that are drawn outside, from a place that is drawn outside.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from spf.kernels.compiling import index, part

__all__ = ["FAULTS", "Pools", "sense"]

Array = NDArray[np.float64]
Image = NDArray[np.float32]

#: Columns of a sensor's faults: displacement of edges (pixels), share of flying pixels at edges, share of edge pixels
#: lost, white noise (m), grainy noise (m), its grain (pixels), holes (share), size of holes (pixels), slope that is
#: lost, whether it smooths (0 or 1), quantisation (m), share of the pixels beside an outline that read what is in front.
FAULTS: tuple[str, ...] = (
    *("ragged", "flying", "eroded", "white", "grainy", "grain", "holes", "hole_size", "steepest", "smooths", "step"),
    "bloom",
)
_EDGE = np.float32(0.02)  # m between neighbours
_MADE_UP = np.float32(0.04)  # m that flying pixels reach behind an edge beside nothing
_LOST = np.float32(0.7)  # share of the pixels on too steep a surface
_ZERO = np.float32(0.0)


class Pools(NamedTuple):
    """Random numbers, drawn once; a picture reads from a place of its own.

    Attributes:
        normal: (P,) float32 standard normal; P is a power of two.
        uniform: (P,) float32 in 0-1.
    """

    normal: Image
    uniform: Image


@part
def _smooth_noise(pool: Image, start: int, v: int, u: int, cell: float) -> float:
    """Bilinear interpolation of normal numbers on a grid of cells, standard deviation about 1."""
    mask = pool.shape[0] - 1
    y, x = v / cell, u / cell
    i, j = int(y), int(x)
    b, a = y - i, x - j
    first = start + 521 * i + j
    top = (1.0 - a) * pool[index(first & mask)] + a * pool[index((first + 1) & mask)]
    low = (1.0 - a) * pool[index((first + 521) & mask)] + a * pool[index((first + 522) & mask)]
    return 1.5 * ((1.0 - b) * top + b * low)


@part
def sense(clean: Image, focal: float, faults: Array, pools: Pools, start: int, spare: Image, seen: Image) -> None:
    """Measure a clean depth map (H, W), m, 0 for nothing; ``seen`` and ``spare`` (H, W) are written.

    Args:
        clean: (H, W) float32.
        focal: focal length, pixels.
        faults: (len(FAULTS),).
        pools: random numbers.
        start: where this picture begins to read them.
        spare: (H, W) float32 working memory.
        seen: (H, W) float32 the measured map, 0 where there is no reading.
    """
    height, width = clean.shape
    _displace(clean, faults[0], faults[11], pools, start, spare)
    for v in range(height):
        for u in range(width):
            z = spare[v, u]
            seen[v, u] = _reading(spare, v, u, focal, faults, pools, start) if z > _ZERO else _ZERO
    if faults[9] > 0.0:
        _smooth(seen, spare)
    step = faults[10]
    inverse = 1.0 / step
    for v in range(height):
        for u in range(width):
            if seen[v, u] > _ZERO:
                seen[v, u] = np.floor(seen[v, u] * inverse + 0.5) * step


@part
def _displace(clean: Image, ragged: float, bloom: float, pools: Pools, start: int, displaced: Image) -> None:
    """Let every pixel read a little beside itself, ``ragged`` pixels on the average, and things grow into what is behind them."""
    height, width = clean.shape
    pool, chances = pools.normal, pools.uniform
    mask = pool.shape[0] - 1
    for v in range(height):
        for u in range(width):
            k = start + 2 * (v * width + u)
            dv = int(np.floor(ragged * pool[index(k & mask)] + 0.5))
            du = int(np.floor(ragged * pool[index((k + 1) & mask)] + 0.5))
            row, column = min(max(v + dv, 0), height - 1), min(max(u + du, 0), width - 1)
            z = clean[index(row), index(column)]
            if chances[index(k & mask)] < bloom:
                z = _in_front(clean, index(row), index(column))
            displaced[v, u] = z


@part
def _in_front(depth: Image, v: int, u: int) -> float:
    """Nearest depth of a pixel and its four neighbours, where one is in front of it by an edge."""
    height, width = depth.shape
    z = nearest = depth[v, u]
    for dv, du in ((-1, 0), (1, 0), (0, -1), (0, 1)):
        other = depth[min(max(v + dv, 0), height - 1), min(max(u + du, 0), width - 1)]
        if other > _ZERO and (nearest == _ZERO or other < nearest):
            nearest = other
    return nearest if z == _ZERO or z - nearest > _EDGE else z


@part
def _reading(depth: Image, v: int, u: int, focal: float, faults: Array, pools: Pools, start: int) -> float:
    """What the sensor reads in one pixel with something in it: edges, steep surfaces, holes and noise; 0 for nothing."""
    height, width = depth.shape
    mask = pools.normal.shape[0] - 1
    flying, eroded, white, grainy, grain = faults[1], faults[2], faults[3], faults[4], faults[5]
    holes, hole_size, steepest = faults[6], faults[7], faults[8]
    z = depth[v, u]
    k = start + 7919 + v * width + u
    chance = pools.uniform[index(k & mask)]
    left, right = depth[v, max(u - 1, 0)], depth[v, min(u + 1, width - 1)]
    above, below = depth[max(v - 1, 0), u], depth[min(v + 1, height - 1), u]
    nearest, farthest = min(min(left, right), min(above, below)), max(max(left, right), max(above, below))
    if farthest - z > _EDGE or nearest == _ZERO:
        if chance < eroded:
            return _ZERO
        if chance < eroded + flying:
            reach = max(farthest - z, _MADE_UP) if nearest == _ZERO else farthest - z
            z += pools.uniform[index((k + 31337) & mask)] * reach
    elif max(farthest - z, z - nearest) * focal > steepest * z and chance < _LOST:
        return _ZERO
    if holes > 0.0 and _smooth_noise(pools.normal, start + 104729, v, u, hole_size) > holes:
        return _ZERO
    z += white * pools.normal[index((k + 50021) & mask)]
    z += grainy * _smooth_noise(pools.normal, start + 200003, v, u, grain)
    return z


@part
def _smooth(seen: Image, spare: Image) -> None:
    """Replace every reading by the mean of those around it that belong to its surface."""
    height, width = seen.shape
    for v in range(height):
        for u in range(width):
            spare[v, u] = seen[v, u]
    for v in range(1, height - 1):
        for u in range(1, width - 1):
            z = spare[v, u]
            if z == _ZERO:
                continue
            total, count = _ZERO, _ZERO
            for i in range(v - 1, v + 2):
                for j in range(u - 1, u + 2):
                    near = abs(spare[i, j] - z) < _EDGE
                    total += spare[i, j] if near else _ZERO
                    count += np.float32(1.0) if near else _ZERO
            seen[v, u] = total / count
