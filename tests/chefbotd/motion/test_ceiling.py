"""What a step may do while commands that are faster are held back."""

import pytest

from chefbotd.core.geometry import STANDING, Twist2D
from chefbotd.core.record import replace
from chefbotd.motion import pid
from chefbotd.motion.drive_state import DriveState
from chefbotd.motion.limits import LimiterState
from chefbotd.motion.setpoints import under

BEFORE = DriveState(
    (replace(pid.RESET, integral_duty=3.0), replace(pid.RESET, integral_duty=-2.0)),
    (50, -40),
    LimiterState(Twist2D(0.02, 0.4), Twist2D(0.5, 0.1)),
    setpoint_m_s=(-0.04, 0.08),
    acceleration_m_s2=(0.5, 0.5),
)


def step(duty: tuple[int, int], setpoint_m_s: tuple[float, float]) -> DriveState:
    """What the controller would do next."""
    return replace(
        BEFORE,
        pids=(replace(pid.RESET, integral_duty=4.0), replace(pid.RESET, integral_duty=-1.0)),
        duty=duty,
        limiter=LimiterState(Twist2D(0.05, 0.6), Twist2D(0.5, 0.1)),
        stepped_s=7.0,
        setpoint_m_s=setpoint_m_s,
    )


def test_without_a_ceiling_the_step_is_taken_as_it_is():
    """Nothing is held back: nothing changes."""
    after = step((200, -300), (-0.5, 0.9))
    assert under(None, BEFORE, after) is after


@pytest.mark.parametrize(
    ("wanted", "expected"),
    [
        ((60, -45), (50, -40)),
        ((60, -30), (50, -30)),
        ((20, 30), (20, 0)),
        ((0, 0), (0, 0)),
        ((-9, -41), (0, -40)),
    ],
)
def test_no_wheel_is_pushed_harder_or_the_other_way(wanted: tuple[int, int], expected: tuple[int, int]):
    """Each duty is cut to what was last written, and one of the other sign to none; what is less stays."""
    assert under((50, -40), BEFORE, step(wanted, (-0.04, 0.08))).duty == expected


@pytest.mark.parametrize("setpoint", [(-0.05, 0.08), (-0.04, 0.09), (0.01, 0.08), (-0.01, 0.081)])
def test_the_ramp_stands_still_where_a_wheel_would_be_faster(setpoint: tuple[float, float]):
    """The setpoint and the limiter stay where they were, and do not accelerate; time goes on."""
    held = under((50, -40), BEFORE, step((50, -40), setpoint))
    assert held.setpoint_m_s == (-0.04, 0.08)
    assert held.limiter == LimiterState(Twist2D(0.02, 0.4), STANDING)
    assert held.acceleration_m_s2 == (0.0, 0.0)
    assert held.stepped_s == 7.0


def test_the_ramp_goes_on_where_every_wheel_is_slower():
    """Braking is not held: the setpoint is the new one."""
    after = step((30, -20), (-0.03, 0.08))
    assert under((50, -40), BEFORE, after) == after


def test_an_integral_does_not_grow_behind_what_is_cut():
    """The left wheel is cut and keeps its integral of 3; the right one is not, and has its new one."""
    held = under((50, -40), BEFORE, step((60, -30), (-0.04, 0.08)))
    assert [each.integral_duty for each in held.pids] == [3.0, -1.0]


def test_a_robot_that_slows_is_held_by_no_ceiling_though_a_wheel_of_it_speeds_up() -> None:
    """The twist falls from (0.07, 0.74) to (0.01, 0.62) while the inner wheel goes from 0 to -0.049 m/s."""
    before = replace(BEFORE, limiter=LimiterState(Twist2D(0.07, 0.74)), setpoint_m_s=(0.0, 0.14))
    after = replace(before, limiter=LimiterState(Twist2D(0.01, 0.62)), setpoint_m_s=(-0.049, 0.069))
    assert under((0, 50), before, after).setpoint_m_s == (-0.049, 0.069)
    assert under((0, 50), after, before).setpoint_m_s == after.setpoint_m_s
