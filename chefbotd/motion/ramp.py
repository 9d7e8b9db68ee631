"""Moves one axis from its present speed to a target speed.

Works for metres and radians alike: a speed is in u/s, an acceleration in u/s², a jerk in u/s³. Without a jerk limit
the speed is a ramp. With one it is the time-optimal S-curve of Kroeger and Wahl ("Online Trajectory Generation", IEEE
T-RO 2010) for a target speed: the acceleration rises, holds, and is back at zero as the target is reached. The curve
is followed exactly, so it does not depend on how the time is cut into steps.
"""

import math

from chefbotd.core.record import Record, replace


class AxisLimits(Record, frozen=True):
    """What an axis may do: all > 0 (``max_reverse`` may be 0); a ``jerk`` of infinity is no limit."""

    max_forward: float
    max_reverse: float
    acceleration: float
    deceleration: float
    reverse_acceleration: float
    reverse_deceleration: float
    jerk: float

    def share_of(self, speed: float) -> float:
        """How much of a speed the axis may go, 0 to 1."""
        if -self.max_reverse <= speed <= self.max_forward:
            return 1.0
        return self.max_forward / speed if speed > 0 else -self.max_reverse / speed

    @property
    def fastest_change(self) -> float:
        """The highest of the four accelerations."""
        return max(self.acceleration, self.deceleration, self.reverse_acceleration, self.reverse_deceleration)

    def rate(self, speed: float, direction: float) -> float:
        """The acceleration allowed at a speed for a change up (``direction`` > 0) or down."""
        if speed > 0 or (speed == 0 and direction > 0):
            return self.acceleration if direction > 0 else self.deceleration
        return self.reverse_deceleration if direction > 0 else self.reverse_acceleration

    def slowed(self, share: float, jerk: float) -> "AxisLimits":
        """The same speeds with a share of the accelerations, and another jerk."""
        return replace(
            self,
            acceleration=self.acceleration * share,
            deceleration=self.deceleration * share,
            reverse_acceleration=self.reverse_acceleration * share,
            reverse_deceleration=self.reverse_deceleration * share,
            jerk=jerk,
        )


def advance(
    limits: AxisLimits, speed: float, acceleration: float, target: float, dt_s: float
) -> tuple[float, float]:
    """Speed and acceleration after ``dt_s`` > 0 on the way to the target speed.

    The target is not overshot unless the present acceleration makes that unavoidable within the jerk limit.
    Without one, the acceleration is the mean over the step.
    """
    if math.isinf(limits.jerk):
        reached = _ramp(limits, speed, target, dt_s)
        return reached, (reached - speed) / dt_s
    return _s_curve(limits, speed, acceleration, target, dt_s)


def braking_distance(limits: AxisLimits, top_speed: float, *, forward: bool) -> tuple[float, float]:
    """The speed from which, and how far, an axis rolls until it is at rest, if braking begins at the worst moment.

    Without a jerk limit that is the top speed ``v``: ``v^2 / 2d``. With a jerk limit ``j`` the worst moment is while
    the axis still gains speed at ``a`` (at most ``sqrt(j v)``) and will be at ``v`` when that is over. From ``v - a^2
    / 2j`` it goes ``(v - a^2 / 2j) a / j + a^3 / 3j^2``, and then ``v / 2`` over the ``v / d + d / j`` seconds of
    braking, or ``2 sqrt(v / j)`` where ``d`` is not reached.
    """
    gain = limits.acceleration if forward else limits.reverse_acceleration
    braking = limits.deceleration if forward else limits.reverse_deceleration
    jerk = limits.jerk
    if math.isinf(jerk):
        return top_speed, top_speed**2 / (2 * braking)
    gain = min(gain, math.sqrt(jerk * top_speed))
    speed = top_speed - gain**2 / (2 * jerk)
    gaining = speed * gain / jerk + gain**3 / (3 * jerk**2)
    reached = top_speed >= braking**2 / jerk
    braking_s = top_speed / braking + braking / jerk if reached else 2 * math.sqrt(top_speed / jerk)
    return speed, gaining + top_speed / 2 * braking_s


def _ramp(limits: AxisLimits, speed: float, target: float, dt_s: float) -> float:
    """Brake to zero where the target lies beyond it, then go on with the time that is left."""
    direction = math.copysign(1.0, target - speed)
    if speed < 0 < target or target < 0 < speed:
        braking_s = abs(speed) / limits.rate(speed, direction)
        if braking_s >= dt_s:
            return speed + direction * limits.rate(speed, direction) * dt_s
        speed, dt_s = 0.0, dt_s - braking_s
    change = limits.rate(speed, direction) * dt_s
    return target if abs(target - speed) <= change else speed + direction * change


def _s_curve(
    limits: AxisLimits, speed: float, acceleration: float, target: float, dt_s: float
) -> tuple[float, float]:
    jerk = limits.jerk
    settling = speed + acceleration * abs(acceleration) / (2 * jerk)
    direction = math.copysign(1.0, target - settling)
    # From here on the axis is seen so that it moves upwards.
    speed, acceleration, target = direction * speed, direction * acceleration, direction * target
    cap = limits.rate(direction * speed, direction)
    if speed < 0 < target:
        cap_beyond = limits.rate(0.0, direction)
        crossing = min(cap, cap_beyond, math.sqrt(2 * jerk * target))
        if _meets(acceleration, crossing, -speed, jerk):
            phases = _phases(-speed, acceleration, crossing, cap, jerk)
            speed, acceleration, dt_s = _follow(phases, speed, acceleration, dt_s)
            if dt_s > 0:
                speed, acceleration = 0.0, crossing
        cap = cap_beyond
    if dt_s > 0:
        phases = _phases(target - speed, acceleration, 0.0, cap, jerk)
        speed, acceleration, dt_s = _follow(phases, speed, acceleration, dt_s)
        if dt_s > 0:
            speed, acceleration = target, 0.0
    return direction * speed, direction * acceleration


def _meets(acceleration: float, final: float, distance: float, jerk: float) -> bool:
    """Whether an acceleration can reach ``final`` just as ``distance`` (> 0) of speed has been gained."""
    swing = 2 * jerk * distance
    return acceleration * abs(acceleration) - swing < final * final < acceleration * acceleration + swing


def _phases(
    distance: float, acceleration: float, final: float, cap: float, jerk: float
) -> tuple[tuple[float, float], ...]:
    """The S-curve over a distance of speed: jerk and seconds of its rise to a peak, its hold, its fall."""
    peak = min(cap, math.sqrt(max(jerk * distance + (acceleration * acceleration + final * final) / 2, 0.0)))
    rise_s, fall_s = abs(peak - acceleration) / jerk, (peak - final) / jerk
    gained = (acceleration + peak) / 2 * rise_s + (peak + final) / 2 * fall_s
    hold_s = max(distance - gained, 0.0) / peak if peak > 0 else 0.0
    return (math.copysign(jerk, peak - acceleration), rise_s), (0.0, hold_s), (-jerk, fall_s)


def _follow(
    phases: tuple[tuple[float, float], ...], speed: float, acceleration: float, dt_s: float
) -> tuple[float, float, float]:
    """Speed and acceleration at the end of the time or of the phases, and the time that is left."""
    for jerk, duration_s in phases:
        passed_s = min(duration_s, dt_s)
        speed += (acceleration + jerk * passed_s / 2) * passed_s
        acceleration += jerk * passed_s
        dt_s -= passed_s
    return speed, acceleration, dt_s
