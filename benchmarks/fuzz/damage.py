"""Ways in which a recording can be damaged, each drawn from a random generator."""

from __future__ import annotations

import struct
from collections.abc import Callable

import numpy as np

__all__ = ["DAMAGES", "damaged"]

Damage = Callable[[np.random.Generator, bytearray], bytearray]

#: Numbers that headers of damaged files hold: nothing, all bits, the largest of each sign, too large by far.
_ABSURD = [0, 1, 0x7F, 0xFF, 0x7FFF, 0xFFFF, 0x7FFFFFFF, 0x80000000, 0xFFFFFFFF, 2**40, 2**62, 2**63 - 1, 2**64 - 1]


def _truncated(rng: np.random.Generator, data: bytearray) -> bytearray:
    return data[: int(rng.integers(0, len(data)))]


def _flipped(rng: np.random.Generator, data: bytearray) -> bytearray:
    for position in rng.integers(0, len(data), int(rng.integers(1, 9))):
        data[position] ^= 1 << int(rng.integers(8))
    return data


def _absurd(rng: np.random.Generator, data: bytearray) -> bytearray:
    """Put absurd numbers of 1 to 8 bytes, in either byte order, where headers are: mostly near the start or the end."""
    for _ in range(int(rng.integers(1, 4))):
        near = min(len(data), int(rng.choice([64, 512, 4096, len(data)])))
        position = int(rng.integers(0, near))
        position = position if rng.random() < 0.6 else len(data) - 1 - position
        number = struct.pack(str(rng.choice(["<Q", ">Q"])), int(rng.choice(np.array(_ABSURD, dtype=np.uint64))))
        size = int(rng.choice([1, 2, 4, 8]))
        piece = number[:size] if rng.random() < 0.5 else number[-size:]
        data[position : position + size] = piece
    return data


def _cut_out(rng: np.random.Generator, data: bytearray) -> bytearray:
    start, size = int(rng.integers(0, len(data))), int(rng.integers(1, max(2, len(data) // 4)))
    del data[start : start + size]
    return data


def _doubled(rng: np.random.Generator, data: bytearray) -> bytearray:
    start, size = int(rng.integers(0, len(data))), int(rng.integers(1, max(2, len(data) // 4)))
    return data[: start + size] + data[start:]


def _overwritten(rng: np.random.Generator, data: bytearray) -> bytearray:
    start, size = int(rng.integers(0, len(data))), int(rng.integers(1, 600))
    filler = bytes(size) if rng.random() < 0.5 else rng.bytes(size)
    data[start : start + size] = filler
    return data


def _garbage_behind(rng: np.random.Generator, data: bytearray) -> bytearray:
    keep = int(rng.integers(4, min(len(data), 4096)))
    return data[:keep] + rng.bytes(int(rng.integers(0, 5000)))


#: Name → damage.
DAMAGES: dict[str, Damage] = {
    "truncated": _truncated,
    "flipped": _flipped,
    "absurd": _absurd,
    "cut out": _cut_out,
    "doubled": _doubled,
    "overwritten": _overwritten,
    "garbage": _garbage_behind,
}


def damaged(rng: np.random.Generator, data: bytes) -> tuple[str, bytes]:
    """Return a name of a damage, and the damaged content of a file that was not empty."""
    name = str(rng.choice(list(DAMAGES)))
    return name, bytes(DAMAGES[name](rng, bytearray(data)))
