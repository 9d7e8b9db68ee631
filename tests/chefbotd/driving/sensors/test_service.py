"""Raw readings become SI readings on the bus."""

import asyncio
import math

import pytest

from chefbotd.bus import Bus
from chefbotd.clock import run_virtual
from chefbotd.core import events
from chefbotd.driving.sensors.service import SensorService
from chefbotd.sensing.battery import BatteryParameters
from chefbotd.sensing.imu import ImuParameters
from chefbotd.sensing.infrared import InfraredParameters
from chefbotd.sensing.ultrasonic import UltrasonicParameters


def interpreted(*raw: object, bare: bool = False, first: tuple[object, ...] = ()) -> list[object]:
    """What the service publishes for raw readings: a 3.3 V reference behind a divider by 5. ``first`` is taken before.

    A ``bare`` robot has nothing but its battery; the other one has infrared sensors on inputs 0 and 3.
    """
    infrared = (
        InfraredParameters(name="left", channel=0, setback_m=0.1, median_window=1),
        InfraredParameters(name="right", channel=3, setback_m=0.1, median_window=1),
    )

    async def scenario() -> list[object]:
        bus = Bus()
        inbox = bus.subscribe(events.RangeMeasured, events.ImuMeasured, events.BatteryMeasured, size=2000)
        service = SensorService(
            bus,
            ultrasonic_parameters=None if bare else UltrasonicParameters(name="front"),
            infrared_parameters=() if bare else infrared,
            imu_parameters=None if bare else ImuParameters(),
            battery_parameters=BatteryParameters(
                reference_v=3.3, divider_ratio=5.0, full_v=12.9, empty_v=11.4, hysteresis_v=0.1
            ),
        )
        task = asyncio.create_task(service.run())
        for events_at_once in (first, raw):
            for event in events_at_once:
                bus.publish(event)
            for _ in range(len(events_at_once) + 1):
                await asyncio.sleep(0)
        task.cancel()
        await asyncio.gather(task, return_exceptions=True)
        return [inbox.take_event() for _ in range(len(inbox))]

    return run_virtual(scenario())


def test_every_raw_reading_has_its_interpretation():
    """An echo, a quaternion, raw counts and a battery level: four events, in order, with the raw stamps."""
    distance, orientation, inertia, battery = interpreted(
        events.UltrasonicEchoed(1.0, 1.0, 150),
        events.OrientationReported(2.0, 2.0, 0.0, 0.0, 0.71, 0.71),
        events.InertialCounted(3.0, 3.0, (0, 0, 16384), (0, 0, 131)),
        events.BatteryCounted(4.0, 4.0, 3000.0),
    )
    assert (distance.stamp_s, distance.range_m) == (1.0, 1.5)
    assert (orientation.stamp_s, orientation.heading_rad) == (2.0, pytest.approx(math.pi / 2))
    assert inertia.linear_acceleration_m_s2 == pytest.approx((0, 0, 9.80665))
    assert inertia.angular_velocity_rad_s == pytest.approx((0, 0, math.radians(1)))
    assert (battery.stamp_s, battery.voltage_v) == (4.0, pytest.approx(3000 / 4095 * 16.5))


def test_the_battery_remembers_how_bad_it_was():
    """11.94 V is low; 12.05 V is still low (hysteresis 0.1 V); 12.15 V is well again."""
    counts = [volts / 16.5 * 4095 for volts in (12.3, 11.94, 12.05, 12.15)]
    levels = interpreted(*(events.BatteryCounted(0.0, 0.0, adc) for adc in counts))
    assert [str(event.status) for event in levels] == ["ok", "low", "low", "ok"]


def test_each_infrared_sensor_has_its_input_and_its_past():
    """1.25 V are 0.5 m, on whichever input; what was too near on one makes nothing ambiguous on the other."""
    near, far = 2.74 / 3.3 * 4095, 1.25 / 3.3 * 4095
    events_ = [events.AnalogueCounted(1.0, 1.0, 0, near), events.AnalogueCounted(1.1, 1.1, 3, far)]
    left, right = interpreted(*events_)
    assert (left.sensor, str(left.status), left.range_m) == ("left", "too_near", None)
    assert (right.sensor, right.stamp_s, right.range_m) == ("right", 1.1, pytest.approx(0.5))


def test_an_input_without_a_sensor_is_left_alone():
    """Nothing is configured on input 7."""
    assert interpreted(events.AnalogueCounted(1.0, 1.0, 7, 2000.0)) == []


def test_a_robot_without_sensors_interprets_its_battery():
    """What its board sends of others has no meaning for it."""
    raw = (
        events.UltrasonicEchoed(1.0, 1.0, 150),
        events.AnalogueCounted(1.0, 1.0, 0, 2000.0),
        events.OrientationReported(2.0, 2.0, 0.0, 0.0, 0.71, 0.71),
        events.BatteryCounted(4.0, 4.0, 3000.0),
    )
    (battery,) = interpreted(*raw, bare=True)
    assert battery.stamp_s == 4.0


INTERRUPTIONS = pytest.mark.parametrize(
    "interruption",
    [events.BoardRestarted(1.05, "reset"), events.LinkClosed(1.05, "/dev/ttyACM0", "unplugged")],
    ids=["board restarted", "link lost"],
)


@INTERRUPTIONS
def test_who_was_away_believes_no_near_range_until_a_far_one(interruption: object):
    """2.02 V, 0.297 m, are a number after 1.98 V; not after an interruption, until 0.5 m end the doubt."""
    levels = [volts / 3.3 * 4095 for volts in (1.98, 2.02, 2.02, 2.02, 1.25)]
    far, near, same, again, gone = (
        events.AnalogueCounted(1.0 + 0.02 * k, 1.0 + 0.02 * k, 0, level) for k, level in enumerate(levels)
    )
    seen = interpreted(far, near, same, interruption, again, gone)
    assert [str(one.status) for one in seen] == ["ok", "ok", "ok", "ambiguous", "ok"]


@INTERRUPTIONS
def test_no_flood_of_readings_hides_an_interruption(interruption: object):
    """A thousand echoes after it, before the service has a turn: 2.02 V after 1.98 V are still not believed."""
    far, near = (
        events.AnalogueCounted(at_s, at_s, 0, volts / 3.3 * 4095)
        for at_s, volts in ((1.0, 1.98), (1.02, 2.02))
    )
    flood = [events.UltrasonicEchoed(1.01, 1.01, 150)] * 1000
    seen = interpreted(interruption, *flood, near, first=(far,))
    assert [str(one.status) for one in seen if one.sensor == "left"] == ["ok", "ambiguous"]
