"""Computes the present speed of each wheel's rim from the commanded motion: limits, kinematics and ramps.

A twist is limited as a twist, and so is the twist that wheels with speeds of their own make together. Where the wheels
of a side differ, the difference is ramped beside it, until they turn alike again: no setpoint ever jumps.
"""

from collections.abc import Sequence

from msgspec import Struct

from chefbotd.core.geometry import STANDING, Motion, Twist2D, WheelVelocities
from chefbotd.core.record import replace
from chefbotd.motion import pid, rims
from chefbotd.motion.drive_state import MAX_STEP_S, DriveParameters, DriveState
from chefbotd.motion.kinematics import Kinematics
from chefbotd.motion.limits import LimiterState, MotionLimits, limit

Duty = tuple[int, ...]


def under(ceiling: Duty | None, before: DriveState, after: DriveState) -> DriveState:
    """The step ``after``, with no wheel driven harder than ``ceiling``, or backwards (None: no such limit)."""
    if ceiling is None:
        return after
    duty = tuple([_cut(value, most) for value, most in zip(after.duty, ceiling, strict=True)])
    slows = _slows(before.limiter.twist, after.limiter.twist)
    if not slows and _rises(before.setpoint_m_s, after.setpoint_m_s):
        after = replace(
            after,
            limiter=LimiterState(before.limiter.twist),
            setpoint_m_s=before.setpoint_m_s,
            acceleration_m_s2=(0.0,) * len(duty),
        )
    pids = [
        new if given == value else old
        for new, old, given, value in zip(after.pids, before.pids, duty, after.duty, strict=True)
    ]
    return replace(after, duty=duty, pids=tuple(pids))


def _slows(before: Twist2D, after: Twist2D) -> bool:
    """Whether the robot as a whole slows down. On the inside of a curve a wheel may speed up for that."""
    pairs = ((before.linear_m_s, after.linear_m_s), (before.angular_rad_s, after.angular_rad_s))
    return before != after and all(new * old >= 0 and abs(new) <= abs(old) for old, new in pairs)


def _cut(value: int, most: int) -> int:
    if value * most <= 0:
        return 0
    return value if abs(value) <= abs(most) else most


def _rises(before: Sequence[float], after: Sequence[float]) -> bool:
    """Whether a wheel is asked to turn faster, or the other way."""
    return any(new * old < 0 or abs(new) > abs(old) for old, new in zip(before, after, strict=True))


class _Settled(Struct, frozen=True):
    """A twist that was asked for and has been reached, and what follows from it."""

    target: Twist2D
    axes_independent: bool
    limiter: LimiterState
    setpoint_m_s: tuple[float, ...]
    acceleration_m_s2: tuple[float, ...]


class Setpoints:
    """Steps a ``DriveState``'s limiter and setpoints. What follows from a twist that stays is computed once."""

    def __init__(self, parameters: DriveParameters, limits: MotionLimits, kinematics: Kinematics) -> None:
        self._parameters, self._limits, self._kinematics = parameters, limits, kinematics
        self._limits_independent = limits.model_copy(update={"keep_curvature": False})
        self._limits_in_step = limits.model_copy(update={"keep_curvature": True})
        self._still = (0.0,) * len(kinematics.radii_m)
        self._settled: _Settled | None = None

    def step(self, state: DriveState, target: Motion, now_s: float, axes_independent: bool) -> DriveState:
        """The state with the present setpoints; ``axes_independent``: the path has no curvature to keep."""
        settled = self._settled
        if (
            settled is not None
            and state.limiter is settled.limiter
            and target == settled.target
            and axes_independent is settled.axes_independent
            and state.saturation_scale == 1.0
            and not state.wheels_differ
        ):
            setpoint, acceleration = settled.setpoint_m_s, settled.acceleration_m_s2
            return replace(state, stepped_s=now_s, setpoint_m_s=setpoint, acceleration_m_s2=acceleration)
        return self._approach(state, target, now_s, axes_independent)

    def _approach(
        self, state: DriveState, target: Motion, now_s: float, axes_independent: bool
    ) -> DriveState:
        """The state on the way to a motion."""
        elapsed_s = 0.0 if state.stepped_s is None else max(0.0, now_s - state.stepped_s)
        dt_s = min(elapsed_s, MAX_STEP_S)
        if is_rest(target):
            state = replace(state, pids=tuple([pid.let_go(wheel) for wheel in state.pids]))
        if state.wheels_differ or isinstance(target, WheelVelocities):
            return self._step_wheels(state, target, now_s, dt_s, axes_independent)
        asked = target
        target = self._kinematics.saturate(target, self._parameters.max_rim_speed_m_s)
        if state.saturation_scale < 1.0:
            target = Twist2D(
                target.linear_m_s * state.saturation_scale, target.angular_rad_s * state.saturation_scale
            )
        limits = self._limits_independent if axes_independent else self._limits
        limiter = limit(limits, state.limiter, target, dt_s)
        setpoint = self._kinematics.rim_speeds_m_s(limiter.twist)
        acceleration = self._kinematics.rim_speeds_m_s(limiter.acceleration)
        if limiter is state.limiter and dt_s > 0 and state.saturation_scale == 1.0 and not is_rest(asked):
            self._settled = _Settled(asked, axes_independent, limiter, setpoint, acceleration)
        return replace(
            state, limiter=limiter, stepped_s=now_s, setpoint_m_s=setpoint, acceleration_m_s2=acceleration
        )

    def _step_wheels(
        self, state: DriveState, target: Motion, now_s: float, dt_s: float, axes_independent: bool
    ) -> DriveState:
        """The twist that the wheels make as any other, and how the wheels of a side differ in step with it."""
        if dt_s <= 0:
            return replace(state, stepped_s=now_s)
        axis, rims_of = self._limits.linear.axis, self._kinematics.rim_speeds_m_s
        aims_m_s, aim = self._aims(state, target)
        differ, aims_differ = (
            rims.minus(state.setpoint_m_s, rims_of(state.limiter.twist)),
            rims.minus(aims_m_s, rims_of(aim)),
        )
        if axes_independent or is_rest(target):
            limiter = limit(self._limits_independent, state.limiter, aim, dt_s)
            share, pace_s = 1.0, rims.pace_s(axis, differ, aims_differ)
        else:
            pace_s = rims.pace_s(axis, state.setpoint_m_s, aims_m_s)
            limiter = limit(self._limits_in_step, state.limiter, aim, dt_s, pace_s)
            share = rims.progress(state.limiter.twist, limiter.twist, aim)
        share = min(share, dt_s / pace_s) if pace_s > 0 else 1.0
        differs = rims.approach(differ, aims_differ, share)
        wheels_differ = not (rims.alike(differs, self._still) and rims.alike(aims_differ, self._still))
        setpoint, acceleration = rims_of(limiter.twist), rims_of(limiter.acceleration)
        if wheels_differ:
            setpoint = rims.plus(setpoint, differs)
            change = rims.minus(differs, differ)
            acceleration = rims.plus(acceleration, tuple([one / dt_s for one in change]))
        return replace(
            state,
            limiter=limiter,
            stepped_s=now_s,
            setpoint_m_s=setpoint,
            acceleration_m_s2=acceleration,
            wheels_differ=wheels_differ,
        )

    def _aims(self, state: DriveState, target: Motion) -> tuple[rims.Rims, Twist2D]:
        """Rim speeds to go for, and the twist they make: as much of the target as speeds and motors allow."""
        if isinstance(target, WheelVelocities):
            aims_m_s, twist = self._kinematics.rims_at_m_s(target.rad_s), target.twist
        else:
            aims_m_s, twist = self._kinematics.rim_speeds_m_s(target), target
        share = state.saturation_scale * rims.share_of(
            self._limits, self._parameters.max_rim_speed_m_s, aims_m_s, twist
        )
        aims_m_s = tuple([aim_m_s * share for aim_m_s in aims_m_s])
        return aims_m_s, Twist2D(twist.linear_m_s * share, twist.angular_rad_s * share)


def is_rest(target: Motion) -> bool:
    """Whether this asks for no motion at all."""
    return not any(target.rad_s) if isinstance(target, WheelVelocities) else target == STANDING
