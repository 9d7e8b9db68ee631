"""Numba's compiler behind one typed decorator: import this only in what runs in the worker process.

Kernels take and fill arrays. They are compiled at the first call and kept in a cache on disk, beside their source or,
where that may not be written, in the folder that ``NUMBA_CACHE_DIR`` names.
"""

import ctypes
from collections.abc import Callable
from pathlib import Path
from typing import Any, ParamSpec, TypeVar, cast

import numba

P = ParamSpec("P")
R = TypeVar("R")

MADV_DONTNEED = 4
MAPPINGS = Path("/proc/self/maps")


def kernel(function: Callable[P, R]) -> Callable[P, R]:
    """The same function, compiled; no threads and no fast-math, so that the same input gives the same bits."""
    decorate: Any = numba.njit(cache=True, nogil=True, error_model="numpy")
    return cast(Callable[P, R], decorate(function))


def release_compiler() -> int:
    """Give back the memory that the compiler's own code takes; how many bytes that were mapped.

    To be called once everything is compiled or loaded. These 80 MB are pages of a file that are never written: what
    is needed again is read again. Where there is no /proc, nothing happens.
    """
    if not MAPPINGS.exists():
        return 0
    advise = ctypes.CDLL(None).madvise
    advise.argtypes = [ctypes.c_void_p, ctypes.c_size_t, ctypes.c_int]
    released = 0
    for line in MAPPINGS.read_text(encoding="utf-8").splitlines():
        fields = line.split()
        if len(fields) == 6 and fields[1] == "r-xp" and "libllvmlite" in fields[5]:
            begin, end = (int(address, 16) for address in fields[0].split("-"))
            released += end - begin if advise(begin, end - begin, MADV_DONTNEED) == 0 else 0
    return released
