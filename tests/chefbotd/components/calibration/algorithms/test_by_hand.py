"""The steps in which a person helps: wheels turned by hand, and a voltmeter."""

import math
from collections.abc import Mapping

import pytest

from chefbotd.components.calibration.algorithms.by_hand import BATTERY, ENCODERS
from chefbotd.components.calibration.algorithms.step import Ask, Measurements, Status
from chefbotd.core.events import BatteryLevelStatus, BatteryMeasured, WheelsMeasured
from tests.chefbotd.components.calibration.algorithms.synthetic import configured

ROBOT = configured()


def _turned(left: float, right: float, answers: Mapping[str, float]) -> Measurements:
    """Wheels that were counted so many turns, in ten steps."""
    step = (left * math.tau / 10, right * math.tau / 10)
    wheels = tuple(WheelsMeasured(t, t, t, (0.0, 0.0), step, (0.0, 0.0)) for t in range(1, 11))
    typed = {f"encoders.turns.{name}": turns for name, turns in answers.items()}
    return Measurements(wheels=wheels, answers=typed)


BOTH = {"left_wheel": 5.0, "right_wheel": 5.0}


def test_each_wheel_is_asked_for() -> None:
    """One question for each wheel, which may be left out by 0."""
    asked = [action for action in ENCODERS.procedure(ROBOT) if isinstance(action, Ask)]
    assert [(one.key, one.lowest) for one in asked] == [
        ("encoders.turns.left_wheel", 0),
        ("encoders.turns.right_wheel", 0),
    ]


def test_the_counts_of_a_turn_are_those_counted_over_those_typed() -> None:
    """Five turns of each wheel that count as ten per cent more: 4200 become 4620, known to 0.01/5/sqrt(2)."""
    result = ENCODERS.fit(ROBOT, _turned(5.5, 5.5, BOTH))
    (estimate,) = result.estimates
    assert (estimate.key, estimate.before) == ("encoders.counts_per_turn", 4200)
    assert estimate.after == pytest.approx(4620)
    assert estimate.sigma == pytest.approx(4200 * 0.01 / 5 / math.sqrt(2))


def test_counts_that_agree_are_left_as_they_are() -> None:
    """A hand is less exact than a gear: within three standard deviations nothing is changed."""
    result = ENCODERS.fit(ROBOT, _turned(5.01, 4.99, BOTH))
    assert (result.status, result.estimates) == (Status.PASSED, ())


@pytest.mark.parametrize(
    ("turned", "answers", "status", "reason"),
    [
        ((5, 5), {}, Status.NOT_ENOUGH, "no wheel was turned"),
        ((5, 5), {"left_wheel": 0.0}, Status.NOT_ENOUGH, "no wheel was turned"),
        ((-5, 5), BOTH, Status.REFUSED, "left_wheel counts backwards"),
        ((5, 0), BOTH, Status.REFUSED, "right_wheel was not seen to turn"),
        ((5, 10), BOTH, Status.REFUSED, "right_wheel counted 2.00 turns for each"),
        ((5, 5.5), BOTH, Status.REFUSED, "the wheels disagree"),
    ],
)
def test_what_cannot_be_believed_is_named(
    turned: tuple[float, float], answers: Mapping[str, float], status: Status, reason: str
) -> None:
    """No wheel, one that counts backwards or not at all, a wrong gear, wheels that disagree."""
    result = ENCODERS.fit(ROBOT, _turned(*turned, answers))
    assert (result.status, result.estimates) == (status, ())
    assert reason in result.reason


def _battery(*volts: float, typed_v: float | None) -> Measurements:
    read = tuple(BatteryMeasured(v, 50.0, BatteryLevelStatus.OK, stamp_s=1.0, arrival_s=1.0) for v in volts)
    return Measurements(battery=read, answers={} if typed_v is None else {"battery.voltage_v": typed_v})


def test_the_divider_makes_the_reading_the_voltmeters() -> None:
    """12.0 V read, 12.36 V typed: a divider of 5 becomes 5.15, known to 10 mV in 12.36 V."""
    result = BATTERY.fit(ROBOT, _battery(*[12.0] * 10, typed_v=12.36))
    (estimate,) = result.estimates
    assert (estimate.key, estimate.before) == ("battery.divider_ratio", 5.0)
    assert estimate.after == pytest.approx(5.15)
    assert estimate.sigma == pytest.approx(5.15 * 0.01 / 12.36)


@pytest.mark.parametrize(
    ("measured", "status", "reason"),
    [
        (_battery(*[12.0] * 10, typed_v=None), Status.NOT_ENOUGH, "voltmeter"),
        (_battery(12.0, typed_v=12.0), Status.NOT_ENOUGH, "1 of 5 readings"),
        (_battery(*[12.0] * 10, typed_v=24.0), Status.REFUSED, "reads 12.00 V, the voltmeter 24.00 V"),
        (_battery(*[0.0] * 10, typed_v=12.0), Status.REFUSED, "reads 0.00 V"),
    ],
)
def test_a_reading_that_cannot_be_is_refused(measured: Measurements, status: Status, reason: str) -> None:
    """Nothing typed, nothing measured, another battery, a pin without one."""
    result = BATTERY.fit(ROBOT, measured)
    assert (result.status, result.estimates) == (status, ())
    assert reason in result.reason
