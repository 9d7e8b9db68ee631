"""The motors' models: the feedforward that inverts the sampled plant, by direction, and the battery's voltage."""

import math

import pytest

from chefbotd.core.geometry import STANDING, Twist2D
from chefbotd.core.record import replace
from chefbotd.motion import held
from chefbotd.motion.drive import Drive
from chefbotd.motion.drive_state import DriveParameters, DriveState
from chefbotd.motion.motor_model import accelerations_m_s2, direct_gains
from chefbotd.motion.pid import PidParameters, feedforward
from tests.chefbotd.motion.test_drive import CHASSIS, LIMITS, RADIUS_M

GAINS = PidParameters(kp=100.0, ki=0.0, ks=1.0, kv=1.0, ka=1.0, output_limit=1023.0)


def motor(dead_zone: float, gain: float, lag_s: float) -> dict[str, float]:
    """A motor in one direction."""
    return {"dead_zone_duty": dead_zone, "gain_rad_s_per_duty": gain, "time_constant_s": lag_s}


MOTORS = {
    name: {"forward": motor(20.0, 0.04, 0.1), "reverse": motor(30.0, 0.05, 0.1)} for name in ("left", "right")
}
"""At a radius of 0.05 m: 500 duty for 1 m/s forward, 400 in reverse."""


def drive(**parameters: object) -> Drive:
    """A controller that knows its motors."""
    given = {"max_rim_speed_m_s": 1.0, "max_duty": 1023, "motors": MOTORS, **parameters}
    return Drive(DriveParameters.model_validate(given), CHASSIS, LIMITS, (GAINS, GAINS))


def stepped(
    controller: Drive, state: DriveState, target: Twist2D, now_s: float, rim_m_s: float
) -> DriveState:
    """A reading 50 ms after the last one, of wheels that turn so fast."""
    return controller.regulate(state, target, now_s, (rim_m_s / RADIUS_M,) * 2, 0.05)


@pytest.mark.parametrize("lag_s", [0.03, 0.09, 0.3])
def test_each_command_takes_the_sampled_plant_to_its_setpoint(lag_s: float):
    """A first-order motor, driven for 50 ms by each duty, is at each setpoint of a ramp when that is over."""
    model = {"forward": motor(20.0, 0.04, lag_s), "reverse": motor(20.0, 0.04, lag_s)}
    gains = direct_gains(
        GAINS, DriveParameters.model_validate({"motors": {"left": model}}).motors["left"], 0.05
    )
    speed_m_s = held_m_s = 0.0
    for setpoint_m_s in (0.05, 0.1, 0.15, 0.17, 0.17, 0.12):
        (rate,) = accelerations_m_s2([gains.forward], [held_m_s], [setpoint_m_s], 0.05, 9.0)
        duty = feedforward(gains.forward, setpoint_m_s, rate)
        steady_m_s = (duty - 20.0) * 0.04 * 0.05
        speed_m_s = steady_m_s + (speed_m_s - steady_m_s) * math.exp(-0.05 / lag_s)
        assert speed_m_s == pytest.approx(setpoint_m_s, rel=0.02)
        held_m_s = setpoint_m_s


@pytest.mark.parametrize(("speed_m_s", "duty"), [(0.2, 20 + 500 * 0.2), (-0.2, -30 - 400 * 0.2)])
def test_a_steady_speed_gets_the_duty_of_its_direction(speed_m_s: float, duty: float):
    """Dead zone plus speed over gain, by hand; the gains' own ks, kv and ka play no part."""
    controller = drive()
    state = controller.retarget(controller.at_rest, STANDING, 0.0)
    for step in range(1, 21):
        state = stepped(controller, state, Twist2D(speed_m_s), step * 0.05, speed_m_s)
    assert state.duty == (round(duty), -round(duty))  # the right motor is wired the other way round


def test_the_duty_makes_up_for_the_battery():
    """Models of 12 V at 10 V: 120 duty becomes 144. A reading of 3 V is an error of its measurement: nothing changes."""
    controller = drive(motor_voltage_v=12.0)
    state = controller.retarget(controller.at_rest, STANDING, 0.0)
    for step in range(1, 101):
        state = controller.compensate(controller.compensate(state, 10.0), 3.0)
        state = stepped(controller, state, Twist2D(0.2), step * 0.05, 0.2)
    assert state.duty == (144, -144)


def test_without_a_voltage_of_the_models_nothing_is_made_up_for():
    """The battery's voltage is then not looked at."""
    controller = drive()
    assert not controller.makes_up_for_voltage
    assert controller.compensate(controller.at_rest, 10.0) is controller.at_rest


def test_a_command_between_readings_moves_the_feedforward_alone():
    """At 0.2 m/s and in error: 25 ms later 0.225 m/s is asked for, which the model reaches within the cycle of 50 ms.

    The error stays that of the last reading, so the duty grows by 500 * 0.025 / (1 - exp(-0.5)), and not by kp more.
    """
    controller = drive(integral_settle_s=0.2)
    state = controller.retarget(controller.at_rest, STANDING, 0.0)
    for step in range(1, 21):
        state = stepped(controller, state, Twist2D(0.2), step * 0.05, 0.19)
    assert state.duty[0] == round(120 + 100 * 0.01)
    sooner = controller.retarget(state, Twist2D(0.5), 1.025)
    assert sooner.duty[0] == pytest.approx(121 + 500 * 0.025 / -math.expm1(-0.5), abs=1)


def test_what_was_written_just_before_a_reading_was_not_obeyed_yet():
    """A command 4 ms before a reading: the next one begins from the speed before it, and so asks for more."""
    controller = drive()
    state = controller.retarget(controller.at_rest, STANDING, 0.0)
    state = controller.regulate(state, STANDING, 0.05, (0.0, 0.0), 0.05)
    early = controller.retarget(state, Twist2D(0.2), 0.08)
    late = controller.retarget(state, Twist2D(0.2), 0.096)
    assert stepped(controller, early, Twist2D(0.2), 0.1, 0.0).held_m_s == early.setpoint_m_s != (0.0, 0.0)
    assert stepped(controller, late, Twist2D(0.2), 0.1, 0.0).held_m_s == (0.0, 0.0)


def test_every_wheel_has_a_model_or_none_has():
    """One wheel by its model and the other by gains would bend every path."""
    with pytest.raises(ValueError, match=r"drive.motors must name every wheel \(left, right\), got left$"):
        drive(motors={"left": MOTORS["left"]})


def test_new_gains_make_no_jump_with_models_either():
    """Twice the proportional gain at an error: the duty stays where it is."""
    controller = drive()
    state = controller.retarget(controller.at_rest, STANDING, 0.0)
    for step in range(1, 21):
        state = stepped(controller, state, Twist2D(0.2), step * 0.05, 0.15)
    more = GAINS.model_copy(update={"kp": 200.0})
    after = controller.retune(state, (more, more))
    assert controller.retarget(after, Twist2D(0.2), 1.0).duty == state.duty


def test_the_echo_says_from_which_setpoint_the_models_begin():
    """Of three offers the board has read the second; an echo of none of them changes nothing, zero is rest."""
    controller = drive()
    state = controller.retarget(controller.at_rest, STANDING, 0.0)
    offers = []
    for step in (1, 2, 3):
        state = held.offer_duty(stepped(controller, state, Twist2D(0.5), step * 0.05, 0.0))
        offers.append((tuple(map(float, state.duty)), state.setpoint_m_s))
    echoed, setpoint_m_s = offers[1]
    assert state.held_m_s == setpoint_m_s
    assert held.obey_duty(state, offers[0][0]).held_m_s == offers[0][1]
    assert held.obey_duty(state, echoed) is state
    assert held.obey_duty(state, (1.0, 2.0)) is state
    assert held.obey_duty(state, (0.0, 0.0)).held_m_s == (0.0, 0.0)
    fast = replace(state, cycle_s=0.005)  # it has read more by the time its echo is here
    assert held.obey_duty(fast, offers[0][0]) is fast


def test_a_cycle_that_is_mistaken_for_a_shorter_one_makes_no_jolt():
    """Two readings 0.1 ms apart, 20 ms later a command: the limits' acceleration, 1.75, counts at most twice."""
    controller = drive()
    state = controller.retarget(controller.at_rest, STANDING, 0.0)
    for step in range(1, 11):
        state = stepped(controller, state, Twist2D(0.2), step * 0.05, 0.2)
    state = controller.regulate(state, Twist2D(0.2), 0.5001, (4.0, 4.0), 0.0001)
    state = controller.retarget(state, Twist2D(0.5), 0.5201)
    assert state.setpoint_m_s[0] == pytest.approx(0.22)
    assert state.acceleration_m_s2[0] == pytest.approx(3.5, rel=0.01)
