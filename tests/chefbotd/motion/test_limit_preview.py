"""What the limits leave of a command: the target that the wheels' controller really goes for."""

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from chefbotd.core.commands import Allowed
from chefbotd.core.geometry import STANDING, Motion, Twist2D
from chefbotd.motion.drive import Drive
from chefbotd.motion.drive_state import DriveParameters
from chefbotd.motion.kinematics import ChassisParameters, Kinematics
from chefbotd.motion.limit_preview import LimitPreview
from chefbotd.motion.limits import MotionLimits
from chefbotd.motion.pid import PidParameters
from tests.budget import examples
from tests.fakes.wheels import wheel_speeds_rad_s

CHASSIS = ChassisParameters.model_validate(
    {
        "track_width_m": 0.5,
        "wheels": [
            {"name": "left", "side": "left", "radius_m": 0.1},
            {"name": "right", "side": "right", "radius_m": 0.1},
        ],
    }
)
DRIVE = DriveParameters(max_rim_speed_m_s=1.0)
GAINS = PidParameters(kp=1.0, ki=0.0, output_limit=1000.0)


def limits(*, keep_curvature: bool = True) -> MotionLimits:
    """0.8 m/s ahead and 0.4 m/s back, 2 rad/s either way."""
    return MotionLimits.model_validate(
        {
            "linear": {"max_forward_m_s": 0.8, "max_reverse_m_s": 0.4, "acceleration_m_s2": 1.0},
            "angular": {"max_left_rad_s": 2.0, "acceleration_rad_s2": 5.0},
            "keep_curvature": keep_curvature,
        }
    )


RIM, LINEAR, ANGULAR = "drive.max_rim_speed_m_s", "limits.linear", "limits.angular"


@pytest.mark.parametrize(
    ("wanted", "allowed", "limited_by"),
    [
        (Twist2D(), Twist2D(), None),
        (Twist2D(0.8, 0.8), Twist2D(0.8, 0.8), None),  # its outer rim goes 0.8 + 0.8 * 0.25 = 1 m/s
        (Twist2D(1.0, 0.0), Twist2D(0.8, 0.0), LINEAR),
        (Twist2D(-1.0, 0.0), Twist2D(-0.4, 0.0), LINEAR),
        (Twist2D(0.0, -3.0), Twist2D(0.0, -2.0), ANGULAR),
        (Twist2D(0.8, 1.6), Twist2D(0.8 / 1.2, 1.6 / 1.2), RIM),  # 0.8 + 1.6 * 0.25 = 1.2 m/s
        (
            Twist2D(0.2, 4.0),
            Twist2D(0.1, 2.0),
            ANGULAR,
        ),  # its rim goes 1.2 m/s: 2 rad/s is half of it, 1 m/s is 5/6
    ],
)
def test_the_tightest_limit_is_named(wanted: Twist2D, allowed: Twist2D, limited_by: str | None) -> None:
    """With its curvature kept, a motion goes as far as the first limit that it meets, forward or in reverse."""
    answer = LimitPreview(DRIVE, CHASSIS, limits()).of_twist(wanted)
    assert answer.command.linear_m_s == pytest.approx(allowed.linear_m_s)
    assert answer.command.angular_rad_s == pytest.approx(allowed.angular_rad_s)
    assert answer.limited_by == limited_by


def test_without_curvature_each_axis_has_its_own_limit() -> None:
    """0.9 m/s is cut to 0.8; turning at 0.2 rad/s, with which the outer rim goes 0.95 m/s, is left alone."""
    answer = LimitPreview(DRIVE, CHASSIS, limits(keep_curvature=False)).of_twist(Twist2D(0.9, 0.2))
    assert answer == Allowed(Twist2D(0.8, 0.2), LINEAR)


@pytest.mark.parametrize(
    ("left_rad_s", "right_rad_s", "share", "limited_by"),
    [
        (8.0, 8.0, 1.0, None),
        (5.0, 20.0, 0.5, RIM),  # 2 m/s at the right rim
        (9.0, 9.0, 8 / 9, LINEAR),  # together 0.9 m/s ahead
        (-8.0, 8.0, 0.625, ANGULAR),  # 1.6 / 0.5 = 3.2 rad/s
        (0.0, 0.0, 1.0, None),
    ],
)
def test_wheels_are_slowed_together(
    left_rad_s: float, right_rad_s: float, share: float, limited_by: str | None
) -> None:
    """Their ratio is kept; what they come to together is limited as a twist is."""
    rad_s = {"left": left_rad_s, "right": right_rad_s}
    wanted = Drive(DRIVE, CHASSIS, limits(), (GAINS, GAINS)).wheel_velocities(rad_s)
    answer = LimitPreview(DRIVE, CHASSIS, limits()).of_wheels(wanted)
    assert answer.command == pytest.approx({name: share * speed for name, speed in rad_s.items()})
    assert answer.limited_by == limited_by


SPEED = st.floats(-3.0, 3.0)


def reached(drive: Drive, target: Motion) -> tuple[float, ...]:
    """What each wheel is asked for, ten seconds after the command."""
    state = drive.at_rest
    for tick in range(200):
        state = drive.retarget(state, target, tick * 0.05)
    return drive.targets_rad_s(state)


@settings(max_examples=examples(50), deadline=None)
@given(SPEED, st.floats(-10.0, 10.0), st.booleans())
def test_what_is_allowed_of_a_twist_is_what_the_controller_goes_for(
    linear_m_s: float, angular_rad_s: float, keep: bool
) -> None:
    """Ramps apart, the answer and the wheels' targets are the same motion."""
    wanted, bounds = Twist2D(linear_m_s, angular_rad_s), limits(keep_curvature=keep)
    allowed = LimitPreview(DRIVE, CHASSIS, bounds).of_twist(wanted)
    targets = reached(Drive(DRIVE, CHASSIS, bounds, (GAINS, GAINS)), wanted)
    assert targets == pytest.approx(wheel_speeds_rad_s(Kinematics(CHASSIS), allowed.command), abs=1e-6)
    assert (allowed.limited_by is None) == (allowed.command == wanted)


@settings(max_examples=examples(50), deadline=None)
@given(st.floats(-30.0, 30.0), st.floats(-30.0, 30.0))
def test_what_is_allowed_of_wheels_is_what_the_controller_goes_for(left: float, right: float) -> None:
    """The same of wheels that are each asked for a speed."""
    drive = Drive(DRIVE, CHASSIS, limits(), (GAINS, GAINS))
    wanted = drive.wheel_velocities({"left": left, "right": right})
    allowed = LimitPreview(DRIVE, CHASSIS, limits()).of_wheels(wanted)
    assert reached(drive, wanted) == pytest.approx(tuple(allowed.command.values()), abs=1e-6)


def test_standing_is_always_allowed() -> None:
    """Even where there is no reverse at all."""
    bounds = limits().model_copy(
        update={"linear": limits().linear.model_copy(update={"max_reverse_m_s": 0.0})}
    )
    allowance = LimitPreview(DRIVE, CHASSIS, bounds)
    assert allowance.of_twist(STANDING) == Allowed(STANDING)
    assert allowance.of_twist(Twist2D(-0.1, 0.0)) == Allowed(Twist2D(-0.0, 0.0), LINEAR)
