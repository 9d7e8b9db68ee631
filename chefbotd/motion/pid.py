"""Speed control of one wheel: feedforward and a PID controller.

Speeds are of the wheel's rim in m/s, outputs are signed duty in the board's PWM counts. The feedforward is
WPILib's motor model (static friction, speed, acceleration). The feedback takes the derivative of the
measurement, so that a new setpoint does not kick, and stops its integral from winding up by back
calculation and conditional integration (Astrom and Hagglund, "PID Controllers", 3.5).

New gains make no bump. Integral and derivative are kept as outputs, so that a new ``ki`` or ``kd`` changes nothing at
once; what the other gains change the integral takes up (Astrom and Wittenmark, "Computer-Controlled Systems", 3rd ed.,
eq. 8.28: P + I must not depend on the parameters). What it cannot hold fades, as in the transient-free switches of
flight control, and never outlasts the motion: it goes down with the setpoint, and is gone where that is zero.
"""

import math

from pydantic import Field

from chefbotd.core.parameters import Parameters
from chefbotd.core.record import Record, replace


class PidParameters(Parameters):
    """Gains and limits, all per metre per second of rim speed; each short name has the unit in its alias.

    ``ks``, ``kv`` and ``ka`` are the feedforward. An error inside the deadband has no effect. The integral may be as
    large as the output unless it has a limit of its own. ``back_calculation_s`` is the time constant with which a
    clamped output drains the integral (None: it does not); ``conditional_integration`` keeps the integral from growing
    while the output is clamped.
    """

    kp: float = Field(alias="kp_duty_per_m_s", ge=0, le=1e6)
    """Duty for each metre per second that the rim is off."""
    ki: float = Field(alias="ki_duty_per_m", ge=0, le=1e6)
    """Duty for each metre that the rim lags behind: it takes away what is off for long."""
    kd: float = Field(default=0.0, alias="kd_duty_per_m_s2", ge=0, le=1e6)
    """Duty against each metre per second squared that the rim's speed changes by."""
    ks: float = Field(default=0.0, alias="ks_duty", ge=0, le=1e6)
    """Feedforward: the duty that overcomes friction."""
    kv: float = Field(default=0.0, alias="kv_duty_per_m_s", ge=0, le=1e6)
    """Feedforward: duty for each metre per second that is asked for."""
    ka: float = Field(default=0.0, alias="ka_duty_per_m_s2", ge=0, le=1e6)
    """Feedforward: duty for each metre per second squared that is asked for."""
    output_limit: float = Field(alias="output_limit_duty", gt=0, le=1e6)
    """No controller asks for more duty than this."""
    integral_limit: float | None = Field(default=None, alias="integral_limit_duty", ge=0, le=1e6)
    """The most that the integral adds; left out, as much as the output."""
    deadband: float = Field(default=0.0, alias="deadband_m_s", ge=0, le=10)
    """An error smaller than this has no effect."""
    derivative_filter_s: float = Field(default=0.0, ge=0, le=10)
    """The time constant that smooths the derivative; 0: it is not smoothed."""
    back_calculation_s: float | None = Field(default=None, gt=0, le=100)
    """How fast a clamped output drains the integral, as a time constant; left out, it does not."""
    conditional_integration: bool = True


SHORTEST_S = 1e-6
"""A board counts microseconds: between two of its readings passes no shorter time, or none."""

FADE_S = 0.5
"""Time constant with which a bump that new gains would have made, and the integral could not hold, comes after all."""


class PidState(Record, frozen=True):
    """What the controller remembers between encoder frames; ``measured_m_s`` is None before the first.

    ``fading_duty`` is what is left of a change of gains (``retune``), at the last ``setpoint_m_s``.
    """

    integral_duty: float = 0.0
    measured_m_s: float | None = None
    derivative_duty: float = 0.0
    setpoint_m_s: float = 0.0
    fading_duty: float = 0.0


RESET = PidState()


def feedforward(
    params: PidParameters, setpoint_m_s: float, acceleration_m_s2: float, scrub_duty: float = 0.0
) -> float:
    """The duty that a wheel needs to move so, by the motor's model alone; not clamped.

    ``scrub_duty`` is what overcomes the friction that it has now beyond that of driving straight.
    """
    friction = (
        params.ks + scrub_duty if setpoint_m_s > 0 else -params.ks - scrub_duty if setpoint_m_s < 0 else 0.0
    )
    return friction + params.kv * setpoint_m_s + params.ka * acceleration_m_s2


def step(
    params: PidParameters,
    state: PidState,
    setpoint_m_s: float,
    acceleration_m_s2: float,
    measured_m_s: float,
    dt_s: float,
    scrub_duty: float = 0.0,
    integral_share: float = 1.0,
) -> tuple[PidState, float]:
    """Take a measurement ``dt_s`` after the last one: the next state and the duty, within the output limit.

    ``integral_share`` is the part of the integral gain that acts now.

    Where no time has passed, or none that a board can tell, nothing is integrated or differentiated. A clamped output
    lets the integral shrink, not grow, and drains it if asked to. Written in one piece: it runs for every wheel's frame.
    """
    fading_duty, derivative_duty, before_m_s = 0.0, state.derivative_duty, state.measured_m_s
    if dt_s < SHORTEST_S:
        dt_s = 0.0
    elif before_m_s is not None:  # through a first-order low-pass
        filter_s = params.derivative_filter_s
        change_m_s = measured_m_s - before_m_s
        derivative_duty = (filter_s * derivative_duty - params.kd * change_m_s) / (filter_s + dt_s)
    if state.fading_duty:
        fading_duty = _fading(state, setpoint_m_s) * math.exp(-dt_s / FADE_S)
    error_m_s = setpoint_m_s - measured_m_s
    if -params.deadband <= error_m_s <= params.deadband:
        error_m_s = 0.0
    friction = (
        params.ks + scrub_duty if setpoint_m_s > 0 else -params.ks - scrub_duty if setpoint_m_s < 0 else 0.0
    )
    forward_duty = friction + params.kv * setpoint_m_s + params.ka * acceleration_m_s2  # as ``feedforward``
    duty = forward_duty + fading_duty + params.kp * error_m_s + derivative_duty
    limit, integral_duty = params.output_limit, state.integral_duty
    demand, growth = duty + integral_duty, params.ki * error_m_s * dt_s * integral_share
    excess = demand - limit if demand > limit else demand + limit if demand < -limit else 0.0
    if not (params.conditional_integration and growth * excess > 0):
        integral_duty += growth
    if params.back_calculation_s is not None:
        integral_duty -= excess * min(dt_s / params.back_calculation_s, 1.0)
    most = limit if params.integral_limit is None else params.integral_limit
    integral_duty = most if integral_duty > most else -most if integral_duty < -most else integral_duty
    duty += integral_duty
    duty = limit if duty > limit else -limit if duty < -limit else duty
    return PidState(integral_duty, measured_m_s, derivative_duty, setpoint_m_s, fading_duty), duty


def preview(
    params: PidParameters,
    state: PidState,
    setpoint_m_s: float,
    acceleration_m_s2: float,
    scrub_duty: float = 0.0,
    *,
    feedback_follows: bool = True,
) -> float:
    """The duty, within the output limit, for a setpoint that changed between encoder frames.

    The feedforward follows the setpoint at once, and so does the proportional part unless ``feedback_follows`` is
    False; integral and derivative wait for the encoder.
    """
    compared_m_s = setpoint_m_s if feedback_follows else state.setpoint_m_s
    other_duty = _without_integral(params, state, setpoint_m_s, acceleration_m_s2, scrub_duty, compared_m_s)
    return _clamp(other_duty + state.integral_duty, params.output_limit)


def retune(
    old: PidParameters,
    new: PidParameters,
    state: PidState,
    setpoint_m_s: float,
    acceleration_m_s2: float,
    scrub_duty: float = 0.0,
) -> PidState:
    """The state with which new gains put out what the old ones did, as far as the new output limit lets them.

    The integral takes up the difference within its clamp; the rest, and all of it where ``ki`` is zero, fades. So does
    what the derivative put out, if it gets another filter. Where there is nothing to take up, as when both ask for more
    than there is, the state stays as it is. A setpoint of zero lets nothing fade.
    """
    kept = _clamp(preview(old, state, setpoint_m_s, acceleration_m_s2, scrub_duty), new.output_limit)
    most = _integral_limit(new) if new.ki > 0 else 0.0
    is_same_filter = new.derivative_filter_s == old.derivative_filter_s
    is_kept = kept == preview(new, state, setpoint_m_s, acceleration_m_s2, scrub_duty)
    if is_kept and is_same_filter and abs(state.integral_duty) <= most:
        return state
    passing_duty = 0.0 if is_same_filter else state.derivative_duty
    derivative_duty = state.derivative_duty - passing_duty
    bare = PidState(0.0, state.measured_m_s, derivative_duty, setpoint_m_s)
    missing = kept - _without_integral(new, bare, setpoint_m_s, acceleration_m_s2, scrub_duty, setpoint_m_s)
    integral_duty = _clamp(missing - passing_duty, most)
    fading_duty = missing - integral_duty if setpoint_m_s else 0.0
    return replace(bare, integral_duty=integral_duty, fading_duty=fading_duty)


def let_go(state: PidState) -> PidState:
    """The state on the way to rest.

    Of a change of gains that is still fading, a part that drives on is dropped at once; a part that brakes fades with
    the setpoint.
    """
    pushes_on = state.fading_duty * state.setpoint_m_s > 0
    return replace(state, fading_duty=0.0) if pushes_on else state


def _fading(state: PidState, setpoint_m_s: float) -> float:
    """What fades at this setpoint: the less, the nearer it has come to zero, and nothing beyond it."""
    if state.fading_duty == 0.0 or setpoint_m_s * state.setpoint_m_s <= 0:
        return 0.0
    return state.fading_duty * min(setpoint_m_s / state.setpoint_m_s, 1.0)


def _without_integral(
    params: PidParameters,
    state: PidState,
    setpoint_m_s: float,
    acceleration_m_s2: float,
    scrub_duty: float,
    compared_m_s: float,
) -> float:
    """Feedforward, proportional part (of the setpoint ``compared_m_s``) and derivative, and what fades; not clamped."""
    other_duty = feedforward(params, setpoint_m_s, acceleration_m_s2, scrub_duty) + _fading(
        state, setpoint_m_s
    )
    if state.measured_m_s is None:
        return other_duty
    error_m_s = compared_m_s - state.measured_m_s
    if -params.deadband <= error_m_s <= params.deadband:
        error_m_s = 0.0
    return other_duty + params.kp * error_m_s + state.derivative_duty


def _integral_limit(params: PidParameters) -> float:
    return params.output_limit if params.integral_limit is None else params.integral_limit


def _clamp(value: float, limit: float) -> float:
    return min(max(value, -limit), limit)
