"""The worker's cost: localization is ready before its first scan."""

import subprocess
import sys

import pytest

WORKER = """
import numpy as np
from chefbotd.components.localization.algorithms.warm import warm
warm()
from chefbotd.components.localization.algorithms import agreement as a
from chefbotd.components.localization.algorithms import branch_and_bound as b
from chefbotd.components.localization.algorithms import surface_map as s
from chefbotd.components.localization.algorithms import tracking as t
from chefbotd.components.mapping.algorithms import correlate as c
from chefbotd.components.mapping.algorithms import refine as r
from chefbotd.components.mapping.algorithms import surfaces as n
from tests.chefbotd.components.localization.algorithms.buildings import Robot, drawn
from chefbotd.components.localization.algorithms.searching import localization_map
from tests.chefbotd.components.mapping.algorithms.slam.flat import TOUR, Lidar, furnished_flat, odometry, poses_along
kernels = [
    a._agreement, b.bound, b.divide, b._smear_likelihood, s._lines, s._fill, t._fuse,
    c._advance, c._pool, r._polish, n._normals,
]
before = [len(each.signatures) for each in kernels]
truth, walls = poses_along(TOUR)[:80], furnished_flat()
lidar, robot = Lidar(walls, 1), Robot(localization_map(drawn(walls)))
for told, pose in zip(odometry(truth, 1), truth):
    robot.take(told, lidar.points(pose))
for k in range(30):
    robot.take(told, lidar.points(truth[0]))
print(robot.reports[79].state, before == [1] * 11, [len(each.signatures) for each in kernels] == before)
"""


@pytest.mark.slow
def test_nothing_is_compiled_during_a_drive() -> None:
    """After ``warm``, a search, a drive and a kidnapping find everything compiled."""
    told = subprocess.run(
        [sys.executable, "-c", WORKER], check=True, capture_output=True, text=True, timeout=110
    )
    assert told.stdout.split() == ["localized", "True", "True"]
