"""Converts raw sensor readings to SI units."""

from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

from chefbotd.bus import Bus, HandlerFailure
from chefbotd.core.events import (
    AnalogueCounted,
    BatteryCounted,
    BatteryMeasured,
    BoardRestarted,
    InertialCounted,
    LinkClosed,
    OrientationReported,
    RangeMeasured,
    UltrasonicEchoed,
)
from chefbotd.core.record import Record
from chefbotd.driving.sensors.models import TOPICS
from chefbotd.features.feature import Feature, Service
from chefbotd.metrics import Metrics
from chefbotd.sensing import battery, imu, infrared, ultrasonic
from chefbotd.sensing.battery import BatteryParameters, BatteryState
from chefbotd.sensing.imu import ImuParameters
from chefbotd.sensing.infrared import InfraredParameters, InfraredState
from chefbotd.sensing.ultrasonic import UltrasonicParameters


class SensorState(Record, frozen=True):
    """The last readings of the battery, and of the infrared sensors by channel."""

    battery: BatteryState
    measured: BatteryMeasured | None
    infrared: dict[int, InfraredState]


class SensorService:
    """Interprets the raw readings of the configured sensors; others are ignored."""

    def __init__(
        self,
        bus: Bus,
        *,
        ultrasonic_parameters: UltrasonicParameters | None,
        imu_parameters: ImuParameters | None,
        battery_parameters: BatteryParameters | None,
        infrared_parameters: Sequence[InfraredParameters] = (),
    ) -> None:
        self._bus, self._battery_state = bus, battery.START
        self._infrared = {sensor.channel: (sensor, infrared.START) for sensor in infrared_parameters}
        self._interpret: dict[type[Any], Callable[[Any], object | None]] = {}
        if battery_parameters is not None:
            self._interpret[BatteryCounted] = partial(self._charge, battery_parameters)
        if ultrasonic_parameters is not None:
            self._interpret[UltrasonicEchoed] = partial(ultrasonic.interpret, ultrasonic_parameters)
        interruptions = (BoardRestarted, LinkClosed) if infrared_parameters else ()
        if infrared_parameters:
            self._interpret |= {
                AnalogueCounted: self._infrared_range,
                **dict.fromkeys(interruptions, self._forget),
            }
        if imu_parameters is not None:
            self._interpret[OrientationReported] = partial(imu.from_quaternion, imu_parameters)
            self._interpret[InertialCounted] = partial(imu.from_counts, imu_parameters)
        self.battery: BatteryMeasured | None = None
        self._failure = HandlerFailure()
        if self._interpret:
            bus.add_handler(self._on_reading, *self._interpret, on_error=self._failure.report)

    def state(self) -> SensorState:
        """Return the state of this part."""
        seen = {channel: state for channel, (_, state) in self._infrared.items()}
        return SensorState(self._battery_state, self.battery, seen)

    def restore(self, state: SensorState) -> None:
        """Restore this state."""
        self._battery_state, self.battery = state.battery, state.measured
        self._infrared = {
            channel: (sensor, state.infrared.get(channel, infrared.START))
            for channel, (sensor, _) in self._infrared.items()
        }

    async def run(self) -> None:
        """Raise the error of a reading that could not be interpreted; readings are interpreted as they are published."""
        await self._failure.wait()

    def _on_reading(self, event: Any) -> None:
        measured = self._interpret[type(event)](event)
        if measured is not None:
            self._bus.publish(measured)

    def _infrared_range(self, event: AnalogueCounted) -> RangeMeasured | None:
        """The reading of an analogue input; None if no sensor is configured on it."""
        if event.channel not in self._infrared:
            return None
        sensor, state = self._infrared[event.channel]
        state, measured = infrared.interpret(sensor, state, event)
        self._infrared[event.channel] = (sensor, state)
        return measured

    def _forget(self, event: BoardRestarted | LinkClosed) -> None:
        """Forget the readings: something may have moved in front of the sensors meanwhile."""
        self._infrared = {
            channel: (sensor, infrared.START) for channel, (sensor, _) in self._infrared.items()
        }

    def _charge(self, parameters: BatteryParameters, event: BatteryCounted) -> BatteryMeasured:
        self._battery_state, self.battery = battery.measure(parameters, self._battery_state, event)
        return self.battery


def sensors(service: SensorService) -> Feature:
    """The feature for sensor readings in SI units."""

    def add_metrics(metrics: Metrics) -> None:
        metrics.optional_gauge(
            "battery_v",
            "The battery's voltage.",
            lambda: None if service.battery is None else service.battery.voltage_v,
        )
        metrics.optional_gauge(
            "battery_percentage",
            "The remaining charge of the battery.",
            lambda: None if service.battery is None else service.battery.percentage,
        )

    return Feature(
        "sensors",
        services=(Service("sensors", service.run),),
        topics=TOPICS,
        add_metrics=add_metrics,
        parts={"sensors": service},
    )
