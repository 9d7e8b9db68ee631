"""Scan matching needs the extra ``navigation``; without it, the tests of what it compiles are left out."""

import importlib.util

collect_ignore_glob = (
    [] if importlib.util.find_spec("numba") and importlib.util.find_spec("scipy") else ["lidar/*"]
)
