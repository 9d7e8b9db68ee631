"""Numba's compiler behind one typed decorator: import this only in what runs in the worker process.

Kernels take and fill arrays, allocate nothing that outlives them, and are compiled at the first call and
kept in a cache on disk. ``NUMBA_CACHE_DIR`` names the folder where the sources may not be written.
"""

from collections.abc import Callable
from typing import Any, ParamSpec, TypeVar, cast

import numba

P = ParamSpec("P")
R = TypeVar("R")


def kernel(function: Callable[P, R]) -> Callable[P, R]:
    """The same function, compiled; no threads and no fast-math, so that the same input gives the same bits."""
    decorate: Any = numba.njit(cache=True, nogil=True, error_model="numpy")
    return cast(Callable[P, R], decorate(function))
