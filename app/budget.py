"""How much of what was tracked all pages of a server keep in memory together."""

from __future__ import annotations

from typing import Protocol
from weakref import WeakSet

__all__ = ["SHARED", "Budget", "Keeping"]


class Keeping(Protocol):
    """Something that keeps frames and can forget the oldest of them."""

    @property
    def kept_bytes(self) -> int:
        """Bytes of all frames that are kept."""

    def forget_oldest(self) -> bool:
        """Forget a frame.

        Returns:
            Whether there was one that could be done without.
        """


class Budget:
    """Bytes that are kept together; who keeps most forgets first.

    Args:
        most: bytes.
    """

    def __init__(self, most: int) -> None:
        self._most = most
        self._keeping: WeakSet[Keeping] = WeakSet()

    def keep_within(self, newest: Keeping) -> None:
        """Make room after ``newest`` has come to keep more."""
        self._keeping.add(newest)
        by_size = sorted(self._keeping, key=lambda keeping: keeping.kept_bytes)
        while by_size and sum(keeping.kept_bytes for keeping in self._keeping) > self._most:
            if not by_size[-1].forget_oldest():
                by_size.pop()
            by_size.sort(key=lambda keeping: keeping.kept_bytes)


SHARED = Budget(128 * 2**20)
