"""What must hold at every step of a long drive, whatever happens: looked at on the bus, on the wire and in the world."""

import json
import math
from collections import Counter
from dataclasses import dataclass, field

from chefbotd.clock import LoopClock
from chefbotd.core.events import LinkClosed, LinkOpened, OdometryUpdated, SafetyChanged, WheelsDriven
from chefbotd.core.geometry import Pose2D, Twist2D
from chefbotd.motion.kinematics import Kinematics
from chefbotd.settings import Settings
from chefbotd.testing.daemon import SimulatedRobot
from tests.scenarios.instruments import is_moving
from tests.scenarios.wires import opened

DRIFT_M, DRIFT_SHARE = 0.03, 0.02
"""Odometry may be so far from the truth: a base, and a share of the way since the two were last set equal."""

LATE_S = 0.06
"""A reading is so old: a cycle of the board, and its line's time on the wire."""

HALTED_S = 1.5
"""So long after the robot may no longer move, and can be told so, it stands: the sketch waits a second for an echo."""

STEP_SLACK_S = 0.008
FOLLOWING_S = 0.15
"""From a command's age to the setpoints that follow it: a watch period and two board cycles."""


@dataclass
class Report:
    """What happened, and the worst of what was measured."""

    robot: str
    minutes: float
    control_steps: int = 0
    faults: Counter[str] = field(default_factory=Counter)
    worst_drift_m: float = 0.0
    worst_speed_m_s: float = 0.0
    worst_acceleration_m_s2: float = 0.0
    travelled_m: float = 0.0
    resident_growth_mb: float = 0.0

    def dump(self) -> str:
        """As one JSON object."""
        return json.dumps(
            {k: round(v, 4) if isinstance(v, float) else v for k, v in vars(self).items()}, default=dict
        )


class Invariants:
    """Looks at every control step and every line on the wire; raises ``AssertionError`` naming what did not hold."""

    def __init__(self, robot: SimulatedRobot, settings: Settings, report: Report) -> None:
        self._robot, self._settings, self._report, self._clock = robot, settings, report, LoopClock()
        self._kinematics = Kinematics(settings.chassis)
        bus = robot.daemon.bus
        self._inbox = bus.subscribe(WheelsDriven, SafetyChanged, OdometryUpdated, size=4096)
        self._modes = bus.subscribe(SafetyChanged, LinkOpened, LinkClosed, size=4096)
        self.mode = "armed"
        self.contacts, self.driven_s = 0, 0.0
        self._linked = robot.daemon.session.is_open
        self._halted_s = self._deaf_until_s = self._commanded_s = -math.inf
        self._last: tuple[float, Twist2D] | None = None
        self._drift_allowed_m: float | None = None
        self._truth: Pose2D | None = None
        self.told_to_stop = True
        self._said: bytes | None = None
        self._write, robot.device.on_write = robot.device.on_write, self._on_write

    async def watch(self) -> None:
        """Check until cancelled, or until something does not hold."""
        async for event in self._inbox:
            assert self._said is None, f"{self._said!r} on the wire while {self.mode}"
            if isinstance(event, SafetyChanged):
                self._last = None
                self._report.faults.update([event.fault] if event.fault else [])
            elif isinstance(event, OdometryUpdated):
                self._check_truth()
                self._check_drift(event)
            else:
                self._check_step(event)

    # What the driver says that it did

    def commanded(self) -> None:
        """A command was accepted."""
        self._commanded_s = self._clock.now_s()

    def halted(self) -> None:
        """The next setpoint starts from zero."""
        self._last = None

    def deaf(self, seconds: float) -> None:
        """For so long the board does not hear."""
        self._deaf_until_s = self._clock.now_s() + seconds

    def encoders_touched(self) -> None:
        """A fault touches the encoders: odometry may be anywhere until it is set again."""
        self._drift_allowed_m = None

    def odometry_set(self) -> None:
        """Odometry was just set to the truth."""
        self._drift_allowed_m = DRIFT_M

    # On the wire and in the world

    def _on_write(self, data: bytes) -> None:
        """The last word of a chunk is in force; one that moves a robot that must not is told by ``watch``."""
        self._take_modes()
        duties = [opened(line, b" ")[0] for line in data.split(b"\r") if line.startswith(b"s")]
        if duties:
            self.told_to_stop = not duties[-1].strip(b"s 0")
            if self.mode != "armed" and not self.told_to_stop:
                self._said = duties[-1]
        self._write(data)

    def _take_modes(self) -> None:
        while len(self._modes):
            event = self._modes.take_event()
            if isinstance(event, SafetyChanged):
                self._halted_s = event.stamp_s if self.mode == "armed" else self._halted_s
                self.mode = event.mode
            else:
                self._linked = isinstance(event, LinkOpened)
                self._halted_s = event.stamp_s

    def _check_truth(self) -> None:
        """Where it may not move, and can be told so, it stands."""
        self._take_modes()
        told_s = max(self._halted_s, self._deaf_until_s)
        if self.mode != "armed" and self._linked and self._clock.now_s() - told_s > HALTED_S:
            assert not is_moving(self._robot), f"moves while {self.mode}"

    # At every step

    def _check_step(self, step: WheelsDriven) -> None:
        self._report.control_steps += 1
        now_s = self._clock.now_s()
        limits = self._settings.limits
        twist = self._kinematics.twist(step.target_rad_s)
        self._report.worst_speed_m_s = max(self._report.worst_speed_m_s, abs(twist.linear_m_s))
        assert max(map(abs, step.duty)) <= self._settings.drive.max_duty, f"duty {step.duty}"
        assert abs(twist.linear_m_s) <= limits.linear.max_forward_m_s + 1e-9, f"asked for {twist}"
        assert abs(twist.angular_rad_s) <= limits.angular.max_left_rad_s + 1e-9, f"asked for {twist}"
        if self._last is not None and any(step.duty):
            self.driven_s += now_s - self._last[0]
        if self._last is not None and any(step.target_rad_s):
            self._check_change(self._last[1], twist, now_s - self._last[0])
            self._check_dead_man(self._last[1], twist, now_s)
        self._last = now_s, twist

    def _check_dead_man(self, was: Twist2D, now: Twist2D, now_s: float) -> None:
        """Past the dead-man's time setpoints only fall."""
        age_s = now_s - self._commanded_s
        if age_s > self._settings.safety.command_timeout_s + FOLLOWING_S:
            falls = abs(now.linear_m_s) + abs(now.angular_rad_s) < abs(was.linear_m_s) + abs(
                was.angular_rad_s
            )
            assert falls, f"asked for {now}, {age_s:.2f} s after the last command"

    def _check_change(self, was: Twist2D, now: Twist2D, elapsed_s: float) -> None:
        """Setpoints change within the limits; only a halt may jump, and only to zero.

        The time is that of the steps: a reading is stamped with when it was made, and may have come later than the next.
        """
        limits = self._settings.limits
        sped = abs(now.linear_m_s - was.linear_m_s)
        turned = abs(now.angular_rad_s - was.angular_rad_s)
        within_s = elapsed_s + STEP_SLACK_S
        allowed_m_s = limits.linear.acceleration_m_s2 * within_s + 1e-6
        allowed_rad_s = limits.angular.acceleration_rad_s2 * within_s + 1e-6
        assert sped <= allowed_m_s, f"setpoint changed by {sped} m/s in {elapsed_s} s"
        assert turned <= allowed_rad_s, f"setpoint changed by {turned} rad/s in {elapsed_s} s"
        if elapsed_s > 0.01:
            self._report.worst_acceleration_m_s2 = max(self._report.worst_acceleration_m_s2, sped / elapsed_s)

    def _check_drift(self, event: OdometryUpdated) -> None:
        true = self._robot.board.truth(0.0)
        moved_m = 0.0 if self._truth is None else _apart_m(true.world_from_base, self._truth)
        self._truth = true.world_from_base
        self._report.travelled_m += moved_m
        if true.in_contact:
            self.contacts += 1
            self.encoders_touched()
        if self._drift_allowed_m is None:
            return
        self._drift_allowed_m += DRIFT_SHARE * moved_m
        drift_m = _apart_m(event.odom_from_base, self._truth)
        self._report.worst_drift_m = max(self._report.worst_drift_m, drift_m)
        behind_m = LATE_S * abs(true.twist.linear_m_s)
        assert drift_m <= self._drift_allowed_m + behind_m, f"odometry {drift_m:.3f} m from the truth"


def _apart_m(one: Pose2D, other: Pose2D) -> float:
    return math.dist((one.x_m, one.y_m), (other.x_m, other.y_m))
