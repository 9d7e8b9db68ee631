"""Battery: ADC counts behind a divider to volts, charge and urgency."""

from functools import cached_property
from itertools import pairwise
from typing import Self

from pydantic import Field, model_validator

from chefbotd.core.events import BatteryCounted, BatteryLevelStatus, BatteryMeasured
from chefbotd.core.parameters import Parameters
from chefbotd.core.record import Record


class BatteryParameters(Parameters):
    """The divider in front of the ADC and what the battery's voltage means.

    ``divider_ratio`` is battery volts per volt at the pin. ``curve_v_percent`` bends the line from
    ``empty_v`` (0 %) to ``full_v`` (100 %) through points in between. ``hysteresis_v`` is how far above a
    threshold the voltage must recover before the status does.
    """

    reference_v: float = Field(gt=0, le=10)
    """The voltage at the pin at which the analogue input reads its full scale."""
    divider_ratio: float = Field(ge=1, le=100)
    adc_full_scale: int = Field(default=4095, ge=1, le=65535)
    """What the analogue input reads at that voltage: 4095 for 12 bits."""
    full_v: float = Field(gt=0, le=100)
    """The voltage of a full battery at rest."""
    empty_v: float = Field(gt=0, le=100)
    """The voltage of an empty one."""
    curve_v_percent: tuple[tuple[float, float], ...] = ()
    """Pairs of volts and percent between empty and full, where a straight line does not do."""
    low_v: float = Field(default=12.0, gt=0, le=100)
    """Below it the battery is reported as low."""
    critical_v: float = Field(default=11.7, gt=0, le=100)
    """Below it the battery is critical, which stops the robot after a while."""
    hysteresis_v: float = Field(default=0.1, ge=0, le=5)

    @model_validator(mode="after")
    def _in_order(self) -> Self:
        if self.critical_v > self.low_v:
            raise ValueError(f"critical_v must not be above low_v, got {self.critical_v} and {self.low_v}")
        if not self.low_v < self.full_v:
            raise ValueError(f"low_v must be below full_v, got {self.low_v} and {self.full_v}")
        for (lower_v, less), (higher_v, more) in pairwise(self.discharge_curve):
            if not (lower_v < higher_v and less <= more):
                points = f"{lower_v, less} before {higher_v, more}"
                raise ValueError(f"the curve must rise from (empty_v, 0) to (full_v, 100), got {points}")
        return self

    @cached_property
    def discharge_curve(self) -> tuple[tuple[float, float], ...]:
        """Volts and percent, from empty to full."""
        return ((self.empty_v, 0.0), *self.curve_v_percent, (self.full_v, 100.0))


class BatteryState(Record, frozen=True):
    """The status of the last measurement, for the hysteresis."""

    status: BatteryLevelStatus = BatteryLevelStatus.OK


START = BatteryState()


def measure(
    params: BatteryParameters, state: BatteryState, counted: BatteryCounted
) -> tuple[BatteryState, BatteryMeasured]:
    """The next state, and the meaning of an ADC reading."""
    voltage_v = counted.adc / params.adc_full_scale * params.reference_v * params.divider_ratio
    status = _status(params, voltage_v, state.status)
    percentage = _percentage(params.discharge_curve, voltage_v)
    measured = BatteryMeasured(
        voltage_v, percentage, status, stamp_s=counted.stamp_s, arrival_s=counted.arrival_s
    )
    return BatteryState(status), measured


def _percentage(curve: tuple[tuple[float, float], ...], voltage_v: float) -> float:
    if voltage_v <= curve[0][0]:
        return curve[0][1]
    for (lower_v, less), (higher_v, more) in pairwise(curve):
        if voltage_v < higher_v:
            return less + (voltage_v - lower_v) / (higher_v - lower_v) * (more - less)
    return curve[-1][1]


def _status(params: BatteryParameters, voltage_v: float, previous: BatteryLevelStatus) -> BatteryLevelStatus:
    """The status: it gets worse at once, and better only past the hysteresis."""
    was_critical = previous is BatteryLevelStatus.CRITICAL
    was_low = previous is not BatteryLevelStatus.OK
    if voltage_v < params.critical_v + (params.hysteresis_v if was_critical else 0.0):
        return BatteryLevelStatus.CRITICAL
    if voltage_v < params.low_v + (params.hysteresis_v if was_low else 0.0):
        return BatteryLevelStatus.LOW
    return BatteryLevelStatus.OK
