"""Robust functions ρ of a squared distance r², and sums of them.

    Cauchy          ρ = s² ln(1 + r²/s²)     weight ρ' = 1/(1 + r²/s²)
    Geman-McClure   ρ = r²/(1 + r²/s²)       weight ρ' = 1/(1 + r²/s²)²

A sum of Cauchy's logarithms is the logarithm of one product: kernels multiply, and take the logarithm once.
"""

from __future__ import annotations

import math

from spf.kernels.compiling import part

__all__ = ["cauchy_sum", "multiply"]

_NEARLY_FULL = 1e150  # of what a double holds; no single factor comes near the rest


@part
def multiply(factor: float, product: float, logarithm: float) -> tuple[float, float]:
    """Multiply a factor 1 + r²/s² to a running product, whose overflow goes to a logarithm."""
    product *= factor
    if product > _NEARLY_FULL:
        logarithm += math.log(product)
        product = 1.0
    return product, logarithm


@part
def cauchy_sum(inverse: float, product: float, logarithm: float, squares: float) -> float:
    """Σ ρ of Cauchy's function from the running product and the sum of the squares; for 1/s² = 0, ρ(r²) = r²."""
    return squares if inverse == 0.0 else (logarithm + math.log(product)) / inverse
