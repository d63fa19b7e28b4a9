"""Work on threads: results in order, and memory that every thread keeps to itself."""

import threading

import numpy as np
import pytest

from spf.parallel import map_threads, per_thread


@pytest.mark.parametrize("count", ["1", "3"])
def test_results_keep_their_order(count: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("SPF_THREADS", count)
    assert map_threads(lambda i: 2 * i, range(20)) == list(range(0, 40, 2))


def test_memory_is_kept_for_the_same_sizes_and_made_anew_for_others() -> None:
    scratch = per_thread(np.zeros)
    first = scratch(3)
    assert scratch(3) is first
    assert scratch(4).shape == (4,)
    assert scratch(3) is not first


def test_no_two_threads_share_memory() -> None:
    scratch, others = per_thread(np.zeros), []
    thread = threading.Thread(target=lambda: others.append(scratch(3)))
    thread.start()
    thread.join()
    assert scratch(3) is not others[0]
