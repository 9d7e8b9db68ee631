"""What is held against a wheel, a bound a line: stalled or reversed (``push``), and too fast (``add``)."""

from chefbotd.safety import wheels
from chefbotd.safety.overspeed import LEAP_SHARE, Excess, OverspeedParameters
from chefbotd.safety.wheels import FULL_WEIGHT_SHARE, LEAP_S, PushedWheel, WheelWatchParameters


def push(
    params: WheelWatchParameters,
    before: PushedWheel,
    effort: float,
    travel_rad: float,
    dt_s: float,
    play_rad: float,
) -> PushedWheel:
    """A reading later."""
    reached = before.play_rad + travel_rad
    play = min(max(reached, -play_rad / 2), play_rad / 2)
    moved = reached - play
    direction = 1 if effort > 0 else -1 if effort < 0 else before.direction
    coast_s = before.coast_s
    if direction != before.direction:
        coast_s = params.coast_s if before.direction else 0.0
    ahead = direction * moved
    rolls_on = ahead < 0 < coast_s
    driven = abs(effort) >= params.driven_duty_share
    if driven:
        pushed_s = before.pushed_s + max(1.0, (effort / FULL_WEIGHT_SHARE) ** 2) * dt_s
        most = params.reversed_rad * max(wheels.LEAP_SHARE, dt_s / LEAP_S)
        against = max(0.0, before.against_rad + min(0.0 if rolls_on else -ahead, most))
    else:
        pushed_s = max(0.0, before.pushed_s - dt_s / params.decay_s * params.stalled_s)
        against = max(0.0, before.against_rad - dt_s / params.decay_s * params.reversed_rad)
    if driven and not rolls_on and ahead <= -params.turned_rad:
        pushed_s += before.cleared_s
    turned = max(0.0, before.turned_rad + (abs(moved) if rolls_on or not driven else ahead))
    cleared_s = 0.0
    if pushed_s == 0.0 or turned >= params.turned_rad:
        cleared_s = pushed_s
        pushed_s = turned = 0.0
    coast_s = coast_s - dt_s if rolls_on else 0.0
    return PushedWheel(direction, pushed_s, turned, against, coast_s, play, cleared_s)


def add(
    params: OverspeedParameters, before: Excess, asked_m_s: float, travel_m: float, dt_s: float
) -> Excess:
    """A reading of a wheel that is driven."""
    allowed_m_s = max(before.asked_m_s, asked_m_s) * (1 + params.share) + params.margin_m_s
    leap_m, least_m = params.excess_m * LEAP_SHARE, -allowed_m_s * params.stamp_error_s
    ahead = max(least_m, before.ahead_m + min(leap_m, travel_m - allowed_m_s * dt_s))
    back = max(least_m, before.back_m + min(leap_m, -travel_m - allowed_m_s * dt_s))
    beyond = max(before.ahead_m, before.back_m) > params.excess_m and max(ahead, back) > params.excess_m
    lasted_s = before.lasted_s + dt_s if beyond else max(0.0, before.lasted_s - dt_s)
    slowed_m_s = max(asked_m_s, before.asked_m_s - params.braking_m_s2 * dt_s)
    if max(ahead, back) <= 0 and not lasted_s:
        return Excess(slowed_m_s, ahead, back)
    worst = (before.measured_m_s, before.allowed_m_s, before.worst_asked_m_s)
    if abs(travel_m) / dt_s - allowed_m_s > abs(before.measured_m_s) - before.allowed_m_s:
        worst = (travel_m / dt_s, allowed_m_s, max(before.asked_m_s, asked_m_s))
    return Excess(slowed_m_s, ahead, back, lasted_s, *worst)
