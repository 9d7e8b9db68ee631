"""Odometry as a service."""

import asyncio
import math

import pytest

from chefbotd.bus import Bus
from chefbotd.clock import LoopClock, run_virtual
from chefbotd.core.events import (
    ImuMeasured,
    ImuTrust,
    MotionAnomaly,
    OdometryConditionChanged,
    OdometryUpdated,
    WheelsDriven,
    WheelsMeasured,
)
from chefbotd.core.geometry import CERTAIN, Pose2D
from chefbotd.driving.odometry.service import OdometryService
from chefbotd.motion.kinematics import ChassisParameters
from chefbotd.motion.odometry import OdometryParameters
from chefbotd.sensing.imu import ImuParameters

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


def service_events(source: str, *story: object) -> list[object]:
    """What odometry of this source publishes after these events."""

    async def scenario() -> list[object]:
        bus = Bus()
        inbox = bus.subscribe(OdometryUpdated, OdometryConditionChanged)
        parameters = OdometryParameters.model_validate({"source": source})
        service = OdometryService(bus, LoopClock(), CHASSIS, parameters, ImuParameters())
        task = asyncio.create_task(service.run())
        for event in story:
            bus.publish(event)
        await asyncio.sleep(0)
        task.cancel()
        await asyncio.gather(task, return_exceptions=True)
        return inbox.take_all()

    return run_virtual(scenario())


def test_with_the_imu_a_turn_is_the_gyroscopes() -> None:
    """The wheels say 0.1 rad in a cycle, the gyroscope nothing: the robot goes straight on. The IMU is ok."""
    story: list[object] = []
    for k in range(1, 6):
        stamp_s = k * 0.05
        still = (0.0, 0.0, 0.0)
        story += [
            ImuMeasured(stamp_s=stamp_s, arrival_s=stamp_s, angular_velocity_rad_s=still),
            turned(0.1, 0.3, stamp_s),
        ]
    events = service_events("wheels_imu", *story)
    assert OdometryConditionChanged(stamp_s=0.05, imu=ImuTrust.OK) in events
    last = events[-1]
    assert isinstance(last, OdometryUpdated)
    # the first two cycles have no rate before them: there the wheels count, 0.1 rad each
    assert last.odom_from_base.heading_rad == pytest.approx(0.2, abs=1e-3)
    assert last.twist.angular_rad_s == pytest.approx(0.0, abs=0.02)


def test_by_commands_the_robot_goes_where_it_was_told() -> None:
    """Both wheels told to turn at 2 rad/s (1 m/s at the rim) for 3 s: 3 m, as they stop as slowly as they start."""
    zero, asked = (0.0, 0.0), (2.0, 2.0)
    driven = [WheelsDriven(k * 0.02, zero, zero, asked, (90, 90)) for k in range(151)]
    stopped = [WheelsDriven(3 + k * 0.02, zero, zero, zero, (0, 0)) for k in range(1, 101)]
    events = service_events("commands", *driven, *stopped)
    last = events[-1]
    assert isinstance(last, OdometryUpdated)
    assert last.odom_from_base.x_m == pytest.approx(3.0, abs=0.05)
    assert last.twist.linear_m_s == pytest.approx(0.0, abs=1e-6)
    assert last.covariance.xx == pytest.approx(0.1**2 * 3.0 / 2, rel=0.1)


def test_a_wheel_that_disagrees_with_the_imu_is_published() -> None:
    """A wheel that shows 1 m/s, of a robot that goes straight on by its gyroscope, slips: said in the odometry."""
    story: list[object] = []
    for k in range(1, 12):
        stamp_s = k * 0.05
        story += [
            ImuMeasured(stamp_s=stamp_s, arrival_s=stamp_s, angular_velocity_rad_s=(0.0, 0.0, 0.0)),
            turned(0.1, 0.1 if k < 6 else 0.2, stamp_s),
        ]
    events = service_events("wheels_imu", *story)
    conditions = [event.anomaly for event in events if isinstance(event, OdometryConditionChanged)]
    assert conditions[-1] is MotionAnomaly.SLIP
