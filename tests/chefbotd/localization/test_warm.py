"""The worker's cost: localization is ready before its first scan."""

import subprocess
import sys

import pytest

WORKER = """
import numpy as np
from chefbotd.localization.warm import warm
warm()
import chefbotd.localization.agreement as a, chefbotd.localization.branch_and_bound as b
import chefbotd.localization.surface_map as s, chefbotd.localization.tracking as t
import chefbotd.mapping.correlate as c, chefbotd.mapping.refine as r, chefbotd.mapping.surfaces as n
from tests.chefbotd.localization.buildings import Robot, drawn
from chefbotd.localization.searching import localization_map
from tests.chefbotd.mapping.slam.flat import TOUR, Lidar, furnished_flat, odometry, poses_along
kernels = [
    a._agreement, b.bound, b.divide, b._smeared, s._lines, s._fill, t._fuse, c._advance, c._pool, r._polish, n._normals
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
