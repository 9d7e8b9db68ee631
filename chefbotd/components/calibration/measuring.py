"""Gathers what is measured while a step of the calibration runs."""

from collections.abc import Callable, Iterable, Mapping
from typing import Any

from chefbotd.bus import Bus
from chefbotd.components.calibration.algorithms.step import ConfiguredRobot, Measurements
from chefbotd.core.events import (
    BatteryMeasured,
    DutyEchoed,
    ImuMeasured,
    RangeMeasured,
    TruthSimulated,
    WheelsDriven,
    WheelsMeasured,
)
from chefbotd.core.events.lidars import ScanMeasured
from chefbotd.core.record import replace

FIELDS: Mapping[type, str] = {
    WheelsMeasured: "wheels",
    WheelsDriven: "driven",
    ImuMeasured: "imu",
    ScanMeasured: "scans",
    RangeMeasured: "ranges",
    BatteryMeasured: "battery",
    DutyEchoed: "echoed",
    TruthSimulated: "truth",
}
"""Where in ``Measurements`` the events of each class stand."""


def measurements(events: Iterable[Any]) -> Measurements:
    """The measurements among these events; all others are left out."""
    lists: dict[str, list[Any]] = {name: [] for name in FIELDS.values()}
    for event in events:
        if (name := FIELDS.get(type(event))) is not None:
            lists[name].append(event)
    fields: dict[str, Any] = {name: tuple(values) for name, values in lists.items()}
    return Measurements(**fields)


def join_measurements(parts: Iterable[Measurements]) -> Measurements:
    """All of them, one after the other."""
    whole = tuple(parts)
    lists = {
        name: tuple(event for part in whole for event in getattr(part, name)) for name in FIELDS.values()
    }
    answers = {key: value for part in whole for key, value in part.answers.items()}
    return Measurements(**lists, answers=answers)


def as_calibrated(measured: Measurements, running: ConfiguredRobot, robot: ConfiguredRobot) -> Measurements:
    """The measurements of a ``running`` robot as one with the results of other steps would have made them.

    The battery's voltage grows with the divider; a wheel's turn shrinks with the counts that make one.
    """
    volts = 1.0
    if robot.battery is not None and running.battery is not None:
        volts = robot.battery.divider_ratio / running.battery.divider_ratio
    turns = running.encoders.counts_per_turn / robot.encoders.counts_per_turn
    if volts == 1 == turns:
        return measured
    battery = [replace(event, voltage_v=event.voltage_v * volts) for event in measured.battery]
    wheels = [
        replace(
            event,
            position_rad=_scale_values(event.position_rad, turns),
            travel_rad=_scale_values(event.travel_rad, turns),
            velocity_rad_s=_scale_values(event.velocity_rad_s, turns),
        )
        for event in measured.wheels
    ]
    driven = [
        replace(
            event,
            position_rad=_scale_values(event.position_rad, turns),
            velocity_rad_s=_scale_values(event.velocity_rad_s, turns),
        )
        for event in measured.driven
    ]
    return replace(measured, battery=tuple(battery), wheels=tuple(wheels), driven=tuple(driven))


def _scale_values(values: tuple[float, ...], factor: float) -> tuple[float, ...]:
    return tuple(value * factor for value in values)


class Gathering:
    """Gathers from the bus until it is ended. The simulator's truth is left out: a real robot has none.

    ``with_scans`` False leaves out scans: while a question waits, they would fill 100 MB in a quarter of an hour.
    """

    def __init__(self, bus: Bus) -> None:
        self.with_scans = True
        self._events: list[Any] = []
        classes = [kind for kind in FIELDS if kind not in (TruthSimulated, ScanMeasured)]
        self._removers: tuple[Callable[[], None], ...] = (
            *(bus.add_handler(self._events.append, kind) for kind in classes),
            bus.add_handler(self._take_scan, ScanMeasured),
        )

    def take(self, answers: Mapping[str, float] | None = None) -> Measurements:
        """What was measured since this was last asked, with the answers of a person."""
        events = self._events.copy()
        self._events.clear()
        measured = measurements(events)
        return join_measurements((measured, Measurements(answers=answers))) if answers else measured

    def end(self) -> None:
        """Gather no more."""
        for remove in self._removers:
            remove()

    def _take_scan(self, scan: ScanMeasured) -> None:
        if self.with_scans:
            self._events.append(scan)
