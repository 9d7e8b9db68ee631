"""Wheel speed control: feedforward, feedback, windup, previews and gains that change without a bump."""

import math

import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from pydantic import ValidationError

from chefbotd.core.record import replace
from chefbotd.motion import pid
from chefbotd.motion.pid import RESET, PidParameters, PidState
from tests.budget import examples

DT_S = 0.1


def parameters(**changes: float | bool | None) -> PidParameters:
    """The published gains: 400 duty per m/s and 100 duty per m, within 1023."""
    return PidParameters.model_validate({"kp": 400, "ki": 100, "output_limit": 1023} | changes)


def run(
    params: PidParameters, setpoint_m_s: float, *measured_m_s: float, state: PidState = RESET
) -> tuple[PidState, list[float]]:
    """Feed measurements that come every ``DT_S``, at a steady setpoint."""
    outputs = []
    for measurement in measured_m_s:
        state, output = pid.step(params, state, setpoint_m_s, 0.0, measurement, DT_S)
        outputs.append(output)
    return state, outputs


def test_proportional_and_integral_by_hand() -> None:
    """0.2 m/s too slow: 400 * 0.2 = 80, and 100 * 0.2 * 0.1 s = 2 more with each step."""
    _, outputs = run(parameters(), 0.3, 0.1, 0.1, 0.1)
    assert outputs == pytest.approx([82, 84, 86])


def test_feedforward_is_friction_speed_and_acceleration() -> None:
    """50 + 2000 * 0.1 + 30 * 0.5 = 265 forward, the mirror image in reverse, and no friction at rest."""
    params = parameters(ks=50, kv=2000, ka=30)
    assert pid.feedforward(params, 0.1, 0.5) == pytest.approx(265)
    assert pid.feedforward(params, -0.1, -0.5) == pytest.approx(-265)
    assert pid.feedforward(params, 0.0, 0.5) == pytest.approx(15)


def test_feedforward_needs_no_measurement() -> None:
    """Before the first encoder frame a preview is the feedforward alone."""
    params = parameters(ks=50, kv=2000)
    assert pid.preview(params, RESET, 0.1, 0.0) == pytest.approx(250)


def test_a_preview_follows_the_setpoint_and_waits_for_the_encoder() -> None:
    """From 0.1 to 0.2 m/s, still measured 0.05: 400 * 0.15 + 1000 * 0.2 on the held integral of 0.5."""
    params = parameters(kv=1000)
    state, _ = run(params, 0.1, 0.05)
    assert state.integral_duty == pytest.approx(0.5)
    assert pid.preview(params, state, 0.2, 0.0) == pytest.approx(60 + 200 + 0.5)


def test_a_step_is_what_a_preview_then_says() -> None:
    """Between frames, with nothing new, the duty does not change."""
    params = parameters(kd=20, kv=1000, derivative_filter_s=0.05)
    state, outputs = run(params, 0.3, 0.1, 0.15, 0.22)
    assert pid.preview(params, state, 0.3, 0.0) == outputs[-1]


def test_the_derivative_brakes_a_rising_measurement() -> None:
    """From 0.1 to 0.2 m/s in 0.1 s is 1 m/s2: a kd of 20 takes 20 off."""
    _, outputs = run(parameters(kp=0, ki=0, kd=20), 0.0, 0.1, 0.2)
    assert outputs == pytest.approx([0, -20])


def test_a_new_setpoint_does_not_kick_the_derivative() -> None:
    """The derivative is of the measurement: a jump of the setpoint leaves it alone."""
    params = parameters(kp=0, ki=0, kd=20)
    state, _ = run(params, 0.0, 0.1, 0.1)
    assert pid.preview(params, state, 5.0, 0.0) == 0.0


def test_the_derivative_is_filtered() -> None:
    """With a filter of 0.3 s a rate of 1 m/s2 shows by 0.1 / (0.3 + 0.1), a quarter, after one step."""
    params = parameters(kp=0, ki=0, kd=20, derivative_filter_s=0.3)
    _, outputs = run(params, 0.0, 0.0, 0.1)
    assert outputs == pytest.approx([0, -5])


def test_an_error_inside_the_deadband_acts_on_nothing() -> None:
    """0.01 m/s off with a deadband of 0.02: no proportional part, and the integral rests."""
    state, outputs = run(parameters(deadband=0.02), 0.1, 0.09, 0.09)
    assert outputs == [0.0, 0.0]
    assert state.integral_duty == 0.0


def test_the_output_is_clamped() -> None:
    """An error of 10 m/s asks for 4000 and gets the limit, in both directions."""
    assert run(parameters(), 10.0, 0.0)[1] == [1023]
    assert run(parameters(), -10.0, 0.0)[1] == [-1023]


def test_the_integral_has_its_own_clamp() -> None:
    """100 duty/m * 1 m/s * 0.1 s = 10 a step, held at 25."""
    state, _ = run(parameters(kp=0, integral_limit=25), 1.0, *[0.0] * 5)
    assert state.integral_duty == 25


def test_without_a_limit_of_its_own_the_integral_ends_at_the_output_limit() -> None:
    """It can carry all of the output, never more."""
    params = parameters(kp=0, conditional_integration=False)
    state, _ = run(params, 100.0, *[0.0] * 5)
    assert state.integral_duty == 1023


def test_conditional_integration_does_not_wind_up() -> None:
    """A wheel that is held while the output is at its limit gathers no integral, and recovers at once."""
    state, _ = run(parameters(kp=4000), 1.0, *[0.0] * 50)
    assert state.integral_duty == 0.0


def test_conditional_integration_lets_the_integral_shrink() -> None:
    """While clamped, an error the other way still counts: 100 * -0.5 * 0.1 = -5 off 200."""
    params = parameters(kp=0, kv=3000)
    state, outputs = run(params, 0.5, 1.0, state=PidState(integral_duty=200))
    assert outputs == [1023]
    assert state.integral_duty == pytest.approx(195)


def test_back_calculation_drains_what_the_clamp_cut_off() -> None:
    """Demand 2000 + 100, limit 1023: of the 1077 too much 0.1 / 0.5 is taken out, after 10 came in."""
    params = parameters(kp=2000, back_calculation_s=0.5, conditional_integration=False)
    state, outputs = run(params, 1.0, 0.0, state=PidState(integral_duty=100))
    assert state.integral_duty == pytest.approx(100 + 10 - 1077 / 5)
    assert outputs == [1023]


def test_back_calculation_takes_no_more_than_all_of_it() -> None:
    """A step longer than the tracking time removes the excess once, not twice."""
    params = parameters(kp=2000, ki=0, back_calculation_s=0.05)
    state, outputs = run(params, 1.0, 0.0)
    assert state.integral_duty == pytest.approx(1023 - 2000)
    assert outputs == [1023]


@pytest.mark.parametrize("dt_s", [0.0, -0.1])
def test_no_time_integrates_nothing(dt_s: float) -> None:
    """Two frames of one stamp: the proportional part is refreshed, integral and derivative wait."""
    params = parameters(kd=20)
    state, _ = run(params, 0.3, 0.1)
    again, output = pid.step(params, state, 0.3, 0.0, 0.2, dt_s)
    assert again.integral_duty == state.integral_duty
    assert again.derivative_duty == state.derivative_duty
    assert output == pytest.approx(400 * 0.1 + 2)


def test_a_new_integral_gain_makes_no_bump() -> None:
    """Ten times the gain: the integral that was gathered stays what it is."""
    old, new = parameters(), parameters(ki=1000)
    state, _ = run(old, 0.3, 0.1, 0.1)
    assert pid.retune(old, new, state, 0.3, 0.0).integral_duty == pytest.approx(state.integral_duty)


gain = st.floats(0, 5000)
limit = st.floats(1, 1500)
gains = st.builds(
    lambda kp, ki, kd, ks, kv, ka, deadband, output, integral, filter_s, drain_s, conditional: parameters(
        kp=kp,
        ki=ki,
        kd=kd,
        ks=ks,
        kv=kv,
        ka=ka,
        deadband=deadband,
        output_limit=output,
        integral_limit=integral,
        derivative_filter_s=filter_s,
        back_calculation_s=drain_s,
        conditional_integration=conditional,
    ),
    gain,
    st.just(0.0) | gain,
    *[gain] * 4,
    st.floats(0, 0.05),
    limit,
    st.none() | limit,
    st.just(0.0) | st.floats(0.01, 1),
    st.none() | st.floats(0.05, 10),
    st.booleans(),
)
speed = st.floats(-0.5, 0.5)
moving = speed.filter(lambda speed_m_s: abs(speed_m_s) > 1e-3)
duty = st.floats(-1000, 1000)


@st.composite
def tunings(draw: st.DrawFn) -> tuple[PidParameters, PidParameters, PidState, float, float]:
    """Old and new gains, any state that the old ones may be in, and the setpoint with its acceleration."""
    old, setpoint_m_s = draw(gains), draw(moving)
    most = old.output_limit if old.integral_limit is None else old.integral_limit
    state = PidState(
        draw(st.floats(-most, most)), draw(st.none() | speed), draw(duty), draw(moving), draw(duty)
    )
    return old, draw(gains), state, setpoint_m_s, draw(speed)


@given(tunings(), gains)
@settings(max_examples=examples(300))
def test_new_gains_make_no_bump(
    tuning: tuple[PidParameters, PidParameters, PidState, float, float], third: PidParameters
) -> None:
    """Whatever gains come, and others after them, whatever the state: the duty for unchanged inputs is the same."""
    old, new, state, setpoint_m_s, acceleration_m_s2 = tuning
    kept = pid.preview(old, state, setpoint_m_s, acceleration_m_s2)
    for before, after in ((old, new), (new, third)):
        kept = min(max(kept, -after.output_limit), after.output_limit)
        state = pid.retune(before, after, state, setpoint_m_s, acceleration_m_s2)
        assert pid.preview(after, state, setpoint_m_s, acceleration_m_s2) == pytest.approx(kept, abs=1e-6)


@given(tunings(), st.floats(0, 0.1))
@settings(max_examples=examples(300))
def test_after_new_gains_only_time_moves_the_duty(
    tuning: tuple[PidParameters, PidParameters, PidState, float, float], dt_s: float
) -> None:
    """The next step, nothing else being new, differs by no more than the integral's growth and what fades in it."""
    old, new, state, setpoint_m_s, acceleration_m_s2 = tuning
    state = pid.retune(old, new, state, setpoint_m_s, acceleration_m_s2)
    kept = pid.preview(new, state, setpoint_m_s, acceleration_m_s2)
    measured_m_s = state.measured_m_s
    assume(measured_m_s is not None)
    _, output = pid.step(new, state, setpoint_m_s, acceleration_m_s2, measured_m_s, dt_s)
    growth = new.ki * abs(setpoint_m_s - measured_m_s) * dt_s
    faded = abs(state.fading_duty) * (1 - math.exp(-dt_s / pid.FADE_S))
    derivative_faded = abs(state.derivative_duty) * (dt_s / (new.derivative_filter_s + dt_s) if dt_s else 0)
    assert abs(output - kept) <= growth + faded + derivative_faded + 1e-6


@given(tunings())
@settings(max_examples=examples(200))
def test_what_fades_never_outlasts_the_motion(
    tuning: tuple[PidParameters, PidParameters, PidState, float, float],
) -> None:
    """At half the setpoint there is half of it, at zero or the other way none, and none comes back."""
    old, new, state, setpoint_m_s, acceleration_m_s2 = tuning
    state = pid.retune(old, new, state, setpoint_m_s, acceleration_m_s2)
    for share in (1.0, 0.5, 0.0, -1.0):
        here_m_s = share * state.setpoint_m_s
        without = replace(state, fading_duty=max(0.0, share) * state.fading_duty, setpoint_m_s=here_m_s)
        assert pid.preview(new, state, here_m_s, 0.0) == pytest.approx(
            pid.preview(new, without, here_m_s, 0.0)
        )
    stopped, _ = pid.step(new, state, 0.0, 0.0, 0.1, DT_S)
    assert stopped.fading_duty == 0.0
    again, _ = pid.step(new, stopped, setpoint_m_s, 0.0, 0.1, DT_S)
    assert again.fading_duty == 0.0


def test_on_the_way_to_rest_nothing_that_fades_pushes_on() -> None:
    """Forward it is gone where it pushes forward, and left where it brakes; in reverse the mirror image."""
    for setpoint_m_s in (0.2, -0.2):
        ahead = PidState(setpoint_m_s=setpoint_m_s, fading_duty=math.copysign(100, setpoint_m_s))
        braking = replace(ahead, fading_duty=-ahead.fading_duty)
        assert pid.let_go(ahead) == replace(ahead, fading_duty=0.0)
        assert pid.let_go(braking) == braking


def test_new_gains_at_a_setpoint_of_zero_leave_nothing_to_fade() -> None:
    """A wheel that is held still: what the integral cannot hold is let go, for it would push against its target."""
    old, new = parameters(kp=4000), parameters(kp=0, integral_limit=30)
    retuned = pid.retune(old, new, PidState(measured_m_s=0.1), 0.0, 0.0)
    assert (retuned.integral_duty, retuned.fading_duty) == (-30, 0)


def test_a_new_derivative_gain_makes_no_bump_later_either() -> None:
    """An unfiltered derivative of -20 is of its moment: with any kd it is gone in the next step, the integral stays."""
    old, new = parameters(kp=0, ki=1, kd=20), parameters(kp=0, ki=1, kd=500)
    state = PidState(integral_duty=100.0, measured_m_s=0.2, derivative_duty=-20.0, setpoint_m_s=0.2)
    retuned = pid.retune(old, new, state, 0.2, 0.0)
    assert pid.preview(new, retuned, 0.2, 0.0) == pytest.approx(80)
    assert run(new, 0.2, 0.2, state=retuned)[1] == [pytest.approx(100)]


def test_gains_changed_at_the_limit_do_not_wind_up() -> None:
    """A demand of 4000 put out 1023: the new gains start at that 1023, with no hidden rest of the 4000."""
    old, new = parameters(), parameters(kp=0, integral_limit=5000)
    state, _ = run(old, 10.0, 0.0)
    retuned = pid.retune(old, new, state, 10.0, 0.0)
    assert (retuned.integral_duty, retuned.fading_duty) == (pytest.approx(1023), pytest.approx(0))


def test_a_smaller_output_limit_is_kept_at_once() -> None:
    """From 1023 to a limit of 500: 500, and nothing is held back for when the demand of 4000 has gone."""
    old, new = parameters(), parameters(output_limit=500)
    state, _ = run(old, 10.0, 0.0)
    retuned = pid.retune(old, new, state, 10.0, 0.0)
    assert pid.preview(new, retuned, 10.0, 0.0) == 500
    assert retuned == state


def test_what_the_integral_cannot_hold_fades() -> None:
    """80 duty of lost proportional part against an integral limit of 30: 50 are left, and 50/e after 0.5 s."""
    old, new = parameters(), parameters(kp=0, ki=1e-9, integral_limit=30)
    state, _ = run(old, 0.3, 0.1)
    state = replace(state, integral_duty=0.0)
    retuned = pid.retune(old, new, state, 0.3, 0.0)
    assert (retuned.integral_duty, retuned.fading_duty) == pytest.approx((30, 50))
    state, outputs = run(new, 0.3, *[0.1] * 5, state=retuned)
    assert outputs[-1] == pytest.approx(30 + 50 / math.e, abs=1e-6)


def test_without_an_integral_nothing_stays_of_one() -> None:
    """``ki`` set to zero while the integral held 300: the duty stays, and within 5 s it is kp times the error alone."""
    old, new = parameters(), parameters(ki=0)
    state = PidState(integral_duty=300.0, measured_m_s=0.2)
    retuned = pid.retune(old, new, state, 0.3, 0.0)
    assert pid.preview(new, retuned, 0.3, 0.0) == pytest.approx(340)
    _, outputs = run(new, 0.3, *[0.2] * 50, state=retuned)
    assert outputs[-1] == pytest.approx(40, abs=0.05)


def test_the_loop_settles_a_motor_at_its_setpoint() -> None:
    """A first-order motor (0.377 m/s at full duty, 0.1 s) reaches 0.2 m/s although a load takes 15 %."""
    params, state, speed_m_s = parameters(ki=3000, kv=1023 / 0.377), RESET, 0.0
    for _ in range(600):
        state, duty = pid.step(params, state, 0.2, 0.0, speed_m_s, 0.02)
        speed_m_s += 0.02 / 0.1 * (0.85 * 0.377 * duty / 1023 - speed_m_s)
    assert speed_m_s == pytest.approx(0.2, abs=0.002)


PERIODS = st.floats(1e-6, 0.2) | st.just(0.0)


@given(st.lists(st.tuples(st.floats(-5, 5), st.floats(-5, 5), PERIODS), max_size=40), st.booleans())
@settings(max_examples=examples(60))
def test_clamps_hold_whatever_happens(
    steps: list[tuple[float, float, float]], conditional_integration: bool
) -> None:
    """Output and integral stay within their limits and finite."""
    params = parameters(
        kd=50, integral_limit=300, back_calculation_s=0.1, conditional_integration=conditional_integration
    )
    state = RESET
    for setpoint_m_s, measured_m_s, dt_s in steps:
        state, output = pid.step(params, state, setpoint_m_s, 0.0, measured_m_s, dt_s)
        assert abs(output) <= 1023
        assert abs(state.integral_duty) <= 300
        assert math.isfinite(state.derivative_duty)


def test_the_configuration_names_the_units() -> None:
    """The long keys of the file and the short names of the API make the same gains."""
    from_file = {
        "kp_duty_per_m_s": 400,
        "ki_duty_per_m": 100,
        "output_limit_duty": 1023,
        "deadband_m_s": 0.01,
    }
    assert PidParameters.model_validate(from_file) == parameters(deadband=0.01)


@pytest.mark.parametrize(
    ("name", "value"),
    [("kp", -1), ("output_limit", 0), ("kd", math.nan), ("back_calculation_s", 0), ("gain", 1)],
)
def test_gains_out_of_range_are_refused(name: str, value: float) -> None:
    """Negative, non-finite and unknown gains never reach a motor."""
    with pytest.raises(ValidationError):
        parameters(**{name: value})


@pytest.mark.parametrize(
    ("setpoint_m_s", "dt_s", "fading_duty"),
    [
        (-0.2, 0.0, -50.0),
        (-0.1, 0.0, -25.0),  # half the setpoint, half of it
        (-0.4, 0.0, -50.0),  # twice the setpoint, no more of it
        (0.0, 0.0, 0.0),
        (0.1, 0.0, 0.0),  # the other way round
        (-0.2, 0.5, -50.0 / math.e),
        (-0.05, 0.25, -12.5 * math.exp(-0.5)),
    ],
)
def test_what_fades_goes_with_time_and_with_the_setpoint(
    setpoint_m_s: float, dt_s: float, fading_duty: float
) -> None:
    """50 duty of a wheel in reverse, left over by new gains: what a step makes of it, and puts out."""
    params = parameters(kp=0, ki=0)
    state = PidState(0.0, -0.2, 0.0, -0.2, -50.0)
    stepped, output = pid.step(params, state, setpoint_m_s, 0.0, -0.2, dt_s)
    assert stepped.fading_duty == pytest.approx(fading_duty)
    assert output == pytest.approx(fading_duty)


def test_what_the_integral_cannot_hold_fades_in_reverse() -> None:
    """Kp 400 on an error of -0.2 m/s was -80 duty: -30 in the integral, -50 to fade, and -80 put out as before."""
    old, new = parameters(), parameters(kp=0, ki=1e-9, integral_limit=30)
    retuned = pid.retune(old, new, PidState(measured_m_s=-0.1, setpoint_m_s=-0.3), -0.3, 0.0)
    assert (retuned.integral_duty, retuned.fading_duty) == pytest.approx((-30, -50))
    assert pid.preview(new, retuned, -0.3, 0.0) == pytest.approx(-80)


def test_a_new_derivative_filter_begins_anew() -> None:
    """What the old filter put out, -20, is no memory of the new one: it fades as a change of gains does."""
    old, new = parameters(kp=0, ki=0, kd=20), parameters(kp=0, ki=0, kd=20, derivative_filter_s=0.1)
    state = PidState(measured_m_s=-0.2, derivative_duty=-20.0, setpoint_m_s=-0.2)
    retuned = pid.retune(old, new, state, -0.2, 0.0)
    assert (retuned.derivative_duty, retuned.fading_duty) == (0.0, pytest.approx(-20))


@pytest.mark.parametrize("measured_m_s", [0.185, 0.215])
def test_a_preview_keeps_the_deadband_too(measured_m_s: float) -> None:
    """15 mm/s off, either way, within 20 mm/s: what was asked for and the integral, nothing of the error."""
    params = parameters(kv=1000, deadband=0.02)
    state = PidState(integral_duty=7.0, measured_m_s=measured_m_s)
    assert pid.preview(params, state, 0.2, 0.0) == pytest.approx(207.0)


@pytest.mark.parametrize("dt_s", [0.0, -0.01, 5e-324, 9e-7])
def test_a_time_that_no_board_can_tell_is_none(dt_s: float) -> None:
    """A change of 0.5 m/s within it would be an endless acceleration: derivative and integral stay as they were."""
    gains = PidParameters(kp=100.0, ki=50.0, kd=2.0, output_limit=255.0)
    state, _ = pid.step(gains, PidState(measured_m_s=0.1, setpoint_m_s=0.3), 0.3, 0.0, 0.2, 0.05)
    after, duty = pid.step(gains, state, 0.3, 0.0, 0.7, dt_s)
    assert (after.derivative_duty, after.integral_duty) == (state.derivative_duty, state.integral_duty)
    assert duty == pytest.approx(100.0 * -0.4 + state.derivative_duty + state.integral_duty)
