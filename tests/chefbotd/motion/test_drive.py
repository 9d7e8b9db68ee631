"""The wheels' controller as a whole."""

import itertools
import math

import msgspec
import pytest

from chefbotd.core.commands import Refused
from chefbotd.core.geometry import STANDING, Motion, Twist2D
from chefbotd.motion.drive import Drive
from chefbotd.motion.drive_state import DriveParameters, DriveState
from chefbotd.motion.kinematics import ChassisParameters
from chefbotd.motion.limits import MotionLimits
from chefbotd.motion.pid import PidParameters

TRACK_M, RADIUS_M = 0.3, 0.05
CHASSIS = ChassisParameters.model_validate(
    {
        "track_width_m": TRACK_M,
        "wheels": [
            {"name": "left", "side": "left", "radius_m": RADIUS_M},
            {"name": "right", "side": "right", "radius_m": RADIUS_M, "motor_sign": -1},
        ],
    }
)
LIMITS = MotionLimits.model_validate(
    {
        "linear": {"max_forward_m_s": 1.0, "acceleration_m_s2": 1.0},
        "angular": {"max_left_rad_s": 5.0, "acceleration_rad_s2": 5.0},
    }
)
GAINS = PidParameters(kp=100.0, ki=50.0, ks=40.0, kv=1000.0, ka=10.0, output_limit=1023.0)


def drive(gains: PidParameters = GAINS, **parameters: float) -> Drive:
    """A controller of two wheels, the right motor wired the other way round."""
    return Drive(
        DriveParameters(max_rim_speed_m_s=0.5, **{"max_duty": 1023, **parameters}),
        CHASSIS,
        LIMITS,
        (gains, gains),
    )


def regulated(
    controller: Drive, state: DriveState, target: Twist2D, seconds: float, rim_m_s: float
) -> DriveState:
    """Encoder frames every 20 ms, the wheels always turning at ``rim_m_s``."""
    start_s = state.stepped_s or 0.0
    for number in range(1, round(seconds / 0.02) + 1):
        now_s = start_s + number * 0.02
        speeds = (rim_m_s / RADIUS_M, rim_m_s / RADIUS_M)
        state = controller.regulate(state, target, now_s, speeds, 0.02)
    return state


def test_a_command_moves_the_duty_before_the_next_encoder_frame():
    """From rest, 10 ms after the last step and with 1 m/s²: 0.01 m/s allowed, so duty is ks + kv v + ka a."""
    controller = drive()
    state = controller.retarget(controller.at_rest, STANDING, 100.0)
    state = controller.retarget(state, Twist2D(0.2, 0.0), 100.01)
    expected = round(40.0 + 1000.0 * 0.01 + 10.0 * 1.0)
    assert state.limiter.twist.linear_m_s == pytest.approx(0.01)
    assert state.duty == (expected, -expected)


def test_between_encoder_frames_integral_and_derivative_wait():
    """Any number of retargets leaves what the PIDs remember untouched."""
    controller = drive()
    state = regulated(controller, controller.at_rest, Twist2D(0.2, 0.0), 1.0, rim_m_s=0.1)
    later = state
    for number in range(1, 6):
        later = controller.retarget(later, Twist2D(0.1, 0.0), state.stepped_s + number * 0.001)
    assert later.pids == state.pids
    assert later.duty != state.duty


def test_the_motor_sign_turns_the_duty_and_nothing_else():
    """A motor wired backwards gets the opposite duty for the same rim speed."""
    controller = drive()
    state = regulated(controller, controller.at_rest, Twist2D(0.2, 0.0), 1.0, rim_m_s=0.2)
    assert state.duty[0] == -state.duty[1] > 0
    assert controller.targets_rad_s(state) == pytest.approx((0.2 / RADIUS_M, 0.2 / RADIUS_M))


def test_turning_in_place_turns_the_wheels_against_each_other():
    """1 rad/s over a track of 0.3 m: the rims go at -0.15 and +0.15 m/s."""
    controller = drive()
    state = regulated(controller, controller.at_rest, Twist2D(0.0, 1.0), 1.0, rim_m_s=0.0)
    assert state.setpoint_m_s == pytest.approx((-0.15, 0.15))


def test_a_twist_beyond_the_wheels_keeps_its_curvature():
    """2 m/s and 4 rad/s would need a rim at 2.6 m/s; at the 0.5 m/s there are, the radius is still half a metre."""
    controller = drive()
    state = regulated(controller, controller.at_rest, Twist2D(2.0, 4.0), 3.0, rim_m_s=0.3)
    twist = state.limiter.twist
    assert max(map(abs, state.setpoint_m_s)) <= 0.5 + 1e-9
    assert twist.linear_m_s / twist.angular_rad_s == pytest.approx(0.5)


def test_a_wheel_that_saturates_slows_the_twist_and_keeps_its_shape():
    """Motors too weak for the speed: at full duty the wheels lag, so the twist gives way down to what they do."""
    weak = GAINS.model_copy(update={"output_limit": 150.0})
    controller = drive(weak)
    state = regulated(controller, controller.at_rest, Twist2D(0.4, 0.4), 1.0, rim_m_s=0.1)
    assert state.saturation_scale < 1.0
    assert state.limiter.twist.linear_m_s / state.limiter.twist.angular_rad_s == pytest.approx(1.0)
    recovered = regulated(controller, state, Twist2D(0.05, 0.05), 3.0, rim_m_s=0.05)
    assert recovered.saturation_scale == 1.0


def test_halting_brakes_at_once_and_forgets_everything():
    """Zero duty without a ramp; limiter and integrators at zero, so that the next start is from rest."""
    controller = drive()
    moving = regulated(controller, controller.at_rest, Twist2D(0.4, 0.0), 1.0, rim_m_s=0.2)
    halted = controller.halt(moving)
    assert halted.duty == (0, 0)
    assert halted.limiter.twist == STANDING
    assert halted.pids == controller.at_rest.pids
    assert halted.stepped_s == moving.stepped_s


def test_coming_to_rest_ramps_down_and_ends_with_a_brake():
    """From 0.2 m/s at 1 m/s² the setpoint is zero after 0.2 s; then duty and integrators are zero too."""
    controller = drive()
    state = regulated(controller, controller.at_rest, Twist2D(0.2, 0.0), 1.0, rim_m_s=0.15)
    halfway = regulated(controller, state, STANDING, 0.1, rim_m_s=0.15)
    assert halfway.limiter.twist.linear_m_s == pytest.approx(0.1)
    at_rest = regulated(controller, halfway, STANDING, 0.14, rim_m_s=0.05)
    assert at_rest.duty == (0, 0)
    assert at_rest.pids == controller.at_rest.pids


def test_a_long_silence_does_not_become_one_big_step():
    """After 10 s without a step the limiter accounts for 0.1 s of them: 0.1 m/s at 1 m/s²."""
    controller = drive()
    state = controller.retarget(controller.at_rest, STANDING, 100.0)
    state = controller.retarget(state, Twist2D(0.5, 0.0), 110.0)
    assert state.limiter.twist.linear_m_s == pytest.approx(0.1)


def test_new_gains_make_no_bump():
    """Doubling kp and ki in mid-drive leaves the duty for the same measurement as it was."""
    controller = drive()
    state = regulated(controller, controller.at_rest, Twist2D(0.2, 0.0), 2.0, rim_m_s=0.15)
    gains = GAINS.model_copy(update={"kp": 200.0, "ki": 100.0})
    retuned = controller.retune(state, (gains, gains))
    after = controller.retarget(retuned, Twist2D(0.2, 0.0), state.stepped_s)
    assert after.duty == state.duty
    assert controller.gains == (gains, gains)


def test_new_gains_on_a_ramp_make_no_bump():
    """Between two frames the setpoint went on and began to accelerate: ten times ka leaves the duty as it is."""
    controller = drive()
    state = regulated(controller, controller.at_rest, Twist2D(0.2, 0.0), 2.0, rim_m_s=0.15)
    ramping = controller.retarget(state, Twist2D(0.5, 0.0), state.stepped_s + 0.01)
    gains = GAINS.model_copy(update={"ka": 100.0})
    retuned = controller.retune(ramping, (gains, gains))
    assert controller.retarget(retuned, Twist2D(0.5, 0.0), ramping.stepped_s).duty == ramping.duty


@pytest.mark.parametrize("direction", [1, -1])
@pytest.mark.parametrize(("kv", "left_duty"), [(0.0, 50), (2000.0, 250)])
def test_a_stop_is_not_held_back_by_what_new_gains_left(direction: int, kv: float, left_duty: int):
    """At 0.2 m/s kv 1000 asked for 200. Without it that fades, and is gone with the stop; what brakes 2000 stays."""
    gains = GAINS.model_copy(update={"kp": 0.0, "ki": 0.0, "ks": 50.0, "ka": 0.0})
    controller = drive(gains)
    ahead = Twist2D(0.2 * direction, 0.0)
    state = regulated(controller, controller.at_rest, ahead, 2.0, rim_m_s=0.2 * direction)
    other = gains.model_copy(update={"kv": kv})
    state = controller.retune(state, (other, other))
    assert controller.retarget(state, ahead, state.stepped_s).duty == (250 * direction, -250 * direction)
    stopping = controller.retarget(state, STANDING, state.stepped_s)
    assert stopping.duty == (left_duty * direction, -left_duty * direction)


def test_closed_loop_reaches_the_speed_that_feedforward_misses():
    """A first-order wheel that reaches only 0.8 of what the feedforward thinks: the integral makes up for it."""
    controller = drive(GAINS.model_copy(update={"ki": 1000.0}))
    state, rims = controller.at_rest, [0.0, 0.0]
    for number in range(500):
        state = controller.regulate(
            state, Twist2D(0.2, 0.3), number * 0.02, tuple(rim / RADIUS_M for rim in rims), 0.02
        )
        for wheel, (duty, sign) in enumerate(zip(state.duty, (1, -1), strict=True)):
            reached = 0.8 * math.copysign(max(0.0, abs(duty) - 40.0), duty * sign) / 1000.0
            rims[wheel] += (reached - rims[wheel]) * 0.3
    assert rims == pytest.approx([0.2 - 0.3 * 0.15, 0.2 + 0.3 * 0.15], abs=0.002)


def test_one_set_of_gains_per_wheel():
    """Too few gains are refused with both numbers."""
    with pytest.raises(ValueError, match="gains for 2 wheels, got 1"):
        Drive(DriveParameters(), CHASSIS, LIMITS, (GAINS,))


def test_no_duty_leaves_the_bridges_range():
    """Gains that ask for 30000: the duty is the 1023 there are, in both directions."""
    wild = GAINS.model_copy(update={"output_limit": 30000.0, "kv": 80000.0})
    controller = drive(wild)
    ahead = regulated(controller, controller.at_rest, Twist2D(0.4, 0.0), 1.0, rim_m_s=0.0)
    assert ahead.duty == (1023, -1023)


FOUR = ChassisParameters.model_validate(
    {
        "track_width_m": TRACK_M,
        "wheels": [
            {"name": f"{end}_{side}", "side": side, "radius_m": RADIUS_M}
            for end in ("front", "rear")
            for side in ("left", "right")
        ],
    }
)


def four_wheels() -> Drive:
    """A controller of two wheels a side."""
    return Drive(DriveParameters(max_rim_speed_m_s=0.5), FOUR, LIMITS, (GAINS,) * 4)


def setpoints(controller: Drive, *story: tuple[Motion, float]) -> list[tuple[float, ...]]:
    """Every setpoint on the way through motions that last so many seconds, a step each 20 ms."""
    state, now_s, seen = controller.at_rest, 0.0, []
    for target, seconds in story:
        for _ in range(round(seconds / 0.02)):
            now_s += 0.02
            state = controller.retarget(state, target, now_s)
            seen.append(state.setpoint_m_s)
    return seen


def test_wheels_go_to_their_own_speeds_and_those_not_named_stand():
    """2 rad/s on a radius of 0.05 m is a rim at 0.1 m/s, at 1 m/s² after 0.1 s; the others stay at zero."""
    controller = four_wheels()
    wanted = controller.wheel_velocities({"rear_left": 2.0})
    seen = setpoints(controller, (wanted, 0.14))
    assert seen[3] == pytest.approx((0.0, 0.0, 0.06, 0.0))  # the first step knows of no time before it
    assert seen[-1] == pytest.approx((0.0, 0.0, 0.1, 0.0))


def test_no_setpoint_jumps_between_wheels_and_twists():
    """Whatever follows what, no rim changes by more than 1 m/s² allows in 20 ms; the twist is reached in the end."""
    controller = four_wheels()
    odd = controller.wheel_velocities({"front_left": 8.0, "rear_right": -6.0})
    seen = setpoints(controller, (Twist2D(0.2, 0.5), 0.5), (odd, 0.15), (Twist2D(0.3, 0.0), 1.0))
    steps = [abs(b - a) for old, new in itertools.pairwise(seen) for a, b in zip(old, new, strict=True)]
    assert max(steps) <= 0.02 * 1.0 + 0.02 * 5.0 * TRACK_M / 2 + 1e-9  # a twist may turn at 5 rad/s² as well
    assert seen[-1] == pytest.approx((0.3,) * 4)


@pytest.mark.parametrize("rest", [STANDING, four_wheels().wheel_velocities({})])
def test_wheels_against_each_other_come_to_rest_each(rest: Motion):
    """Front forward and rear backward make no twist at all, and still every rim is braked, and then zero duty."""
    controller = four_wheels()
    odd = controller.wheel_velocities(
        {"front_left": 4.0, "rear_left": -4.0, "front_right": 4.0, "rear_right": -4.0}
    )
    state = controller.at_rest
    for number in range(20):
        state = controller.retarget(state, odd, number * 0.02)
    assert state.limiter.twist == STANDING
    braking = controller.retarget(state, rest, 0.4)
    assert braking.setpoint_m_s == pytest.approx((0.18, 0.18, -0.18, -0.18))
    for number in range(21, 35):
        braking = controller.retarget(braking, rest, number * 0.02)
    assert (braking.duty, braking.pids) == ((0, 0, 0, 0), controller.at_rest.pids)


def test_too_fast_wheels_are_slowed_in_proportion():
    """20 and 10 rad/s would need rims of 1 and 0.5 m/s: of the 0.5 m/s there are they get 0.5 and 0.25."""
    controller = four_wheels()
    wanted = controller.wheel_velocities({"front_left": 20.0, "rear_left": 10.0})
    assert setpoints(controller, (wanted, 1.0))[-1] == pytest.approx((0.5, 0.0, 0.25, 0.0))


def test_a_wheel_that_is_led_gets_what_its_leader_gets():
    """Its own reading says that it stands, and its own integral would wind up: its duty is its mate's all the same."""
    controller = four_wheels()
    state = controller.at_rest
    for number in range(1, 51):
        state = controller.regulate(
            state, Twist2D(0.2, 0.0), number * 0.02, (0.0, 3.0, 3.0, 3.0), 0.02, substitutes=((0, 2),)
        )
    assert state.duty[0] == state.duty[2] == state.duty[3]
    assert state.pids[0] == state.pids[2]


def test_a_wheel_that_leads_with_a_dead_encoder_does_not_run_away():
    """It reads 0 while the wheel that it leads is beyond the target: nothing winds up in either."""
    controller = four_wheels()
    state = controller.at_rest
    for number in range(1, 51):
        state = controller.regulate(
            state, Twist2D(0.2, 0.0), number * 0.02, (0.0, 9.0, 9.0, 9.0), 0.02, substitutes=((2, 0),)
        )
    assert state.pids[0] == state.pids[2]
    assert state.pids[0].integral_duty == 0.0


def test_wheels_that_are_not_there_are_named():
    """The refusal names all of them, and the wheels there are."""
    with pytest.raises(Refused, match="'middle', 'top'; there are left, right"):
        drive().wheel_velocities({"left": 1.0, "middle": 1.0, "top": 0.0})


def test_a_wheel_that_follows_its_ramp_gets_nothing_but_feedforward():
    """Seen as the mean over 40 ms that ended 40 ms ago, as it was asked then: no error, so ks + kv v + ka a."""
    controller = drive(response_delay_s=0.04)
    state, asked_m_s = controller.at_rest, [0.0, 0.0, 0.0, 0.0]
    for number in range(1, 11):
        seen_m_s = (asked_m_s[-4] + asked_m_s[-3]) / 2
        state = controller.regulate(
            state, Twist2D(1.0, 0.0), number * 0.02, (seen_m_s / RADIUS_M,) * 2, 0.02, measured_over_s=0.04
        )
        asked_m_s.append(state.setpoint_m_s[0])
        assert state.pids[0].integral_duty == pytest.approx(0.0, abs=1e-9)
    assert 0.1 < asked_m_s[-1] < 0.2
    assert state.duty[0] == round(40.0 + 1000.0 * asked_m_s[-1] + 10.0 * 1.0)


def test_a_wheel_that_lags_behind_its_ramp_is_pushed_by_the_lag_alone():
    """Held at 0.2 m/s until any delay is over, seen at 0.15: kp acts on 0.05 m/s, and ki for as long as it lasts."""
    controller = drive(response_delay_s=0.04)
    state = controller.at_rest
    for number in range(1, 51):
        state = controller.regulate(
            state, Twist2D(0.2, 0.0), number * 0.02, (3.0, 3.0), 0.02, measured_over_s=0.04
        )
    before = state.pids[0].integral_duty
    state = controller.regulate(state, Twist2D(0.2, 0.0), 1.02, (3.0, 3.0), 0.02, measured_over_s=0.04)
    assert state.pids[0].integral_duty - before == pytest.approx(50.0 * 0.05 * 0.02)
    assert state.duty[0] == round(40.0 + 1000.0 * 0.2 + 100.0 * 0.05 + state.pids[0].integral_duty)


@pytest.mark.parametrize(
    ("linear_m_s", "angular_rad_s", "share"),
    [(0.0, 1.0, 1.0), (0.0, -1.0, 1.0), (0.3, 0.0, 0.0), (0.2, 1.5, 0.6)],
)
def test_wheels_that_are_dragged_sideways_get_more(linear_m_s: float, angular_rad_s: float, share: float):
    """On the spot all of ``scrub_duty``, straight on none; 0.15 m/s sideways at 0.2 m/s ahead: 0.15 / 0.25 of it."""
    twist = Twist2D(linear_m_s, angular_rad_s)
    feedforward = PidParameters(kp=0.0, ki=0.0, ks=40.0, kv=1000.0, output_limit=1023.0)
    plain, dragged = drive(feedforward), drive(feedforward, scrub_duty=100.0, scrub_reach_m=0.1)
    bare = regulated(plain, plain.at_rest, twist, 2.0, rim_m_s=0.0).duty
    more = regulated(dragged, dragged.at_rest, twist, 2.0, rim_m_s=0.0).duty
    assert [abs(a) - abs(b) for a, b in zip(more, bare, strict=True)] == pytest.approx(
        [100 * share] * 2, abs=1
    )


def test_the_integral_acts_in_full_when_the_setpoint_is_steady():
    """0.1 m/s too slow: 100 * 0.1 m/s * 20 ms = 0.2 duty a step; a tenth until 0.3 s after a start, and a change."""
    integral_only = PidParameters(kp=0.0, ki=100.0, output_limit=1023.0)
    controller = drive(integral_only, integral_settle_s=0.3, response_delay_s=0.02)
    state, grown = controller.at_rest, {}
    for number in range(1, 151):
        target = Twist2D(0.2, 0.0) if number <= 75 else Twist2D(0.3, 0.0)
        before = state.pids[0].integral_duty
        rim_rad_s = (target.linear_m_s - 0.1) / RADIUS_M
        state = controller.regulate(
            state, target, number * 0.02, (rim_rad_s, rim_rad_s), 0.02, measured_over_s=0.08
        )
        grown[number] = state.pids[0].integral_duty - before
    for since, until, expected in ((20, 25, 0.02), (35, 75, 0.2), (90, 95, 0.02), (105, 150, 0.2)):
        assert [grown[n] for n in range(since, until)] == pytest.approx([expected] * (until - since)), since


def test_the_integral_of_a_wheel_that_creeps_stays_slow():
    """Both rims 0.1 m/s too slow: 100 * 0.1 m/s * 20 ms = 0.2 duty a step at 0.026 m/s, a tenth of it at 0.024."""
    integral_only = PidParameters(kp=0.0, ki=100.0, output_limit=1023.0)
    controller = drive(integral_only, integral_settle_s=0.3, response_delay_s=0.02)
    slow_m_s, fast_m_s = 0.024, 0.026
    target = Twist2D((slow_m_s + fast_m_s) / 2, (fast_m_s - slow_m_s) / TRACK_M)
    state = controller.at_rest
    measured_rad_s = ((slow_m_s - 0.1) / RADIUS_M, (fast_m_s - 0.1) / RADIUS_M)
    for number in range(1, 101):
        before = state
        state = controller.regulate(state, target, number * 0.02, measured_rad_s, 0.02, measured_over_s=0.08)
    grown = [
        after.integral_duty - pid.integral_duty for after, pid in zip(state.pids, before.pids, strict=True)
    ]
    assert grown == pytest.approx([0.02, 0.2])


@pytest.mark.parametrize(("cycle_s", "expected"), [(0.1, 1.0), (1.1, 0.1)])
def test_the_integral_stays_slow_with_a_board_that_is_silent_for_a_second_in_each_cycle(
    cycle_s: float, expected: float
):
    """A rim 0.1 m/s too slow: 100 * 0.1 m/s * 0.1 s, the longest step, is 1 duty at 10 Hz, and a tenth of it then."""
    integral_only = PidParameters(kp=0.0, ki=100.0, output_limit=1023.0)
    controller = drive(integral_only, integral_settle_s=0.3, response_delay_s=0.02)
    state, rim_rad_s = controller.at_rest, 0.1 / RADIUS_M
    for number in range(1, 31):
        before = state
        measured_rad_s = (rim_rad_s, rim_rad_s)
        state = controller.regulate(
            state, Twist2D(0.2, 0.0), number * cycle_s, measured_rad_s, cycle_s, measured_over_s=cycle_s
        )
    assert state.setpoint_m_s == pytest.approx((0.2, 0.2))
    assert state.pids[0].integral_duty - before.pids[0].integral_duty == pytest.approx(expected)


def test_effort_is_what_is_pushed_beyond_scrubbing():
    """On the spot at 0.3 m/s of the rims: 40 + 300 + 100 of 1000; less 1.3 times the 100 that scrubbing takes: 0.31."""
    gains = PidParameters(kp=0.0, ki=0.0, ks=40.0, kv=1000.0, output_limit=1000.0)
    controller = drive(gains, scrub_duty=100.0, scrub_reach_m=0.1, max_duty=1000)
    state = regulated(controller, controller.at_rest, Twist2D(0.0, 2.0), 2.0, rim_m_s=0.0)
    assert state.duty == (-440, -440)
    assert controller.effort(state) == pytest.approx((-0.31, 0.31))


def test_a_stop_that_is_over_between_two_frames_leaves_nothing_behind():
    """The integral had grown while the wheels were slow; once the setpoint is zero there is no duty, and no integral."""
    controller = drive()
    state = regulated(controller, controller.at_rest, Twist2D(0.2, 0.1), 1.0, rim_m_s=0.1)
    assert state.pids[0].integral_duty > 0
    for _ in range(50):
        state = controller.retarget(state, STANDING, state.stepped_s + 0.02)
    assert state.duty == (0, 0)
    assert state.pids == controller.at_rest.pids


def test_a_saturated_wheel_that_keeps_up_does_not_slow_the_robot():
    """At full duty, 1 cm/s behind what is asked: less than the 2 cm/s that count as lagging."""
    controller = drive(GAINS.model_copy(update={"output_limit": 150.0}))
    for way in (1.0, -1.0):
        state = regulated(controller, controller.at_rest, Twist2D(0.2 * way, 0.0), 1.0, rim_m_s=0.19 * way)
        assert abs(state.duty[0]) == 150
        assert state.saturation_scale == 1.0


def test_a_state_of_an_old_recording_has_the_first_names_of_its_fields() -> None:
    """``share`` and ``loose`` are what the scale and the differing wheels were recorded as."""
    recorded = b'{"pids":[],"duty":[0,0],"share":0.5,"loose":true}'
    state = msgspec.json.decode(recorded, type=DriveState)
    assert (state.saturation_scale, state.wheels_differ) == (0.5, True)
    assert msgspec.to_builtins(state) | {"share": 0.5, "loose": True} == msgspec.to_builtins(state)
