"""RVL, a lossless code of depth images: runs of zeros and of differences, as numbers of variable length.

A. D. Wilson, Fast Lossless Depth Image Compression, ISS 2017. A number is a sequence of nibbles, each with three of its
bits, the lowest first, and a fourth that says that more follow; eight nibbles are a 32-bit word, the first one highest.
An image is, again and again, the length of a run of zeros, the length of a run of others, and for each of those its
difference d from the last pixel that was not 0, as 2d or, if it is negative, -2d - 1.
"""

from __future__ import annotations

import numpy as np

from spf.kernels.compiling import kernel, part

__all__ = ["unpack_rvl"]

_LONGEST = 10  # nibbles of a number: more than 30 bits are none that is written


@part
def _number(words: np.ndarray, nibble: int) -> tuple[int, int]:
    """Read the number that begins at a nibble; returns it, -1 if it is damaged, and where the next one begins."""
    value = 0
    for digit in range(_LONGEST):
        word = nibble >> 3
        if word >= len(words):
            break
        bits = (np.int64(words[word]) >> (28 - 4 * (nibble & 7))) & 15
        nibble += 1
        value |= (bits & 7) << (3 * digit)
        if bits < 8:
            return value, nibble
    return -1, nibble


@kernel
def unpack_rvl(words: np.ndarray, pixels: np.ndarray) -> bool:
    """Unpack an image; False if it is damaged.

    Args:
        words: (M,) uint32.
        pixels: (N,) uint16, zeros; the image is written to it.
    """
    nibble, position, value = 0, 0, 0
    while position < len(pixels):
        zeros, nibble = _number(words, nibble)
        run, nibble = _number(words, nibble)
        if zeros < 0 or run < 0 or zeros + run > len(pixels) - position:
            return False
        position += zeros
        for _ in range(run):
            step, nibble = _number(words, nibble)
            value += (step >> 1) ^ -(step & 1)
            if step < 0 or value < 0 or value > 65535:
                return False
            pixels[position] = value
            position += 1
    return True
