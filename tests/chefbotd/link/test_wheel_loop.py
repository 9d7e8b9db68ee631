"""What the board's wheel loop is told of its parameters."""

import pytest

from chefbotd.link.wheel_loop import ASK_AGAIN_S, WheelLoop, WheelLoopParameters, wheel_loop_parameters
from chefbotd.motion.kinematics import ChassisParameters
from chefbotd.motion.pid import PidParameters
from chefbotd.settings import load

SIGNS = (1, 1)


def a_loop(*values: int) -> WheelLoop:
    """A loop of a board that has confirmed these parameters."""
    loop = WheelLoop()
    loop.use(WheelLoopParameters(values, SIGNS), lambda: (0.0, 0.0))
    for number, value in enumerate(values):
        assert loop.next_parameter(0.0) == (number, value)
        assert loop.confirm(number, value) is (number == len(values) - 1)
    return loop


@pytest.fixture
def chassis() -> ChassisParameters:
    """ChefBot's, with wheels of 45 mm."""
    return load().chassis


def test_the_gains_are_those_of_a_metre_a_second_at_the_rim(chassis: ChassisParameters) -> None:
    """A kp of 400 at 0.045 m is 18 a rad/s, in 256ths 4608; ki 20000 is 230400 a second; ks 20 is 5120."""
    gains = PidParameters(kp=400.0, ki=20_000.0, kv=100.0, ks=20.0, output_limit=255)
    parameters = wheel_loop_parameters(chassis, 4200.0, (gains, gains))
    assert parameters.values == (4200, 4608, 230_400, 1152, 5120)


def test_a_ready_loop_is_told_each_parameter_that_has_changed_and_no_other() -> None:
    """Of five the second and the fifth: told again until they are confirmed, while it stays ready."""
    loop = a_loop(4200, 10, 20, 30, 40)
    assert loop.next_parameter(1.0) is None
    loop.change(WheelLoopParameters((4200, 11, 20, 30, 41), SIGNS))
    assert loop.next_parameter(1.0) == (1, 11)
    assert loop.next_parameter(1.0) is None
    assert loop.next_parameter(1.0 + ASK_AGAIN_S) == (1, 11)
    assert not loop.confirm(1, 11)
    assert loop.next_parameter(1.0 + ASK_AGAIN_S) == (4, 41)
    assert not loop.confirm(4, 41)
    assert loop.next_parameter(9.0) is None
    assert loop.memory.is_ready


def test_a_parameter_that_the_board_has_otherwise_is_told_again() -> None:
    """Its answer has the old value: the loop does not take that for the new one."""
    loop = a_loop(4200, 10)
    loop.change(WheelLoopParameters((4200, 11), SIGNS))
    assert loop.next_parameter(1.0) == (1, 11)
    assert not loop.confirm(1, 10)
    assert loop.next_parameter(1.0) == (1, 11)


def test_no_speed_is_asked_for_that_the_board_cannot_count() -> None:
    """12,500 edges a second at 8400 a turn are 9.349 rad/s; a board that has not said so gets what was wished."""
    loop = WheelLoop()
    loop.use(WheelLoopParameters((8400,), SIGNS), lambda: (12.0, -3.0))
    loop.confirm(0, 8400)
    assert loop.command((200, -50)) == (12_000, -3_000)
    loop.limit_edges(12_500)
    assert loop.command((200, -50)) == (9_349, -3_000)
