"""A* in C++ (``astar.cpp``), built when it is asked for: by Boost.Graph, and by a binary heap. Both cut no corners."""

import ctypes
import shutil
import subprocess
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Final

from chefbotd.components.navigation.algorithms.grid import Singles

SOURCE: Final = Path(__file__).with_name("astar.cpp")
BOOST: Final = Path("/usr/include/boost/graph/astar_search.hpp")
SEARCHES: Final = {"Boost's A*": "search_by_boost", "a C++ A* by a binary heap": "search_by_heap"}


def missing_packages() -> str | None:
    """The Debian packages without which it cannot be built; None when nothing is missing."""
    missing = [
        package
        for package, is_there in (("g++", shutil.which("g++")), ("libboost-dev", BOOST.is_file()))
        if not is_there
    ]
    return " ".join(missing) or None


@contextmanager
def built_library() -> Iterator[ctypes.CDLL]:
    """The searches, compiled for this processor, as numba compiles ours."""
    with tempfile.TemporaryDirectory(prefix="chefbotd-bench-") as folder:
        library = Path(folder) / "astar.so"
        options = ["-std=c++17", "-O3", "-march=native", "-shared", "-fPIC"]
        subprocess.run(["g++", *options, "-o", library, SOURCE], check=True)
        loaded = ctypes.CDLL(str(library))
        loaded.make_map.restype = ctypes.c_void_p
        loaded.make_map.argtypes = [ctypes.c_void_p, ctypes.c_int64, ctypes.c_int64]
        loaded.free_map.argtypes = [ctypes.c_void_p]
        for name in SEARCHES.values():
            function = getattr(loaded, name)
            function.restype = ctypes.c_double
            function.argtypes = [ctypes.c_void_p, ctypes.c_uint32, ctypes.c_uint32]
        yield loaded


class CompiledSearches:
    """The searches on one grid of costs, which are prepared once. They give the cost of the cheapest path."""

    def __init__(self, library: ctypes.CDLL, costs: Singles) -> None:
        self._library, self._columns = library, costs.shape[1]
        self._map: Any = library.make_map(costs.ctypes.data, *costs.shape)

    def cost(self, name: str, start: tuple[int, int], goal: tuple[int, int]) -> float:
        """The cost between two cells (row, column) by one of ``SEARCHES``; infinite when there is no path."""
        first, last = (row * self._columns + column for row, column in (start, goal))
        return float(getattr(self._library, SEARCHES[name])(self._map, first, last))

    def close(self) -> None:
        """Release the memory."""
        self._library.free_map(self._map)
