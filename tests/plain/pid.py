"""A wheel's speed control, a part of the controller a function."""

import math

from chefbotd.core.record import replace
from chefbotd.motion.pid import FADE_S, SHORTEST_S, PidParameters, PidState, feedforward


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
    """The next state and the duty."""
    dt_s = dt_s if dt_s >= SHORTEST_S else 0.0
    seen = _observe(params, state, setpoint_m_s, measured_m_s, dt_s)
    error = setpoint_m_s - measured_m_s
    error = error if abs(error) > params.deadband else 0.0
    other = feedforward(params, setpoint_m_s, acceleration_m_s2, scrub_duty) + _fading(seen, setpoint_m_s)
    other = other + params.kp * error + seen.derivative_duty
    integral = _integrate(params, seen.integral_duty, params.ki * error * dt_s * integral_share, other, dt_s)
    return replace(seen, integral_duty=integral), _clamp(other + integral, params.output_limit)


def _observe(
    params: PidParameters, state: PidState, setpoint_m_s: float, measured_m_s: float, dt_s: float
) -> PidState:
    derivative = state.derivative_duty
    if state.measured_m_s is not None and dt_s > 0:
        change, filter_s = measured_m_s - state.measured_m_s, params.derivative_filter_s
        derivative = (filter_s * derivative - params.kd * change) / (filter_s + dt_s)
    fading = _fading(state, setpoint_m_s) * math.exp(-dt_s / FADE_S)
    return PidState(state.integral_duty, measured_m_s, derivative, setpoint_m_s, fading)


def _fading(state: PidState, setpoint_m_s: float) -> float:
    if state.fading_duty == 0.0 or setpoint_m_s * state.setpoint_m_s <= 0:
        return 0.0
    return state.fading_duty * min(setpoint_m_s / state.setpoint_m_s, 1.0)


def _integrate(params: PidParameters, integral: float, growth: float, other: float, dt_s: float) -> float:
    demand = other + integral
    excess = demand - _clamp(demand, params.output_limit)
    if not (params.conditional_integration and growth * excess > 0):
        integral += growth
    if params.back_calculation_s is not None:
        integral -= excess * min(dt_s / params.back_calculation_s, 1.0)
    return _clamp(integral, params.output_limit if params.integral_limit is None else params.integral_limit)


def _clamp(value: float, limit: float) -> float:
    return min(max(value, -limit), limit)
