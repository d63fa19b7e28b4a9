"""An encoder of RVL that follows the paper's text: numbers become digits, digits a text of hexadecimal words."""

from __future__ import annotations

from itertools import groupby

import numpy as np

__all__ = ["encode_rvl"]


def digits(number: int) -> str:
    """A number in octal, lowest digit first; all but the last have 8 added."""
    octal = f"{number:o}"[::-1]
    return "".join(f"{int(digit) + 8:x}" for digit in octal[:-1]) + octal[-1]


def encode_rvl(image: np.ndarray) -> bytes:
    """Width, height and code of an (H, W) image."""
    text, last = "", 0
    runs = [(zero, list(values)) for zero, values in groupby(image.ravel().tolist(), key=lambda value: value == 0)]
    if not runs[0][0]:
        runs.insert(0, (True, []))  # an image begins with a run of zeros, if of none
    if runs[-1][0]:
        runs.append((False, []))  # and ends with a run of others
    for zero, values in runs:
        text += digits(len(values))
        for value in [] if zero else values:
            difference, last = value - last, value
            text += digits(2 * difference if difference >= 0 else -2 * difference - 1)
    text += "0" * (-len(text) % 8)
    words = [int(text[begin : begin + 8], 16) for begin in range(0, len(text), 8)]
    return np.array([image.shape[1], image.shape[0], *words], "<u4").tobytes()
