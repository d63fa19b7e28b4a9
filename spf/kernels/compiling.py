"""How kernels are compiled: the numba options, in one place.

Divisions follow IEEE (``error_model="numpy"``): a check for zero would cost a branch each. Functions that allocate no
array neither count references to those that they are given (``_nrt=False``): numba would do it with two atomic
operations an array and call, on counters that all threads share.
"""

from __future__ import annotations

from numba import njit

__all__ = ["allocating", "kernel", "part", "strict_kernel"]

#: A kernel that may allocate arrays.
allocating = njit(cache=True, nogil=True, fastmath=True, error_model="numpy")

#: A kernel that works in the arrays that it is given.
kernel = njit(cache=True, nogil=True, fastmath=True, error_model="numpy", _nrt=False)

#: A part of kernels: compiled into each of them.
part = njit(cache=True, nogil=True, fastmath=True, error_model="numpy", forceinline=True, _nrt=False)

#: A kernel that keeps to IEEE arithmetic, because infinities or NaN may come in.
strict_kernel = njit(cache=True, nogil=True, error_model="numpy", _nrt=False)
