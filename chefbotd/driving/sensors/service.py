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
from chefbotd.core.record import MutableState, StatefulPart
from chefbotd.driving.sensors.models import TOPICS
from chefbotd.features.feature import Feature, Service
from chefbotd.metrics import Metrics
from chefbotd.sensing import battery, imu, infrared, ultrasonic
from chefbotd.sensing.battery import BatteryParameters, BatteryState
from chefbotd.sensing.imu import ImuParameters
from chefbotd.sensing.infrared import InfraredParameters, InfraredState
from chefbotd.sensing.ultrasonic import UltrasonicParameters


class SensorState(MutableState):
    """The last readings of the battery, and of the infrared sensors by channel."""

    infrared: dict[int, InfraredState]
    battery: BatteryState = battery.START
    measured: BatteryMeasured | None = None


class SensorService(StatefulPart[SensorState]):
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
        self._bus = bus
        self._infrared = {sensor.channel: sensor for sensor in infrared_parameters}
        self.memory = SensorState(self._unread_infrared())
        interpreters: dict[type[Any], Callable[[Any], object | None]] = {}
        if battery_parameters is not None:
            interpreters[BatteryCounted] = partial(self._charge, battery_parameters)
        if ultrasonic_parameters is not None:
            interpreters[UltrasonicEchoed] = partial(ultrasonic.interpret, ultrasonic_parameters)
        interruptions = (BoardRestarted, LinkClosed) if infrared_parameters else ()
        if infrared_parameters:
            interpreters |= {
                AnalogueCounted: self._infrared_range,
                **dict.fromkeys(interruptions, self._forget),
            }
        if imu_parameters is not None:
            interpreters[OrientationReported] = partial(imu.from_quaternion, imu_parameters)
            interpreters[InertialCounted] = partial(imu.from_counts, imu_parameters)
        self._failure = HandlerFailure()
        for kind, interpret in interpreters.items():
            bus.add_handler(partial(self._publish_reading, interpret), kind, on_error=self._failure.report)

    def restore(self, state: SensorState) -> None:
        """Restore this state, as far as it is of sensors that are configured now."""
        super().restore(state)
        self.memory.infrared = self._unread_infrared() | {
            channel: seen for channel, seen in state.infrared.items() if channel in self._infrared
        }

    def _unread_infrared(self) -> dict[int, InfraredState]:
        """The states of infrared sensors of which nothing was read yet."""
        return dict.fromkeys(self._infrared, infrared.START)

    async def run(self) -> None:
        """Raise the error of a reading that could not be interpreted; readings are interpreted as they are published."""
        await self._failure.wait()

    def _publish_reading(self, interpret: Callable[[Any], object | None], event: Any) -> None:
        measured = interpret(event)
        if measured is not None:
            self._bus.publish(measured)

    def _infrared_range(self, event: AnalogueCounted) -> RangeMeasured | None:
        """The reading of an analogue input; None if no sensor is configured on it."""
        sensor = self._infrared.get(event.channel)
        if sensor is None:
            return None
        seen = self.memory.infrared
        seen[event.channel], measured = infrared.interpret(sensor, seen[event.channel], event)
        return measured

    def _forget(self, event: BoardRestarted | LinkClosed) -> None:
        """Forget the readings: something may have moved in front of the sensors meanwhile."""
        self.memory.infrared = self._unread_infrared()

    def _charge(self, parameters: BatteryParameters, event: BatteryCounted) -> BatteryMeasured:
        self.memory.battery, measured = battery.measure(parameters, self.memory.battery, event)
        self.memory.measured = measured
        return measured


def sensors(service: SensorService) -> Feature:
    """The feature for sensor readings in SI units."""

    def add_metrics(metrics: Metrics) -> None:
        metrics.optional_gauge(
            "battery_v",
            "The battery's voltage.",
            lambda: None if service.memory.measured is None else service.memory.measured.voltage_v,
        )
        metrics.optional_gauge(
            "battery_percentage",
            "The remaining charge of the battery.",
            lambda: None if service.memory.measured is None else service.memory.measured.percentage,
        )

    return Feature(
        "sensors",
        services=(Service("sensors", service.run),),
        topics=TOPICS,
        add_metrics=add_metrics,
        parts={"sensors": service},
    )
