"""The worker's cost: SLAM is ready before its first scan, and fits into the memory that it may take."""

import subprocess
import sys
from pathlib import Path

import pytest

from chefbotd.components.worker.compiled import _unwritten, release_libraries
from tests.waiting import PATIENCE_S

WORKER = """
import numpy as np
from chefbotd.components.mapping.algorithms.warm import warm
warm()
from chefbotd.components.worker.compiled import kernel
from chefbotd.components.mapping.algorithms import correlate as c
from chefbotd.components.mapping.algorithms import refine as r
from chefbotd.components.mapping.algorithms import local_map as l
from chefbotd.components.mapping.algorithms import surfaces as s
from chefbotd.components.mapping.algorithms import occupancy as o
from tests.chefbotd.components.mapping.algorithms.slam.drives import drive, off_m
from tests.chefbotd.components.mapping.algorithms.slam.flat import TOUR, Lidar, furnished_flat, odometry, poses_along
kernels = [c._advance, c._pool, r._polish, l._fill, s._normals, o.trace]
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
    """Nothing is compiled during a drive after ``warm``, and the process takes less than 120 MB."""
    command = [sys.executable, "-c", WORKER]
    subprocess.run(command, check=True, capture_output=True, timeout=110)  # fills the cache
    told = subprocess.run(
        command, check=True, capture_output=True, text=True, timeout=PATIENCE_S
    ).stdout.splitlines()
    assert told[0] == str([1] * 6) + " " + str([1] * 6)
    assert int(told[1]) < 120_000


SMAPS = """
7f0000000000-7f0000003000 r-xp 00000000 08:01 11 /usr/lib/libone.so.1
Rss:                  12 kB
Anonymous:             0 kB
7f0000003000-7f0000005000 r--p 00003000 08:01 11 /usr/lib/libone.so.1
Rss:                   8 kB
Anonymous:             4 kB
7f0000005000-7f0000006000 rw-p 00005000 08:01 11 /usr/lib/libone.so.1
Rss:                   4 kB
Anonymous:             0 kB
7f0000006000-7f0000008000 r--p 00000000 08:01 12 /usr/lib/python3/two.so
Rss:                   4 kB
Anonymous:             0 kB
7f0000008000-7f0000009000 r--s 00000000 08:01 13 /usr/lib/three.so
Rss:                   4 kB
Anonymous:             0 kB
7f0000009000-7f000000a000 r--p 00000000 00:00 0
Rss:                   4 kB
Anonymous:             0 kB
7f000000a000-7f000000b000 r--p 00000000 08:01 14 /usr/share/data.bin
Rss:                   4 kB
Anonymous:             0 kB
""".strip()


def test_only_what_can_be_read_again_is_released() -> None:
    """Not what the loader wrote (relocations), what may be written, what is shared, or what is of no library."""
    assert list(_unwritten(SMAPS)) == [
        (0x7F0000000000, 0x7F0000003000, 12288),
        (0x7F0000006000, 0x7F0000008000, 4096),
    ]


def test_what_is_released_is_read_again() -> None:
    """Kernels go on working, and so does the compiler."""
    if release_libraries():
        assert release_libraries() > 1_000_000
    from chefbotd.components.worker.compiled import kernel

    @kernel
    def doubled(number: float) -> float:
        return 2 * number

    assert doubled(2.5) == 5.0
