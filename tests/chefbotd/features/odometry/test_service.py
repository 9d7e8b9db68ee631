"""Odometry as a service."""

import asyncio
import math

import pytest

from chefbotd.bus import Bus
from chefbotd.clock import LoopClock, run_virtual
from chefbotd.core.events import OdometryUpdated, WheelsMeasured
from chefbotd.core.geometry import CERTAIN, Pose2D
from chefbotd.features.odometry.service import OdometryService
from chefbotd.motion.kinematics import ChassisParameters
from chefbotd.motion.odometry import OdometryParameters

CHASSIS = ChassisParameters.model_validate(
    {
        "track_width_m": 1.0,
        "wheels": [
            {"name": "left", "side": "left", "radius_m": 0.5},
            {"name": "right", "side": "right", "radius_m": 0.5},
        ],
    }
)


def turned(left_rad: float, right_rad: float, stamp_s: float = 1.0) -> WheelsMeasured:
    """Both wheels travelled so far, at so many rad/s."""
    return WheelsMeasured(
        stamp_s, stamp_s + 0.003, stamp_s, (0.0, 0.0), (left_rad, right_rad), (left_rad, right_rad)
    )


def poses(*story: WheelsMeasured | Pose2D) -> list[OdometryUpdated]:
    """Feed measurements and pose resets in order; everything published."""

    async def scenario() -> list[OdometryUpdated]:
        bus = Bus()
        updates = bus.subscribe(OdometryUpdated)
        service = OdometryService(bus, LoopClock(), CHASSIS, OdometryParameters())
        task = asyncio.create_task(service.run())
        for step in story:
            if isinstance(step, Pose2D):
                service.set_pose(step)
            else:
                bus.publish(step)
        await asyncio.sleep(0)
        await asyncio.sleep(0)
        task.cancel()
        await asyncio.gather(task, return_exceptions=True)
        return [updates.take_event() for _ in range(len(updates))]

    return run_virtual(scenario())


def test_a_quarter_turn_about_the_standing_left_wheel():
    """Track 1 m, left still, right rolls pi/2 m (pi rad at 0.5 m): the pose is (0.5, 0.5, 90 degrees)."""
    (update,) = poses(turned(0.0, math.pi))
    assert (update.stamp_s, update.arrival_s) == (1.0, 1.003)
    assert (update.odom_from_base.x_m, update.odom_from_base.y_m) == pytest.approx((0.5, 0.5))
    assert update.odom_from_base.heading_rad == pytest.approx(math.pi / 2)
    assert (update.twist.linear_m_s, update.twist.angular_rad_s) == pytest.approx((math.pi / 4, math.pi / 2))
    assert update.stamp_s == 1.0


def test_setting_the_pose_takes_effect_after_all_that_was_measured_before():
    """A metre measured before the reset does not move the new pose; a metre after it does."""
    updates = poses(turned(2.0, 2.0), Pose2D(5.0, 5.0, math.pi / 2), turned(2.0, 2.0))
    last = updates[-1].odom_from_base
    assert (last.x_m, last.y_m) == pytest.approx((5.0, 6.0))
    assert updates[1].odom_from_base == Pose2D(5.0, 5.0, math.pi / 2)
    assert updates[1].covariance == CERTAIN


def test_wheels_left_out_do_not_move_the_robot():
    """Four wheels of which one a side is left out: the others' 1 rad on 0.5 m are half a metre, at 0.5 m/s."""

    async def scenario() -> OdometryUpdated:
        bus = Bus()
        updates = bus.subscribe(OdometryUpdated)
        wheels = (*CHASSIS.wheels, *(w.model_copy(update={"name": f"rear_{w.name}"}) for w in CHASSIS.wheels))
        chassis = CHASSIS.model_copy(update={"wheels": wheels})
        service = OdometryService(bus, LoopClock(), chassis, OdometryParameters())
        task = asyncio.create_task(service.run())
        turned = (1.0, 7.0, 0.0, 1.0)
        bus.publish(WheelsMeasured(1.0, 1.0, 1.0, turned, turned, turned, excluded=(1, 2)))
        await asyncio.sleep(0)
        await asyncio.sleep(0)
        task.cancel()
        await asyncio.gather(task, return_exceptions=True)
        return updates.take_event()

    update = run_virtual(scenario())
    assert (update.odom_from_base.x_m, update.odom_from_base.heading_rad) == (0.5, 0.0)
    assert update.twist.linear_m_s == 0.5
