"""How kernels are compiled: the numba options, in one place.

Divisions follow IEEE (``error_model="numpy"``): a check for zero would cost a branch each. Functions that allocate no
array neither count references to those that they are given (``_nrt=False``): numba would do it with two atomic
operations an array and call, on counters that all threads share.

Compiled kernels are kept for the next process. Parts of them come from other files, whose changes numba does not notice:
what is kept is kept for exactly these sources.
"""

from __future__ import annotations

import hashlib
from pathlib import Path
from typing import Any

import numba
import numpy as np

__all__ = ["allocating", "index", "kernel", "part", "strict_kernel", "strict_part"]


def _cache_of(sources: Path) -> Path:
    """Folder of what is compiled from a folder of sources as they now are."""
    digest = hashlib.sha256(b"".join(path.read_bytes() for path in sorted(sources.glob("*.py"))))
    return sources / "__pycache__" / f"kernels-{digest.hexdigest()[:16]}"


if not numba.config.CACHE_DIR:  # NUMBA_CACHE_DIR, which goes first
    numba.config.CACHE_DIR = str(_cache_of(Path(__file__).parent))

_compile: Any = numba.njit  # its declared signature lacks some of the options
_STRICT: dict[str, Any] = {"cache": True, "nogil": True, "error_model": "numpy", "no_cfunc_wrapper": True}
_FAST = _STRICT | {"fastmath": True}

#: A kernel that may allocate arrays.
allocating: Any = _compile(**_FAST)

#: A kernel that works in the arrays that it is given.
kernel: Any = _compile(**_FAST, _nrt=False)

#: A part of kernels: compiled into each of them. Whatever a kernel calls has to be one, even what Python calls as well:
#: of two compiled copies of a function, which may round otherwise, a process uses the one that it met first, and that
#: is another one where kernels are compiled than where they are loaded.
part: Any = _compile(**_FAST, _nrt=False, forceinline=True)

#: A kernel that keeps to IEEE arithmetic, because infinities or NaN may come in.
strict_kernel: Any = _compile(**_STRICT, _nrt=False)

#: A part of kernels that keeps to it.
strict_part: Any = _compile(**_STRICT, _nrt=False, forceinline=True)

#: An index that is not negative: numba does not look whether it counts from the end.
index: Any = np.uint32
