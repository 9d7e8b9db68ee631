"""Raw readings in, SI readings out."""

from collections.abc import Callable
from typing import Any

from chefbotd.bus import Bus, Inbox
from chefbotd.core.events import (
    BatteryCounted,
    InertialCounted,
    OrientationReported,
    UltrasonicEchoed,
)
from chefbotd.sensing import battery, imu, ultrasonic
from chefbotd.sensing.battery import BatteryParameters
from chefbotd.sensing.imu import ImuParameters
from chefbotd.sensing.ultrasonic import UltrasonicParameters


class SensorService:
    """Interprets every raw reading of the board's sensors."""

    def __init__(
        self,
        bus: Bus,
        *,
        ultrasonic_parameters: UltrasonicParameters,
        imu_parameters: ImuParameters,
        battery_parameters: BatteryParameters,
    ) -> None:
        self._bus = bus
        self._ultrasonic, self._imu, self._battery = ultrasonic_parameters, imu_parameters, battery_parameters
        self._battery_state = battery.START
        self._interpret: dict[type[Any], Callable[[Any], object]] = {
            UltrasonicEchoed: self._range,
            OrientationReported: self._orientation,
            InertialCounted: self._inertial,
            BatteryCounted: self._charge,
        }
        self._inbox: Inbox[Any] = bus.subscribe(*self._interpret)

    async def run(self) -> None:
        """Interpret until cancelled."""
        async for event in self._inbox:
            self._bus.publish(self._interpret[type(event)](event))

    def _range(self, event: UltrasonicEchoed) -> object:
        return ultrasonic.interpret(self._ultrasonic, event.stamp_s, event.distance_cm)

    def _orientation(self, event: OrientationReported) -> object:
        return imu.from_quaternion(self._imu, event.stamp_s, event.x, event.y, event.z, event.w)

    def _inertial(self, event: InertialCounted) -> object:
        return imu.from_counts(self._imu, event.stamp_s, event.acceleration, event.angular_rate)

    def _charge(self, event: BatteryCounted) -> object:
        self._battery_state, measured = battery.measure(
            self._battery, self._battery_state, event.stamp_s, event.adc
        )
        return measured
