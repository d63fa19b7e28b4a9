"""What the network's numbers mean: shared by its training and its use."""

from __future__ import annotations

__all__ = [
    "ANGLES", "ARTICULATED", "CROP_SIZE", "EXTENT_PER_LENGTH", "HYPOTHESES", "LOGIT", "LOG_SIZE", "LOG_SPREADS",
    "NUMBERS", "OUTPUTS", "POINTS", "PRESENT", "RIGHT", "ROTATION",
]  # fmt: skip

CROP_SIZE = 64  # pixels along a side of a crop
EXTENT_PER_LENGTH = 1.35  # side of the usual cube, in lengths of the hand (wrist to middle tip)

#: Entries of a pose that the network predicts: the articulated ones but the twists.
ARTICULATED: tuple[int, ...] = (6, 7, 8, 9, *(d for f in range(4) for d in (10 + 4 * f, 11 + 4 * f, 13 + 4 * f)))

HYPOTHESES = 3

# Columns of one hypothesis. Lengths are in sides of the cube, from its centre, in the frame of the crop's camera.
POINTS = slice(
    0, 66
)  # 21 joints and the palm's centre, (22, 3): where in the crop (right, down; its side is 1), and depth
LOG_SPREADS = slice(66, 88)  # logarithm of b of each: density ∝ exp(-r/b)
ROTATION = slice(88, 94)  # first two columns of the palm's orientation, before orthonormalisation
ANGLES = slice(94, 110)  # radians
LOG_SIZE = 110  # logarithm of (length of the bundled hand × size) / side of the cube
LOGIT = 111  # of this hypothesis being the best
NUMBERS = 112

# After the hypotheses: logits of there being a hand, and of its being a right one.
PRESENT = HYPOTHESES * NUMBERS
RIGHT = PRESENT + 1
OUTPUTS = PRESENT + 2
