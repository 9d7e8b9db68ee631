"""Numba's compiler behind one typed decorator. Import this only in code that runs in the worker process.

Kernels take and fill arrays. Arrays that belong together are a ``NamedTuple``: numba knows no records. Kernels are
compiled at the first call and kept in a cache on disk, beside their source or, where that may not be written, in the
folder that ``NUMBA_CACHE_DIR`` names.
"""

import ctypes
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, ParamSpec, TypeVar, cast

import numba

P = ParamSpec("P")
R = TypeVar("R")

MADV_DONTNEED = 4
MAPPINGS = Path("/proc/self/smaps")

_kernels: list[Any] = []


def kernel(function: Callable[P, R]) -> Callable[P, R]:
    """The same function, compiled; no threads and no fast-math, so that the same input gives the same bits."""
    decorate: Any = numba.njit(cache=True, nogil=True, error_model="numpy")
    compiled = decorate(function)
    _kernels.append(compiled)
    return cast(Callable[P, R], compiled)


def has_compiled() -> bool:
    """Whether this process compiled a kernel that was not in the cache, which keeps 150 MB in memory."""
    return any(kernel_function.stats.cache_misses for kernel_function in _kernels)


def release_libraries() -> int:
    """Release the memory of library code (mostly the compiler's), and return the number of bytes.

    Call it once everything is compiled or loaded. The released pages, 60 MB with a compiler, were never written to, so
    the kernel reads them from the file when they are needed. Without /proc nothing happens.
    """
    if not MAPPINGS.exists():
        return 0
    advise = ctypes.CDLL(None).madvise
    advise.argtypes = [ctypes.c_void_p, ctypes.c_size_t, ctypes.c_int]
    return sum(
        resident
        for begin, end, resident in list(_unwritten(MAPPINGS.read_text(encoding="utf-8")))
        if advise(begin, end - begin, MADV_DONTNEED) == 0
    )


def _unwritten(smaps: str) -> Iterator[tuple[int, int, int]]:
    """Begin, end and resident bytes of each private, read-only and unmodified mapping of a library.

    ``smaps`` is the text of proc(5)'s file. A page that the loader modified counts as anonymous and stays.
    """
    begin, end, resident, is_library = 0, 0, 0, False
    for line in smaps.splitlines():
        name, *fields = line.split()
        if not name.endswith(":"):
            begin, end = (int(address, 16) for address in name.split("-"))
            is_library = fields[0] in ("r-xp", "r--p") and len(fields) == 5 and ".so" in fields[4]
        elif name == "Rss:":
            resident = 1024 * int(fields[0])
        elif name == "Anonymous:" and is_library and resident and fields[0] == "0":
            yield begin, end, resident
