"""The colours of all pictures, after Okabe and Ito: people of every colour vision can tell them apart."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from spf.render.scene import Colour

__all__ = ["FAINT", "HAND", "OBSERVED", "OPTIMISED", "PREDICTED", "RESIDUAL", "gradient"]

#: Particles as predicted, before Stochastic Meta-Descent.
PREDICTED: Colour = (0.902, 0.624, 0.0)
#: Particles as optimised.
OPTIMISED: Colour = (0.337, 0.706, 0.914)
#: The reconstructed hand.
HAND: Colour = (0.460, 0.690, 0.850)
#: Observed points, and the same when they are only the backdrop.
OBSERVED: Colour = (0.860, 0.860, 0.840)
FAINT: Colour = (0.460, 0.485, 0.515)
#: Observed points that the model does not explain.
RESIDUAL: Colour = (0.890, 0.360, 0.070)


def gradient(first: Colour, last: Colour, position: ArrayLike) -> NDArray[np.float64]:
    """Return (..., 3) colours between two.

    Args:
        first, last: the colours at 0 and at 1.
        position: (...) any numbers; those outside 0 to 1 get the colour of that end.
    """
    share = np.clip(np.asarray(position, dtype=np.float64), 0.0, 1.0)[..., None]
    return (1 - share) * np.asarray(first) + share * np.asarray(last)
