"""Holds the present targets of the wheels, and changes that wait until the robot is at rest."""

from collections.abc import Callable, Mapping

from chefbotd.core.geometry import WheelDuties, WheelVelocities
from chefbotd.core.record import MutableState, StatefulPart
from chefbotd.driving.wheel_reader import WheelsRead
from chefbotd.motion.drive import Drive
from chefbotd.motion.drive_state import DriveState
from chefbotd.motion.held import obey_duty, offer_duty
from chefbotd.motion.limits import AT_REST, MotionLimits
from chefbotd.motion.pid import PidParameters
from chefbotd.motion.setpoints import under
from chefbotd.safety.gate import CALIBRATION, Decision, is_by_duty

UNLIKE_M_S = 0.01
"""A smaller difference between what the board obeys and what was thought waits for the next step: the wire is slow."""


class LimitsState(MutableState):
    """The limits in force, and those that wait until the robot is at rest."""

    limits: MotionLimits
    waiting: MotionLimits | None = None


class WheelController(StatefulPart[LimitsState]):
    """Steps the drive; ``drive_state`` has the setpoints and duties that are in force.

    ``wheel_names`` has the drive's order. The ``memory`` is of the limits; gains and ``drive_state`` are in other parts.
    ``duty_ceiling`` is the highest duty of each wheel while faster commands are held back on the way to the board, as
    ``is_held_back`` says of the last step.
    """

    def __init__(
        self,
        drive: Drive,
        wheel_names: tuple[str, ...],
        duty_ceiling: Callable[[float], tuple[int, ...] | None],
    ) -> None:
        self._drive, self._wheel_names, self._duty_ceiling = drive, wheel_names, duty_ceiling
        self.drive_state = drive.at_rest
        self._knows_its_motors = drive.knows_its_motors
        self.is_held_back = False
        self.memory = LimitsState(drive.limits)
        self._then: Callable[[], None] = lambda: None
        self._on_limits: Callable[[MotionLimits], None] = lambda limits: None
        self._on_gains: Callable[[Mapping[str, PidParameters]], None] = lambda gains: None

    def restore(self, state: LimitsState) -> None:
        """Restore the limits; no request waits for pending ones."""
        super().restore(state)
        self._drive.relimit(state.limits)
        self._on_limits(state.limits)
        self._then = lambda: None

    def call_on_limits(self, handler: Callable[[MotionLimits], None]) -> None:
        """Call ``handler`` with the new limits after each change."""
        self._on_limits = handler

    def call_on_gains(self, handler: Callable[[Mapping[str, PidParameters]], None]) -> None:
        """Call ``handler`` with the new gains, by wheel name, after each change."""
        self._on_gains = handler

    def regulate(
        self,
        decision: Decision,
        now_s: float,
        seen: WheelsRead,
        obeyed_m_s: tuple[float, ...] | None = None,
    ) -> None:
        """Make a control step with a measurement (see ``Drive.regulate``)."""
        before, self.is_held_back = self.drive_state, False
        if decision.halted:
            self.drive_state = self._drive.halt(before)
            return
        if decision.source == CALIBRATION and is_by_duty(decision.motion):
            self._force(decision.motion, now_s)
            return
        after = self._drive.regulate(
            before,
            decision.motion,
            now_s,
            seen.reading.velocity_rad_s,
            seen.dt_s,
            measured_over_s=seen.reading.measured_over_s,
            axes_independent=decision.limited_by is not None,
            substitutes=seen.same_side.substitutes,
            obeyed_m_s=obeyed_m_s,
        )
        ceiling = self._duty_ceiling(now_s)
        self.is_held_back = ceiling is not None
        carried_out = under(ceiling, before, after)
        if self._knows_its_motors and carried_out.duty == after.duty:
            carried_out = offer_duty(carried_out)
        self.drive_state = carried_out

    def retarget(self, decision: Decision, now_s: float) -> None:
        """Make a control step without a measurement."""
        before, self.is_held_back = self.drive_state, False
        if decision.halted:
            self.drive_state = self._drive.halt(before)
            return
        if decision.source == CALIBRATION and is_by_duty(decision.motion):
            self._force(decision.motion, now_s)
            return
        axes_independent = decision.limited_by is not None
        after = self._drive.retarget(before, decision.motion, now_s, axes_independent=axes_independent)
        carried_out = self._under_ceiling(now_s, before, after)
        if self._knows_its_motors and carried_out.duty == after.duty:
            carried_out = offer_duty(carried_out)
        self.drive_state = carried_out

    def _force(self, motion: WheelVelocities, now_s: float) -> None:
        """Drive by duties."""
        before = self.drive_state
        self.drive_state = self._under_ceiling(now_s, before, self._drive.force(before, motion, now_s))

    def _under_ceiling(self, now_s: float, before: DriveState, after: DriveState) -> DriveState:
        """The step ``after``, with what is held back on the way to the board."""
        ceiling = self._duty_ceiling(now_s)
        self.is_held_back = ceiling is not None
        return under(ceiling, before, after)

    def halt(self) -> None:
        """Set duty and setpoint of every wheel to zero."""
        self.drive_state = self._drive.halt(self.drive_state)

    @property
    def rests(self) -> bool:
        """Whether duty and setpoint of every wheel are zero."""
        state = self.drive_state
        return not any(state.duty) and not any(state.setpoint_m_s) and state.limiter == AT_REST

    @property
    def effort(self) -> tuple[float, ...]:
        """The present effort of each wheel (see ``Drive.effort``)."""
        return self._drive.effort(self.drive_state)

    @property
    def targets_rad_s(self) -> tuple[float, ...]:
        """The commanded speed of each wheel."""
        return self._drive.targets_rad_s(self.drive_state)

    def wheel_velocities(self, velocity_rad_s: Mapping[str, float]) -> WheelVelocities:
        """The motion with these speeds of the named wheels; raises ``Refused`` if no wheel has a name."""
        return self._drive.wheel_velocities(velocity_rad_s)

    def wheel_duties(self, duties: WheelDuties) -> WheelVelocities:
        """The motion that drives by as much of these duties as the limits allow; ``ValueError`` unless one per wheel."""
        return self._drive.wheel_duties(duties)

    def note_echo(self, duty: tuple[float, ...]) -> bool:
        """The board obeys this duty; returns whether that is so different from what was thought that it matters."""
        before, self.drive_state = self.drive_state, obey_duty(self.drive_state, duty)
        if self.drive_state is before:
            return False
        wheels = zip(before.held_m_s, self.drive_state.held_m_s, strict=True)
        return any(abs(after - thought) > UNLIKE_M_S for thought, after in wheels)

    def note_voltage(self, voltage_v: float) -> None:
        """The battery has this voltage: where the motors' models tell theirs, the duty makes up for it."""
        self.drive_state = self._drive.compensate(self.drive_state, voltage_v)

    def gains(self) -> dict[str, PidParameters]:
        """The present gains by wheel name."""
        return dict(zip(self._wheel_names, self._drive.gains, strict=True))

    def retune(self, gains: Mapping[str, PidParameters]) -> None:
        """Exchange the gains of every wheel without a bump."""
        self.drive_state = self._drive.retune(
            self.drive_state, tuple([gains[name] for name in self._wheel_names])
        )
        self._on_gains(gains)

    def set_gains(self, gains: Mapping[str, PidParameters]) -> None:
        """Restore these gains."""
        self._drive.gains = tuple([gains[name] for name in self._wheel_names])
        self._on_gains(gains)

    def relimit(self, limits: MotionLimits, then: Callable[[], None] = lambda: None) -> bool:
        """Change the limits as soon as the robot is at rest, and call ``then``; returns whether it was at once.

        Of several pending changes, the last one is made.
        """
        self.memory.waiting, self._then = limits, then
        self.make_change()
        return self.memory.waiting is None

    @property
    def change_waits(self) -> bool:
        """Whether a change waits for the robot to be at rest."""
        return self.memory.waiting is not None

    def make_change(self) -> None:
        """Make the change that waits, if the robot is at rest."""
        memory = self.memory
        if memory.waiting is not None and self.rests:
            memory.limits, memory.waiting = memory.waiting, None
            self._drive.relimit(memory.limits)
            self._on_limits(memory.limits)
            self._then()
