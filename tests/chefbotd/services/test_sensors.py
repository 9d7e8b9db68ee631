"""Raw readings become SI readings on the bus."""

import asyncio
import math

import pytest

from chefbotd.bus import Bus
from chefbotd.clock import run_virtual
from chefbotd.core import events
from chefbotd.sensing.battery import BatteryParameters
from chefbotd.sensing.imu import ImuParameters
from chefbotd.sensing.ultrasonic import UltrasonicParameters
from chefbotd.services.sensors import SensorService


def interpreted(*raw: object) -> list[object]:
    """What the service publishes for raw readings: a 3.3 V reference behind a divider by 5."""

    async def scenario() -> list[object]:
        bus = Bus()
        inbox = bus.subscribe(events.RangeMeasured, events.ImuMeasured, events.BatteryMeasured)
        service = SensorService(
            bus,
            ultrasonic_parameters=UltrasonicParameters(name="front"),
            imu_parameters=ImuParameters(),
            battery_parameters=BatteryParameters(
                reference_v=3.3, divider_ratio=5.0, full_v=12.9, empty_v=11.4, hysteresis_v=0.1
            ),
        )
        task = asyncio.create_task(service.run())
        for event in raw:
            bus.publish(event)
        for _ in range(len(raw) + 1):
            await asyncio.sleep(0)
        task.cancel()
        await asyncio.gather(task, return_exceptions=True)
        return [inbox.take() for _ in range(len(inbox))]

    return run_virtual(scenario())


def test_every_raw_reading_has_its_interpretation():
    """An echo, a quaternion, raw counts and a battery level: four events, in order, with the raw stamps."""
    distance, orientation, inertia, battery = interpreted(
        events.UltrasonicEchoed(1.0, 150),
        events.OrientationReported(2.0, 0.0, 0.0, 0.71, 0.71),
        events.InertialCounted(3.0, (0, 0, 16384), (0, 0, 131)),
        events.BatteryCounted(4.0, 3000.0),
    )
    assert (distance.stamp_s, distance.range_m) == (1.0, 1.5)
    assert (orientation.stamp_s, orientation.heading_rad) == (2.0, pytest.approx(math.pi / 2))
    assert inertia.linear_acceleration_m_s2 == pytest.approx((0, 0, 9.80665))
    assert inertia.angular_velocity_rad_s == pytest.approx((0, 0, math.radians(1)))
    assert (battery.stamp_s, battery.voltage_v) == (4.0, pytest.approx(3000 / 4095 * 16.5))


def test_the_battery_remembers_how_bad_it_was():
    """11.94 V is low; 12.05 V is still low (hysteresis 0.1 V); 12.15 V is well again."""
    counts = [volts / 16.5 * 4095 for volts in (12.3, 11.94, 12.05, 12.15)]
    levels = interpreted(*(events.BatteryCounted(0.0, adc) for adc in counts))
    assert [str(event.status) for event in levels] == ["ok", "low", "low", "ok"]
