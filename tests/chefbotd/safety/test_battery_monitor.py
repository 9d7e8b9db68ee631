"""A battery that is critically low."""

import random
from collections.abc import Callable

from chefbotd.core.events import BatteryLevelStatus, BatteryMeasured
from chefbotd.safety.battery_monitor import CHARGED, BatteryMonitorParameters, judge
from chefbotd.safety.faults import Fault, FaultKind

PARAMETERS = BatteryMonitorParameters(critical_s=5.0, absent_below_v=3.0)


def story(*readings: tuple[float, float, BatteryLevelStatus]) -> list[Fault | None]:
    """What each reading (seconds, volts, status) comes to."""
    state, faults = CHARGED, []
    for stamp_s, voltage_v, status in readings:
        state, fault = judge(
            PARAMETERS,
            state,
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


def flat(seed: int, charged: Callable[[int], bool], noise_v: float = 0.0) -> float | None:
    """When 11.3 V, read twenty times a second, is a fault; readings that are ``charged`` show 12.5 V."""
    chance, readings = random.Random(seed), []
    for count in range(600):
        voltage_v = 12.5 if charged(count) else 11.3 + chance.uniform(-noise_v, noise_v)
        status = CRITICAL if voltage_v < 11.7 else LOW if voltage_v < 12.0 else BatteryLevelStatus.OK
        readings.append((count * 0.05, voltage_v, status))
    return next((at_s for (at_s, *_), fault in zip(readings, story(*readings), strict=True) if fault), None)


def test_good_readings_among_many_keep_no_flat_battery_alive() -> None:
    """One of eighty, of ten, of four: five seconds after it is critical for most of the time, a second at most."""
    for every in (80, 10, 4):
        found_s = flat(0, lambda count, every=every: count % every == 0)  # type: ignore[misc]
        assert found_s is not None
        assert 5.0 <= found_s <= 6.1


def test_a_noisy_reading_of_a_flat_battery_is_a_fault() -> None:
    """0.6 V to either side at 11.3 V, where 11.7 V is critical: within 7 s for each of 200 seeds."""
    for seed in range(200):
        found_s = flat(seed, lambda count: False, noise_v=0.6)
        assert found_s is not None
        assert found_s <= 7.0


def test_low_readings_among_good_ones_are_no_fault() -> None:
    """Three of ten readings of a charged battery are critical, for half a minute."""
    assert flat(0, lambda count: count % 10 >= 3) is None


def test_good_readings_of_a_board_that_reads_once_a_second_keep_no_flat_battery_alive() -> None:
    """Every fourth of a board that waits for echoes: within 20 s; each restarted the time, so it was never found."""
    readings = [(1.05 * count, 11.3, LOW if count % 4 == 3 else CRITICAL) for count in range(60)]
    found = [at_s for (at_s, *_), fault in zip(readings, story(*readings), strict=True) if fault]
    assert 5.0 <= found[0] <= 20.0


def test_a_sag_once_a_while_is_no_fault_of_a_board_that_reads_once_a_second() -> None:
    """Two readings of eight, for two minutes; and one before and one after a minute without any reading."""
    sags = [(1.05 * count, 11.6, CRITICAL if count % 8 < 2 else LOW) for count in range(120)]
    assert not any(story(*sags))
    assert not any(story((0.0, 11.6, CRITICAL), (1.0, 12.5, LOW), (61.0, 11.6, CRITICAL)))
