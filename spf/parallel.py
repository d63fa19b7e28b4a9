"""Run independent pieces of work on all cores. The kernels release the GIL, so threads are enough."""

from __future__ import annotations

import os
import threading
from collections.abc import Callable, Hashable, Iterable
from concurrent.futures import ThreadPoolExecutor
from functools import lru_cache
from typing import TypeVar

__all__ = ["map_threads", "per_thread", "threads"]

T = TypeVar("T")
R = TypeVar("R")


def threads() -> int:
    """Number of threads used: the cores of this process, or SPF_THREADS."""
    return max(1, int(os.environ.get("SPF_THREADS", 0)) or len(os.sched_getaffinity(0)))


@lru_cache(maxsize=1)
def _pool(count: int) -> ThreadPoolExecutor:
    return ThreadPoolExecutor(count, thread_name_prefix="spf")


def map_threads(function: Callable[[T], R], items: Iterable[T]) -> list[R]:
    """Apply a function to independent items, results in order. Must not be nested."""
    work = list(items)
    if len(work) < 2 or threads() == 1:
        return [function(item) for item in work]
    return list(_pool(threads()).map(function, work))


def per_thread(make: Callable[..., R]) -> Callable[..., R]:
    """Keep, in every thread, what ``make`` made last for the sizes that it was given: for memory to work in.

    Whoever gets it finds what the last one left in it, and may hold it only until the same thread asks again.
    """
    kept = threading.local()

    def get(*sizes: Hashable) -> R:
        if getattr(kept, "sizes", None) != sizes:
            kept.value, kept.sizes = make(*sizes), sizes
        value: R = kept.value
        return value

    return get
