"""From the motion that is asked for to the duty of every wheel: limiter, kinematics and the wheels' PIDs in one step.

Two occasions step it. An encoder frame runs everything (``regulate``). A new command between two frames runs what
needs no measurement: limiter, feedforward and the proportional term (``retarget``); integral and derivative wait.

A twist is limited as a twist, and so is what wheels that are each asked for a speed come to together. Where the wheels
of a side differ, that is ramped beside it, until they turn alike again: no setpoint ever jumps.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

from pydantic import Field

from chefbotd.core.commands import RefusalKind, Refused
from chefbotd.core.geometry import STANDING, Motion, Twist2D, WheelVelocities
from chefbotd.core.parameters import Parameters
from chefbotd.motion import pid, reference, rims
from chefbotd.motion.following import followed, heard
from chefbotd.motion.kinematics import ChassisParameters, Kinematics
from chefbotd.motion.limits import AT_REST, LimiterState, MotionLimits, limit
from chefbotd.motion.pid import PidParameters, PidState
from chefbotd.motion.reference import Asked


class DriveParameters(Parameters):
    """``max_rim_speed_m_s`` is what a wheel reaches under load: a motion that needs more is slowed as a whole.

    ``max_duty`` is the bridge's range: no duty beyond it is ever sent, whatever the gains.

    ``response_delay_s`` is by how much the encoders show what the wheels were asked for later than the mean over their
    readings explains: the line both ways, the board's cycle, the motors.

    Wheels behind each other are dragged sideways in a turn: on the spot that takes ``scrub_duty`` of each beyond its
    friction, and in a curve the share of its way over the ground that is sideways, ``scrub_reach_m`` (half the
    wheelbase) from the middle.

    ``longest_step_s`` bounds the time that one step may account for. A wheel whose duty saturates while it lags behind
    slows the twist by ``yield_per_s`` (share of the twist per second), so that the others do not bend the path;
    ``regain_per_s`` gives it back.
    """

    max_rim_speed_m_s: float = Field(default=0.35, gt=0, le=10)
    max_duty: int = Field(default=1023, ge=1, le=32_767)
    response_delay_s: float = Field(default=0.05, ge=0, le=0.5)
    scrub_duty: float = Field(default=0.0, ge=0, le=32_767)
    scrub_reach_m: float = Field(default=0.1, gt=0, le=5)
    longest_step_s: float = Field(default=0.1, gt=0, le=1)
    yield_per_s: float = Field(default=2.0, ge=0, le=100)
    regain_per_s: float = Field(default=0.5, gt=0, le=100)


LEAST_SHARE = 0.2
"""However weak the motors are, this share of the twist is still asked for: below it nothing would move at all."""

STICTION = 1.3
"""A wheel that stands takes up to this many times the friction of one that turns to break loose."""

LAGGING_M_S = 0.02
"""A saturated wheel counts as lagging when its rim is slower than its setpoint by more than this."""


@dataclass(frozen=True, slots=True)
class DriveState:
    """Everything that one step hands to the next; ``stepped_s`` is None until the first.

    ``loose``: the wheels of a side are not set to the same speed, so that ``limiter`` does not say it all.
    """

    pids: tuple[PidState, ...]
    duty: tuple[int, ...]
    limiter: LimiterState = AT_REST
    stepped_s: float | None = None
    share: float = 1.0
    setpoint_m_s: tuple[float, ...] = field(default=())
    acceleration_m_s2: tuple[float, ...] = field(default=())
    loose: bool = False
    asked: reference.History = ()


class Drive:
    """The wheels' controller: pure steps over ``DriveState``; only the gains can be exchanged."""

    def __init__(
        self,
        parameters: DriveParameters,
        chassis: ChassisParameters,
        limits: MotionLimits,
        gains: tuple[PidParameters, ...],
    ) -> None:
        if len(gains) != len(chassis.wheels):
            raise ValueError(f"expected gains for {len(chassis.wheels)} wheels, got {len(gains)}")
        self._parameters, self._limits = parameters, limits
        self._limits_apart = limits.model_copy(update={"keep_curvature": False})
        self._limits_in_step = limits.model_copy(update={"keep_curvature": True})
        self._kinematics = Kinematics(chassis)
        self._names = tuple(wheel.name for wheel in chassis.wheels)
        self._motor_signs = tuple(wheel.motor_sign for wheel in chassis.wheels)
        self._still = (0.0,) * len(gains)
        self.gains = gains
        self.at_rest = DriveState(
            (pid.RESET,) * len(gains),
            (0,) * len(gains),
            setpoint_m_s=self._still,
            acceleration_m_s2=self._still,
        )

    def halt(self, state: DriveState) -> DriveState:
        """Brake now: zero duty, integrators and limiter at zero, so that nothing jumps afterwards."""
        return replace(self.at_rest, stepped_s=state.stepped_s)

    def retarget(self, state: DriveState, target: Motion, now_s: float, *, apart: bool = False) -> DriveState:
        """The command changed, or time passed without an encoder frame: step what needs no measurement.

        ``apart``: the path has no curvature to keep, so neither axis waits for the other.
        """
        state = self._ramp(state, target, now_s, apart)
        if _is_rest(target) and not any(state.setpoint_m_s):
            return self.halt(state)
        wheels = zip(self.gains, state.pids, state.setpoint_m_s, state.acceleration_m_s2, strict=True)
        scrub_duty = self._scrub_duty(state)
        return replace(state, duty=self._duty([pid.preview(*wheel, scrub_duty) for wheel in wheels]))

    def regulate(
        self,
        state: DriveState,
        target: Motion,
        now_s: float,
        velocity_rad_s: tuple[float, ...],
        dt_s: float,
        *,
        measured_over_s: float = 0.0,
        apart: bool = False,
        led: Sequence[tuple[int, int]] = (),
    ) -> DriveState:
        """An encoder frame, board time ``dt_s`` after the one before.

        ``velocity_rad_s`` are the wheels' speeds on the mean over the last ``measured_over_s`` (0: those of now).
        ``led``: wheels whose reading is not to be believed, each with the one that it is driven like.
        """
        delay_s = self._parameters.response_delay_s
        asked = Asked(dt_s, state.setpoint_m_s)
        history = reference.remember(state.asked, asked, measured_over_s + delay_s)
        state = self._ramp(state, target, now_s, apart)
        if _is_rest(target) and not any(state.setpoint_m_s):
            return self.halt(state)
        dt_s = min(dt_s, self._parameters.longest_step_s)
        speeds_m_s = self.rim_speeds_m_s(velocity_rad_s)
        if measured_over_s > 0:
            asked_m_s = reference.mean_m_s(history, measured_over_s, delay_s)
            speeds_m_s = reference.caught_up(speeds_m_s, asked_m_s, state.setpoint_m_s)
        pids = state.pids
        if led:
            pids, speeds_m_s = followed(led, pids), heard(led, speeds_m_s, state.setpoint_m_s)
        wheels = zip(self.gains, pids, state.setpoint_m_s, state.acceleration_m_s2, speeds_m_s, strict=True)
        scrub_duty = self._scrub_duty(state)
        steps = [pid.step(*wheel, dt_s, scrub_duty) for wheel in wheels]
        outputs = tuple([step[1] for step in steps])
        share = self._share_left(state, outputs, speeds_m_s, dt_s)
        return DriveState(
            tuple([step[0] for step in steps]),
            self._duty(outputs),
            state.limiter,
            state.stepped_s,
            share,
            state.setpoint_m_s,
            state.acceleration_m_s2,
            state.loose,
            history,
        )

    def retune(self, state: DriveState, gains: tuple[PidParameters, ...]) -> DriveState:
        """Exchange the gains without a bump in the duty; returns the state to go on with."""
        wheels = zip(self.gains, gains, state.pids, state.setpoint_m_s, state.acceleration_m_s2, strict=True)
        scrub_duty = self._scrub_duty(state)
        pids = tuple(pid.retune(*wheel, scrub_duty) for wheel in wheels)
        self.gains = gains
        return replace(state, pids=pids)

    def wheel_velocities(self, velocity_rad_s: Mapping[str, float]) -> WheelVelocities:
        """A speed for each named wheel as a motion that can be asked for; the others stand.

        Raises:
            Refused: there is no wheel of such a name.
        """
        strangers = [name for name in velocity_rad_s if name not in self._names]
        if strangers:
            told = f"no wheel named {', '.join(map(ascii, strangers))}; there are {', '.join(self._names)}"
            raise Refused(RefusalKind.UNKNOWN_WHEEL, told)
        wanted = tuple([velocity_rad_s.get(name, 0.0) for name in self._names])
        return WheelVelocities(wanted, self._kinematics.twist(wanted))

    def rim_speeds_m_s(self, velocity_rad_s: tuple[float, ...]) -> tuple[float, ...]:
        """Wheel speeds at the rim."""
        return tuple([w * r for w, r in zip(velocity_rad_s, self._kinematics.radii_m, strict=True)])

    def targets_rad_s(self, state: DriveState) -> tuple[float, ...]:
        """What each wheel is asked to turn at."""
        return tuple([v / r for v, r in zip(state.setpoint_m_s, self._kinematics.radii_m, strict=True)])

    def effort(self, state: DriveState) -> tuple[float, ...]:
        """The duty in force per wheel, less what scrubbing may take, as a share of the range; forward is positive."""
        scrub_duty = STICTION * self._scrub_duty(state)
        wheels = zip(state.duty, self._motor_signs, strict=True)
        return tuple(
            [
                math.copysign(max(0.0, abs(duty) - scrub_duty), duty * sign) / self._parameters.max_duty
                for duty, sign in wheels
            ]
        )

    def _scrub_duty(self, state: DriveState) -> float:
        """What the turn that is asked for adds to each wheel's friction; wheels at odds with their mates have none."""
        twist = state.limiter.twist
        if state.loose or not (self._parameters.scrub_duty and twist.angular_rad_s):
            return 0.0
        sideways_m_s = abs(twist.angular_rad_s) * self._parameters.scrub_reach_m
        return self._parameters.scrub_duty * sideways_m_s / math.hypot(twist.linear_m_s, sideways_m_s)

    def _ramp(self, state: DriveState, target: Motion, now_s: float, apart: bool) -> DriveState:
        elapsed_s = 0.0 if state.stepped_s is None else max(0.0, now_s - state.stepped_s)
        dt_s = min(elapsed_s, self._parameters.longest_step_s)
        if _is_rest(target):
            state = replace(state, pids=tuple([pid.let_go(wheel) for wheel in state.pids]))
        if state.loose or isinstance(target, WheelVelocities):
            return self._ramp_wheels(state, target, now_s, dt_s, apart)
        target = self._kinematics.saturate(target, self._parameters.max_rim_speed_m_s)
        if state.share < 1.0:
            target = Twist2D(target.linear_m_s * state.share, target.angular_rad_s * state.share)
        limits = self._limits_apart if apart else self._limits
        limiter = limit(limits, state.limiter, target, dt_s)
        setpoint = self._kinematics.rim_speeds_m_s(limiter.twist)
        acceleration = self._kinematics.rim_speeds_m_s(limiter.acceleration)
        return replace(
            state, limiter=limiter, stepped_s=now_s, setpoint_m_s=setpoint, acceleration_m_s2=acceleration
        )

    def _ramp_wheels(
        self, state: DriveState, target: Motion, now_s: float, dt_s: float, apart: bool
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
        if apart or _is_rest(target):
            limiter = limit(self._limits_apart, state.limiter, aim, dt_s)
            share, pace_s = 1.0, rims.pace_s(axis, differ, aims_differ)
        else:
            pace_s = rims.pace_s(axis, state.setpoint_m_s, aims_m_s)
            limiter = limit(self._limits_in_step, state.limiter, aim, dt_s, pace_s)
            share = rims.progress(state.limiter.twist, limiter.twist, aim)
        share = min(share, dt_s / pace_s) if pace_s > 0 else 1.0
        differs = rims.approach(differ, aims_differ, share)
        loose = not (rims.alike(differs, self._still) and rims.alike(aims_differ, self._still))
        setpoint, acceleration = rims_of(limiter.twist), rims_of(limiter.acceleration)
        if loose:
            setpoint = rims.plus(setpoint, differs)
            change = rims.minus(differs, differ)
            acceleration = rims.plus(acceleration, tuple([one / dt_s for one in change]))
        return replace(
            state,
            limiter=limiter,
            stepped_s=now_s,
            setpoint_m_s=setpoint,
            acceleration_m_s2=acceleration,
            loose=loose,
        )

    def _aims(self, state: DriveState, target: Motion) -> tuple[rims.Rims, Twist2D]:
        """Rim speeds to go for, and the twist they make: as much of the target as speeds and motors allow."""
        if isinstance(target, WheelVelocities):
            aims_m_s, twist = self.rim_speeds_m_s(target.rad_s), target.twist
        else:
            aims_m_s, twist = self._kinematics.rim_speeds_m_s(target), target
        share = state.share * rims.share_of(self._limits, self._parameters.max_rim_speed_m_s, aims_m_s, twist)
        aims_m_s = tuple([aim_m_s * share for aim_m_s in aims_m_s])
        return aims_m_s, Twist2D(twist.linear_m_s * share, twist.angular_rad_s * share)

    def _duty(self, outputs: Sequence[float]) -> tuple[int, ...]:
        most = self._parameters.max_duty
        wheels = zip(outputs, self._motor_signs, strict=True)
        return tuple([min(most, max(-most, round(output))) * sign for output, sign in wheels])

    def _share_left(
        self, state: DriveState, outputs: Sequence[float], speeds_m_s: Sequence[float], dt_s: float
    ) -> float:
        """Slow the whole twist while any wheel cannot keep up with its part of it."""
        change = self._parameters.regain_per_s
        for gains, output, setpoint, speed in zip(
            self.gains, outputs, state.setpoint_m_s, speeds_m_s, strict=True
        ):
            if abs(output) >= gains.output_limit and abs(setpoint) - abs(speed) > LAGGING_M_S:
                change = -self._parameters.yield_per_s
        return min(1.0, max(LEAST_SHARE, state.share + change * dt_s))


def _is_rest(target: Motion) -> bool:
    return not any(target.rad_s) if isinstance(target, WheelVelocities) else target == STANDING
