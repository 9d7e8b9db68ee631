"""What a robot is told of the kinds of lines that its board leaves out."""

import pytest

from chefbotd.components.doctor.algorithms.finding import Verdict
from chefbotd.components.doctor.algorithms.lines import LinesHeard, check_at_rest
from chefbotd.components.doctor.algorithms.missing_lines import check_missing
from chefbotd.core.record import replace

EVERY_KIND = dict.fromkeys("tesuib", 100)
GOOD = LinesHeard(seconds=5.0, bytes=9000, kinds=EVERY_KIND, duty=(0.0, 0.0), counted=(0, 0))


def without(*kinds: str) -> LinesHeard:
    """A board that leaves these kinds out; without an echo there is no duty."""
    left = {kind: count for kind, count in EVERY_KIND.items() if kind not in kinds}
    return replace(GOOD, kinds=left, duty=() if "s" in kinds else GOOD.duty)


def test_nothing_is_missing() -> None:
    """A board that sends every kind is in order."""
    assert check_missing(GOOD).verdict is Verdict.OK


@pytest.mark.parametrize(
    ("kind", "said"),
    [
        ("t", "only guessed"),
        ("s", "motors that were left on"),
        ("u", "nothing stops the robot before an obstacle"),
    ],
)
def test_what_the_robot_drives_worse_without_is_a_warning(kind: str, said: str) -> None:
    """Time, echo and, where nothing else looks ahead, the ultrasonic sensor."""
    finding = check_missing(without(kind))
    assert finding.verdict is Verdict.WARNING
    assert f"no {kind!r} lines" in finding.measured
    assert said in finding.measured
    assert finding.advice


@pytest.mark.parametrize(
    ("kind", "said"), [("i", "from the wheels alone"), ("b", "an empty battery is not noticed")]
)
def test_what_many_robots_do_without_is_said(kind: str, said: str) -> None:
    """A robot without an IMU or a battery's divider is in order, and told what that costs."""
    finding = check_missing(without(kind))
    assert finding.verdict is Verdict.OK
    assert said in finding.measured


def test_a_robot_with_only_encoder_lines_is_told_all_that_it_lacks() -> None:
    """Time and echo first, since the other findings rest on them; each of the five once."""
    finding = check_missing(without(*"tsuib"))
    assert finding.verdict is Verdict.WARNING
    places = [finding.measured.index(f"no {kind!r} lines") for kind in "tsuib"]
    assert places == sorted(places)
    assert "before you suspect an encoder" in finding.advice


def test_other_sensors_that_see_obstacles_are_named() -> None:
    """A lidar guards without an ultrasonic sensor; with ``silent_is_obstacle`` the silent one stops the robot."""
    finding = check_missing(without("u"), ["lidar"])
    assert finding.verdict is Verdict.OK
    assert "only lidar can stop the robot" in finding.measured
    silent = check_missing(without("u"), silent_is_obstacle=True)
    assert "does not drive ahead" in silent.measured


def test_a_kind_in_another_format_is_not_missing() -> None:
    """Lines that come and are refused have a finding of their own."""
    heard = replace(without("t"), formats={"t": "every 't' line is strange"})
    assert "no 't' lines" not in check_missing(heard).measured


def test_motors_are_not_said_to_be_off_where_no_echo_says_so() -> None:
    """Without 's' lines only the wheels are known; where they count, the motors are suspected before a loose wire."""
    still = check_at_rest(without("s"), 4200)
    assert "not known whether the motors are off" in still.measured
    turning = check_at_rest(replace(without("s"), counted=(400, 0)), 4200)
    assert turning.verdict is Verdict.WARNING
    assert turning.advice.index("motors") < turning.advice.index("loose")
