"""From the commanded motion to the duty of every wheel: limiter, kinematics and the wheels' PIDs in one step.

There are two kinds of step. An encoder frame runs everything (``regulate``). A new command between two frames runs
what needs no measurement: limiter, feedforward and the proportional term (``retarget``). Integral and derivative wait
for the next frame.
"""

import math
from collections.abc import Iterable, Mapping, Sequence
from operator import mul, truediv
from typing import TypeAlias

from chefbotd.core.geometry import Motion, WheelDuties, WheelVelocities
from chefbotd.core.record import replace
from chefbotd.motion import held, pid, reference
from chefbotd.motion.drive_state import MAX_STEP_S, SATURATION_RECOVERY_PER_S, DriveParameters, DriveState
from chefbotd.motion.encoder import LOST_LINES_S
from chefbotd.motion.kinematics import ChassisParameters, Kinematics
from chefbotd.motion.limits import MotionLimits
from chefbotd.motion.motor_model import MotorModels, accelerations_m_s2
from chefbotd.motion.pid import PidParameters, PidState
from chefbotd.motion.reference import Asked
from chefbotd.motion.same_side import loop_speeds, substitute_readings
from chefbotd.motion.setpoints import Setpoints, is_rest
from chefbotd.motion.wheel_commands import by_duty, by_speed

LAGGING_M_S = 0.02
"""A saturated wheel counts as lagging when its rim is slower than its setpoint by more than this."""

Wheel: TypeAlias = tuple[PidParameters, PidState, float, float, float]
"""Gains, state, setpoint, acceleration and measured speed of one wheel's controller; metres at the rim."""

LEAST_SHARE = 0.2
"""However weak the motors are, this share of the twist is still asked for: below it nothing would move at all."""

STICTION = 1.3
"""A wheel that stands takes up to this many times the friction of one that turns to break loose."""

UNSETTLED_SHARE = 0.1
"""Of the integral gain, while the wheels may still be on their way to a setpoint that has changed, or creep.

So too with a board that is silent for a second in each cycle: the error is one of a second ago.
"""

CREEPING_M_S = 0.025
"""Below this setpoint friction holds a wheel and lets it go by turns: a fast integral would make it jump.

The wheel on the inside of a tight circle creeps for as long as the circle lasts.
"""

RIM_ACCELERATION_SHARE = 2.0
"""Of what the limits allow: when the board missed a command, its next one has the acceleration of two cycles."""


class Drive:
    """The wheels' controller: pure steps over ``DriveState``; gains and limits can be exchanged."""

    def __init__(
        self,
        parameters: DriveParameters,
        chassis: ChassisParameters,
        limits: MotionLimits,
        gains: tuple[PidParameters, ...],
    ) -> None:
        if len(gains) != len(chassis.wheels):
            raise ValueError(f"expected gains for {len(chassis.wheels)} wheels, got {len(gains)}")
        self._parameters = parameters
        self._kinematics = Kinematics(chassis)
        self.relimit(limits)
        self._names = tuple(wheel.name for wheel in chassis.wheels)
        self._motor_signs = tuple(wheel.motor_sign for wheel in chassis.wheels)
        self._still = (0.0,) * len(gains)
        self._motors = MotorModels(parameters.motors, self._names, self._kinematics.radii_m)
        self.knows_its_motors = self._motors.are_known
        self.gains = gains
        self.at_rest = DriveState(
            (pid.RESET,) * len(gains),
            (0,) * len(gains),
            setpoint_m_s=self._still,
            acceleration_m_s2=self._still,
            held_m_s=self._still,
        )

    def halt(self, state: DriveState) -> DriveState:
        """Brake now: zero duty, integrators and limiter at zero, so that the next motion begins without a jump."""
        return replace(
            self.at_rest,
            stepped_s=state.stepped_s,
            cycle_s=state.cycle_s,
            supply_share=state.supply_share,
        )

    @property
    def gains(self) -> tuple[PidParameters, ...]:
        """The gains of each wheel."""
        return self._gains

    @gains.setter
    def gains(self, gains: tuple[PidParameters, ...]) -> None:
        self._gains, self._directed = gains, self._motors.directed(gains)

    def _towards(self, state: DriveState) -> tuple[PidParameters, ...]:
        """The gains of each wheel in the direction in which it turns."""
        wheels = zip(self._directed, state.setpoint_m_s, state.held_m_s, strict=True)
        return tuple([pair.reverse if (now or before) < 0 else pair.forward for pair, now, before in wheels])

    def retarget(
        self, state: DriveState, target: Motion, now_s: float, *, axes_independent: bool = False
    ) -> DriveState:
        """The command changed, or time passed without an encoder frame: step what needs no measurement.

        ``axes_independent``: the path has no curvature to keep, so neither axis waits for the other.
        """
        earlier_m_s = state.setpoint_m_s
        state = self._setpoints.step(state, target, now_s, axes_independent)
        if is_rest(target) and not any(state.setpoint_m_s):
            return self.halt(state)
        gains = self._gains
        if self.knows_its_motors:
            gains = self._towards(state)
            accelerations = self._accelerations(gains, state.held_m_s, state, state.cycle_s)
            state = replace(state, acceleration_m_s2=accelerations, earlier_m_s=earlier_m_s)
        wheels = zip(gains, state.pids, state.setpoint_m_s, state.acceleration_m_s2, strict=True)
        scrub_duty, follows = self._scrub_duty(state), not self.knows_its_motors
        share = state.supply_share
        outputs = [share * pid.preview(*wheel, scrub_duty, feedback_follows=follows) for wheel in wheels]
        return replace(state, duty=self._duty(outputs), by_duty=False)

    def _accelerations(
        self, gains: tuple[PidParameters, ...], held_m_s: tuple[float, ...], state: DriveState, cycle_s: float
    ) -> tuple[float, ...]:
        """The accelerations that take each motor's model to its setpoint within the board's cycle."""
        if held_m_s == state.setpoint_m_s or cycle_s < pid.SHORTEST_S:
            return self._still
        return accelerations_m_s2(gains, held_m_s, state.setpoint_m_s, cycle_s, self._most_m_s2)

    @property
    def makes_up_for_voltage(self) -> bool:
        """Whether the duty depends on the battery's voltage."""
        return self.knows_its_motors and self._parameters.motor_voltage_v is not None

    def compensate(self, state: DriveState, voltage_v: float) -> DriveState:
        """The battery has this voltage: the duty is to make up for it, within bounds and not at once."""
        return held.compensate_voltage(state, self._parameters.motor_voltage_v, voltage_v)

    def regulate(
        self,
        state: DriveState,
        target: Motion,
        now_s: float,
        velocity_rad_s: tuple[float, ...],
        dt_s: float,
        *,
        measured_over_s: float = 0.0,
        axes_independent: bool = False,
        substitutes: Sequence[tuple[int, int]] = (),
        obeyed_m_s: tuple[float, ...] | None = None,
    ) -> DriveState:
        """A step after an encoder frame, board time ``dt_s`` after the one before.

        ``velocity_rad_s`` are the mean speeds of the wheels over the last ``measured_over_s`` (0: their present
        speeds). ``substitutes`` are wheels whose reading is not believed, each with the one that it is driven like.
        ``obeyed_m_s`` is what the commands in force asked for meanwhile, where that is not the last setpoint.
        """
        delay_s = self._parameters.response_delay_s
        reached_m_s = mean_m_s = state.setpoint_m_s
        if self.knows_its_motors:
            reached_m_s = held.reached_m_s(state, now_s)
            mean_m_s = reference.midway(state.held_m_s, reached_m_s)
        if obeyed_m_s is not None:
            mean_m_s = obeyed_m_s
        cycle_s = dt_s if dt_s >= pid.SHORTEST_S else state.cycle_s
        history = reference.remember(state.asked, Asked(dt_s, mean_m_s), measured_over_s + delay_s)
        state = self._setpoints.step(state, target, now_s, axes_independent)
        setpoint_m_s = state.setpoint_m_s
        if not any(setpoint_m_s) and is_rest(target):
            return self.halt(replace(state, cycle_s=cycle_s))
        gains, accelerations = self._gains, state.acceleration_m_s2
        if self.knows_its_motors:
            gains = self._towards(state)
            accelerations = self._accelerations(gains, reached_m_s, state, cycle_s)
        speeds_m_s = self._kinematics.rims_at_m_s(velocity_rad_s)
        is_silent, dt_s = dt_s > LOST_LINES_S, min(dt_s, MAX_STEP_S)
        steady_s, shares = 0.0, (1.0, 1.0)
        if measured_over_s > 0:
            asked_m_s = reference.mean_m_s(history, measured_over_s, delay_s)
            speeds_m_s = reference.caught_up(speeds_m_s, asked_m_s, setpoint_m_s)
            if not is_silent and reference.is_steady(asked_m_s, setpoint_m_s):
                steady_s = state.steady_s + dt_s
            shares = self._shares(steady_s)
        pids = state.pids
        if substitutes:
            pids = substitute_readings(substitutes, pids)
            speeds_m_s = loop_speeds(substitutes, speeds_m_s, setpoint_m_s)
        wheels = zip(gains, pids, setpoint_m_s, accelerations, speeds_m_s, strict=True)
        stepped, outputs = self._step_wheels(wheels, state, dt_s, shares)
        share = self._share_left(state, outputs, speeds_m_s, dt_s)
        return DriveState(
            stepped,
            self._duty(outputs),
            state.limiter,
            state.stepped_s,
            share,
            setpoint_m_s,
            accelerations,
            state.wheels_differ,
            history,
            steady_s,
            reached_m_s,
            cycle_s,
            state.supply_share,
            (),
            state.offered,
        )

    def _shares(self, steady_s: float) -> tuple[float, float]:
        """The shares of the integral gain: of a wheel that creeps, and of any other."""
        settle_s, others = self._parameters.integral_settle_s, 1.0
        if steady_s < settle_s:
            others = 0.0 if self.knows_its_motors else UNSETTLED_SHARE
        return UNSETTLED_SHARE if settle_s > 0 else 1.0, others

    def _step_wheels(
        self, wheels: Iterable[Wheel], state: DriveState, dt_s: float, shares: tuple[float, float]
    ) -> tuple[tuple[PidState, ...], list[float]]:
        """A step of each wheel's controller, and its output at the battery's voltage."""
        creeping_share, integral_share = shares
        scrub_duty = self._scrub_duty(state) if self._parameters.scrub_duty else 0.0
        states: list[PidState] = []
        outputs: list[float] = []
        for gains, before, setpoint_m_s, acceleration_m_s2, speed_m_s in wheels:
            share = creeping_share if -CREEPING_M_S < setpoint_m_s < CREEPING_M_S else integral_share
            after, output = pid.step(
                gains, before, setpoint_m_s, acceleration_m_s2, speed_m_s, dt_s, scrub_duty, share
            )
            states.append(after)
            outputs.append(output)
        if state.supply_share != 1.0:
            outputs = [output * state.supply_share for output in outputs]
        return tuple(states), outputs

    def force(self, state: DriveState, motion: WheelVelocities, now_s: float) -> DriveState:
        """Drive by the motion's duties, without a controller; no duty at all brakes.

        The setpoints are the highest speeds that the wheels may reach with them. Whatever is driven after that begins
        from zero.
        """
        duty = motion.duty or ()
        if not any(duty):
            return self.halt(state)
        signed = tuple(map(mul, duty, self._motor_signs))
        setpoint_m_s = self._kinematics.rims_at_m_s(motion.rad_s)
        return replace(
            self.halt(state), duty=signed, stepped_s=now_s, setpoint_m_s=setpoint_m_s, by_duty=True
        )

    def wheel_duties(self, duties: WheelDuties) -> WheelVelocities:
        """Duties as a motion that can be commanded (see ``wheel_commands.by_duty``); raises ``ValueError``."""
        return by_duty(duties, self._names, self._parameters, self._kinematics, self.limits)

    def retune(self, state: DriveState, gains: tuple[PidParameters, ...]) -> DriveState:
        """Exchange the gains without a bump in the duty; returns the state to go on with."""
        before = self._towards(state) if self.knows_its_motors else self._gains
        self.gains = gains
        after = self._towards(state) if self.knows_its_motors else gains
        wheels = zip(before, after, state.pids, state.setpoint_m_s, state.acceleration_m_s2, strict=True)
        scrub_duty = self._scrub_duty(state)
        pids = tuple(pid.retune(*wheel, scrub_duty) for wheel in wheels)
        return replace(state, pids=pids)

    def relimit(self, limits: MotionLimits) -> None:
        """Exchange the limits of speed and acceleration; only at rest, because a ramp that has begun would jump."""
        self.limits = limits
        self._setpoints = Setpoints(self._parameters, limits, self._kinematics)
        at_rims = limits.angular.axis.fastest_change * self._kinematics.track_width_m / 2
        self._most_m_s2 = RIM_ACCELERATION_SHARE * (limits.linear.axis.fastest_change + at_rims)

    def wheel_velocities(self, velocity_rad_s: Mapping[str, float]) -> WheelVelocities:
        """Speeds of wheels as a motion that can be commanded (see ``wheel_commands.by_speed``); raises ``Refused``."""
        return by_speed(velocity_rad_s, self._names, self._kinematics)

    def targets_rad_s(self, state: DriveState) -> tuple[float, ...]:
        """The commanded speed of each wheel."""
        return tuple(map(truediv, state.setpoint_m_s, self._kinematics.radii_m))

    def effort(self, state: DriveState) -> tuple[float, ...]:
        """The duty in force per wheel, less what scrubbing may take, as a share of the range; forward is positive."""
        scrub_duty, full = STICTION * self._scrub_duty(state), self._parameters.max_duty
        forward = [duty * sign / full for duty, sign in zip(state.duty, self._motor_signs, strict=True)]
        if scrub_duty:
            forward = [math.copysign(max(0.0, abs(share) - scrub_duty / full), share) for share in forward]
        return tuple(forward)

    def _scrub_duty(self, state: DriveState) -> float:
        """What a commanded turn adds to each wheel's friction; 0 where the setpoints of a side differ."""
        twist = state.limiter.twist
        if state.wheels_differ or not (self._parameters.scrub_duty and twist.angular_rad_s):
            return 0.0
        sideways_m_s = abs(twist.angular_rad_s) * self._parameters.scrub_reach_m
        return self._parameters.scrub_duty * sideways_m_s / math.hypot(twist.linear_m_s, sideways_m_s)

    def _duty(self, outputs: Sequence[float]) -> tuple[int, ...]:
        most = self._parameters.max_duty
        if -most < min(outputs) and max(outputs) < most:
            return tuple(map(mul, map(round, outputs), self._motor_signs))
        wheels = zip(map(round, outputs), self._motor_signs, strict=True)
        return tuple([(most if d > most else -most if d < -most else d) * sign for d, sign in wheels])

    def _share_left(
        self, state: DriveState, outputs: Sequence[float], speeds_m_s: Sequence[float], dt_s: float
    ) -> float:
        """Slow the whole twist while any wheel cannot keep up with its part of it."""
        if state.saturation_scale == 1.0 and dt_s >= 0:
            for gains, output in zip(self._gains, outputs, strict=True):
                if not -gains.output_limit < output < gains.output_limit:
                    break
            else:  # as it nearly always is
                return 1.0
        change = SATURATION_RECOVERY_PER_S
        wheels = zip(self._gains, outputs, state.setpoint_m_s, speeds_m_s, strict=True)
        for gains, output, setpoint, speed in wheels:
            saturated = not -gains.output_limit < output < gains.output_limit
            if saturated and abs(setpoint) - abs(speed) > LAGGING_M_S:
                change = -self._parameters.saturation_slowdown_per_s
        share = state.saturation_scale + change * dt_s
        return 1.0 if share > 1.0 else LEAST_SHARE if share < LEAST_SHARE else share
