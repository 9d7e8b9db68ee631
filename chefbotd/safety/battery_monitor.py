"""Detects a battery that stays critically low.

Single readings say little: a motor that starts makes the voltage sag, and noise or a loose divider lifts one reading of
many above the threshold. So the share of the time for which the battery was critical lately is followed, by a
first-order low-pass. While it is above a half, a reading that is not critical ends nothing.
"""

import math
from collections.abc import Mapping
from typing import Any, ClassVar, Final

from pydantic import Field

from chefbotd.core.events import BatteryLevelStatus, BatteryMeasured
from chefbotd.core.parameters import Parameters
from chefbotd.core.record import Record
from chefbotd.core.sentence import Sentence
from chefbotd.safety.faults import Fault, FaultKind

FILTER_S: Final = 1.0
"""The time constant of the share of critical readings; assumed."""


class BatteryMonitorParameters(Parameters):
    """A battery that is critical for ``critical_s`` is a fault; the sag of a starting motor is none.

    It has recovered once it was not critical for most of the last second. Below
    ``absent_below_v`` no battery is connected to the ADC: the board runs, so it has another supply.
    """

    retired: ClassVar[Mapping[str, Any]] = {"filter_s": FILTER_S}

    critical_s: float = Field(default=5.0, gt=0, le=600)
    absent_below_v: float = Field(default=3.0, ge=0, le=100)


RECOVERED_SHARE = 0.5
"""Below this share of critical time a reading that is not critical ends the wait."""

MOST_WEIGHT = 1 / 8
"""A reading stands for so much of ``FILTER_S`` at most: one of a board that reads once a second counts as any other."""

SLOWEST_S = 3.5
"""A board that waits for echoes reads the battery once a second, and may lose a line or two; later nothing is known."""


class BatteryWatch(Record, frozen=True):
    """Since when the battery has been critical (None: it is not), and for which share of the time lately.

    ``was_critical`` says what the last reading, at ``stamp_s``, came to.
    """

    since_s: float | None = None
    share: float = 0.0
    was_critical: bool = False
    stamp_s: float = float("-inf")


CHARGED = BatteryWatch()
"""Before the first reading."""


def judge(
    params: BatteryMonitorParameters, state: BatteryWatch, measured: BatteryMeasured
) -> tuple[BatteryWatch, Fault | None]:
    """The next state, and the fault once the battery has been critical for too long.

    The fault restarts the time: after ``arm`` the robot can be driven out of the way for another ``critical_s``.
    """
    critical = measured.status is BatteryLevelStatus.CRITICAL and measured.voltage_v >= params.absent_below_v
    now_s = measured.arrival_s
    if not critical and state.share == 0.0 and not state.was_critical:  # as it nearly always is
        return CHARGED, None
    passed_s = max(0.0, now_s - state.stamp_s)
    if passed_s <= SLOWEST_S:
        passed_s = min(passed_s, FILTER_S * MOST_WEIGHT)
    kept = math.exp(-passed_s / FILTER_S)
    share = kept * state.share + (1 - kept) * state.was_critical
    since_s = state.since_s
    if share < RECOVERED_SHARE and not (critical and state.was_critical):
        since_s = None
    if critical and since_s is None:
        since_s = now_s
    if since_s is None or not critical or now_s - since_s < params.critical_s:
        return BatteryWatch(since_s, share, critical, now_s), None
    reason = Sentence(
        "driving.battery_critical",
        "the battery is critically low ({voltage_v:.1f} V): charge it",
        voltage_v=measured.voltage_v,
    )
    return BatteryWatch(None, share, critical, now_s), Fault(FaultKind.BATTERY_CRITICAL, reason)
