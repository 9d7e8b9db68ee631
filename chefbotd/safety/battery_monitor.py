"""Detects a battery that stays critically low."""

from pydantic import Field

from chefbotd.core.events import BatteryLevelStatus, BatteryMeasured
from chefbotd.core.parameters import Parameters
from chefbotd.safety.faults import Fault, FaultKind


class BatteryMonitorParameters(Parameters):
    """A battery that is critical for ``critical_s`` without a break is a fault; the sag of a starting motor is none.

    Below ``absent_below_v`` no battery is connected to the ADC: the board runs, so it has another supply.
    """

    critical_s: float = Field(default=5.0, gt=0, le=600)
    absent_below_v: float = Field(default=3.0, ge=0, le=100)


def judge(
    params: BatteryMonitorParameters, critical_since_s: float | None, measured: BatteryMeasured
) -> tuple[float | None, Fault | None]:
    """Since when the battery has been critical (None: it is not), and the fault once that has lasted too long.

    The fault restarts the time: after ``arm`` the robot can be driven out of the way for another ``critical_s``.
    """
    critical = measured.status is BatteryLevelStatus.CRITICAL and measured.voltage_v >= params.absent_below_v
    if not critical:
        return None, None
    if critical_since_s is None:
        return measured.arrival_s, None
    if measured.arrival_s - critical_since_s < params.critical_s:
        return critical_since_s, None
    reason = f"the battery is critically low ({measured.voltage_v:.1f} V): charge it"
    return None, Fault(FaultKind.BATTERY_CRITICAL, reason)
