"""Coverage term: observed pixels against the model, which keeps fingers from hiding inside the palm (spec 4).

coverage   Σ_D ½ c ρ(‖x̂_match − X‖)/ℓ²      observed pixel → nearest visible model point
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from spf.kernels.compiling import index, part
from spf.kernels.cost_inputs import CostWeights, ObservationArrays
from spf.kernels.robust import cauchy_sum, multiply
from spf.kernels.skinning import Skin, carry, push

__all__ = ["coverage_term"]

Array = NDArray[np.float64]


@part
def coverage_term(
    surface: Skin, obs: ObservationArrays, weights: CostWeights,
    pose: Array, direction: Array, pixels: NDArray[np.int32], matches: NDArray[np.int32], bones: Array,
) -> float:  # fmt: skip
    """Energy of observed pixels and their matches; adds their wrenches. A match of -1 counts nothing."""
    movers, shares, points = surface.influence_bone, surface.shares, obs.surface
    size = pixels.shape[0] if weights.coverage > 0.0 else 0
    gain = weights.points / max(size, 1) * weights.coverage / (weights.length * weights.length)
    pull = weights.pull
    squares = logarithm = 0.0
    product = 1.0
    tx, ty, tz, sx, sy, sz = pose[0], pose[1], pose[2], direction[0], direction[1], direction[2]
    for s in range(size):
        if matches[s] < 0:
            continue
        i, p = index(matches[s]), index(pixels[s])
        x, y, z, _, _, _, dx, dy, dz, _, _, _ = carry(movers, shares, bones, i)
        x, y, z = x + tx - points[p, 0], y + ty - points[p, 1], z + tz - points[p, 2]
        squared = x * x + y * y + z * z
        factor = 1.0 + squared * pull
        squares += squared
        product, logarithm = multiply(factor, product, logarithm)
        f = gain / factor
        push(
            movers, shares, bones, i,
            f * x, f * y, f * z, 0.0, 0.0, 0.0, f * (dx + sx), f * (dy + sy), f * (dz + sz), 0.0, 0.0, 0.0,
        )  # fmt: skip
    return 0.5 * gain * cauchy_sum(pull, product, logarithm, squares)
