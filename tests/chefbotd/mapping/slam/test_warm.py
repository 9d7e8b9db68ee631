"""The worker's cost: SLAM is ready before its first scan, and fits into the memory that it may take."""

import subprocess
import sys
from pathlib import Path

import pytest

from chefbotd.core.compiled import release_compiler

WORKER = """
import numpy as np
from chefbotd.mapping.warm import warm
warm()
from chefbotd.core.compiled import kernel
import chefbotd.mapping.correlate as c, chefbotd.mapping.refine as r, chefbotd.mapping.local_map as l
import chefbotd.mapping.surfaces as s, chefbotd.mapping.occupancy as o
from tests.chefbotd.mapping.slam.drives import drive, off_m
from tests.chefbotd.mapping.slam.flat import TOUR, Lidar, furnished_flat, odometry, poses_along
kernels = [c._search, c._pool, r._polish, l._fill, s._normals, o.trace]
before = [len(each.signatures) for each in kernels]
truth = poses_along(TOUR)[:300]
lidar = Lidar(furnished_flat(), 1)
found = drive(odometry(truth, 1), lambda k: lidar.points(truth[k]))
assert off_m(found.poses(), truth).max() < 0.05
print(before, [len(each.signatures) for each in kernels])
print(next(line for line in open('/proc/self/status') if line.startswith('VmRSS')).split()[1])
"""


@pytest.mark.skipif(not Path("/proc/self/status").exists(), reason="memory is told by /proc")
@pytest.mark.slow
def test_a_worker_is_warm_and_small() -> None:
    """Nothing is compiled during a drive after ``warm``, and the process takes less than 150 MB."""
    command = [sys.executable, "-c", WORKER]
    subprocess.run(command, check=True, capture_output=True, timeout=110)  # fills the cache
    told = subprocess.run(command, check=True, capture_output=True, text=True, timeout=60).stdout.splitlines()
    assert told[0] == str([1] * 6) + " " + str([1] * 6)
    assert int(told[1]) < 150_000


def test_what_is_released_is_read_again() -> None:
    """Kernels go on working, and so does the compiler."""
    if release_compiler():
        assert release_compiler() > 1_000_000
    from chefbotd.core.compiled import kernel

    @kernel
    def doubled(number: float) -> float:
        return 2 * number

    assert doubled(2.5) == 5.0
