"""A battery that is critically low."""

from chefbotd.core.events import BatteryLevelStatus, BatteryMeasured
from chefbotd.safety.battery_monitor import BatteryMonitorParameters, judge
from chefbotd.safety.faults import Fault, FaultKind

PARAMETERS = BatteryMonitorParameters(critical_s=5.0, absent_below_v=3.0)


def story(*readings: tuple[float, float, BatteryLevelStatus]) -> list[Fault | None]:
    """What each reading (seconds, volts, status) comes to."""
    since_s, faults = None, []
    for stamp_s, voltage_v, status in readings:
        since_s, fault = judge(
            PARAMETERS,
            since_s,
            BatteryMeasured(voltage_v, 0.0, status, stamp_s=stamp_s - 0.01, arrival_s=stamp_s),
        )
        faults.append(fault)
    return faults


CRITICAL, LOW = BatteryLevelStatus.CRITICAL, BatteryLevelStatus.LOW


def test_critical_for_long_enough_is_a_fault():
    """Five seconds on end; the reason has the voltage."""
    *before, fault = story((0.0, 11.5, CRITICAL), (4.9, 11.5, CRITICAL), (5.0, 11.46, CRITICAL))
    assert before == [None, None]
    assert fault == Fault(FaultKind.BATTERY_CRITICAL, "the battery is critically low (11.5 V): charge it")


def test_a_motor_that_starts_and_sags_the_battery_is_no_fault():
    """Three seconds below the threshold, again and again, with a moment above it in between."""
    sag = [(0.0, CRITICAL), (3.0, CRITICAL), (3.1, LOW)]
    readings = [(4.0 * n + at_s, 11.6, status) for n in range(5) for at_s, status in sag]
    assert not any(story(*readings))


def test_after_the_fault_the_time_starts_anew():
    """Who arms all the same has five seconds more."""
    faults = story(*[(float(s), 11.5, CRITICAL) for s in range(12)])
    assert [s for s, fault in enumerate(faults) if fault] == [5, 11]


def test_a_pin_without_a_battery_is_no_fault():
    """Zero volts on the pin of a board that runs: nothing is wired there."""
    assert not any(story(*[(float(s), 0.0, CRITICAL) for s in range(20)]))


def test_a_battery_begins_at_three_volts():
    """At 3.0 V it is one that is all but empty, at 2.99 V none."""
    assert story((0.0, 3.0, CRITICAL), (5.0, 3.0, CRITICAL))[1] is not None
    assert story((0.0, 2.99, CRITICAL), (5.0, 2.99, CRITICAL))[1] is None
