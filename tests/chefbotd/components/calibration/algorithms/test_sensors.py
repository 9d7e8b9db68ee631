"""The offset of an ultrasonic sensor against a lidar in a square room whose walls are 1 m away."""

import math

import numpy as np
import pytest

from chefbotd.components.calibration.algorithms.sensors import SENSORS
from chefbotd.components.calibration.algorithms.step import Measurements, Status
from chefbotd.components.simulation.world import RayCaster
from chefbotd.core.events import RangeMeasured, RangeStatus
from chefbotd.core.record import replace
from tests.chefbotd.components.calibration.algorithms.synthetic import MIDDLE, Truth, World, configured
from tests.chefbotd.components.mapping.algorithms.slam.flat import box

ROBOT = configured()
WALLS = box(MIDDLE[0] - 1.0, MIDDLE[1] - 1.0, 2.0, 2.0)
SENSOR_X_M = 0.15


@pytest.fixture(scope="module")
def drive() -> Measurements:
    """What the lidar sees while the robot turns in steps."""
    lidar = ROBOT.lidars[0]
    truth = Truth(mount=(lidar.mount_x_m, lidar.mount_y_m, lidar.mount_yaw_rad), slip=0.0)
    world = World(ROBOT, truth, walls=WALLS)
    measured = world.perform(SENSORS.procedure(ROBOT))
    return replace(measured, ranges=tuple(_ranges(world)))


def _ranges(world: World, offset_m: float = 0.02) -> list[RangeMeasured]:
    """The sensor: the nearest wall in its cone, 2 cm too far."""
    caster, ranges = RayCaster(WALLS, 12.0), []
    for at_s, x, y, heading in world.trail[::2]:
        cone = heading + np.linspace(-0.13, 0.13, 27)
        origin = np.array([[x + SENSOR_X_M * math.cos(heading), y + SENSOR_X_M * math.sin(heading)]])
        nearest_m = float(caster.cast(np.repeat(origin, 27, axis=0), cone).range_m.min())
        ranges.append(
            RangeMeasured(at_s, at_s, "front", RangeStatus.OK, nearest_m + offset_m, 0.02, 4.0, 0.26)
        )
    return ranges


def test_the_offset_is_recovered(drive: Measurements) -> None:
    """2 cm, to 4 mm and three standard deviations."""
    result = SENSORS.fit(ROBOT, drive)
    assert result.status is Status.PASSED, result.reason
    (estimate,) = result.estimates
    assert estimate.key == "ultrasonic.offset_m"
    assert estimate.after == pytest.approx(0.02, abs=4e-3)
    assert abs(estimate.after - 0.02) < 3 * estimate.sigma


def test_it_adds_to_the_offset_that_is_configured(drive: Measurements) -> None:
    """Readings that are corrected by 1 cm already and still 2 cm too far: 3 cm."""
    assert ROBOT.ultrasonic is not None
    robot = replace(ROBOT, ultrasonic=ROBOT.ultrasonic.model_copy(update={"offset_m": 0.01}))
    assert SENSORS.fit(robot, drive).estimates[0].after == pytest.approx(0.03, abs=4e-3)


def test_a_few_readings_of_something_else_do_not_count(drive: Measurements) -> None:
    """A chair leg below the lidar, in a quarter of the places."""
    ranges = tuple(
        replace(one, range_m=0.4) if k < len(drive.ranges) / 4 else one for k, one in enumerate(drive.ranges)
    )
    result = SENSORS.fit(ROBOT, replace(drive, ranges=ranges))
    assert result.estimates[0].after == pytest.approx(0.02, abs=4e-3)


def test_what_is_missing_is_named(drive: Measurements) -> None:
    """No echo, no scans, no readings of the wheels."""
    for lacking, reason in (
        (replace(drive, ranges=()), "front: 0 of 4 places"),
        (replace(drive, scans=()), "front: 0 of 4 places"),
        (replace(drive, wheels=()), "no readings of the wheels"),
    ):
        result = SENSORS.fit(ROBOT, lacking)
        assert (result.status, result.estimates) == (Status.NOT_ENOUGH, ())
        assert reason in result.reason


def test_a_sensor_that_is_far_off_is_refused(drive: Measurements) -> None:
    """Half a metre is no offset."""
    ranges = tuple(replace(one, range_m=(one.range_m or 0.0) + 0.5) for one in drive.ranges)
    assert SENSORS.fit(ROBOT, replace(drive, ranges=ranges)).status is Status.REFUSED
