"""Single beams and scans guard together: what either forbids is not driven."""

import math
from collections.abc import Callable

import pytest

from chefbotd.bus import Bus
from chefbotd.clock import ManualClock
from chefbotd.core.events import LinkOpened, RangeMeasured, RangeStatus, SafetyChanged
from chefbotd.core.geometry import STANDING, Motion, Pose2D, Twist2D
from chefbotd.driving.motor_watch import MotorWatch
from chefbotd.driving.safety_supervisor import SafetySupervisor
from chefbotd.process.latch_file import LatchFile
from chefbotd.safety.gate import Command, Decision, SafetyParameters
from chefbotd.safety.guard import GuardParameters
from tests.chefbotd.driving.rig import CHASSIS
from tests.chefbotd.driving.test_safety_supervisor import reading

Limit = Callable[[Twist2D], tuple[Twist2D, str | None]]


class Scans:
    """What lidars allow, by a rule."""

    def __init__(self, rule: Limit) -> None:
        self._rule = rule

    def limit(self, wanted: Motion, now_s: float, late_s: float = 0.0) -> tuple[Motion, str | None]:
        """By the rule."""
        assert isinstance(wanted, Twist2D)
        return self._rule(wanted)


LEFT = Pose2D(0.2, 0.0, math.pi / 2)


def free(wanted: Twist2D) -> tuple[Twist2D, str | None]:
    """Nothing in sight."""
    return wanted, None


def keeper_of(
    bus: Bus, clock: ManualClock, parameters: SafetyParameters, mount: Pose2D, rule: Limit = free
) -> SafetySupervisor:
    """A keeper with an open link, one beam, and scans that allow what the rule says."""
    keeper = SafetySupervisor(
        bus,
        clock,
        parameters,
        mounts={"left": mount},
        latch=LatchFile(None),
        motors=MotorWatch(parameters, CHASSIS, 1000),
        scans=lambda on_error: Scans(rule),
    )
    keeper.on_link(LinkOpened(100.0, "dev"))
    return keeper


def decided(
    rule: Limit, wanted: Twist2D, *, enabled: bool = True, range_m: float = 3.0, mount: Pose2D = LEFT
) -> Decision:
    """The decision on a command, with a beam that looks left 0.2 m ahead of the base unless it is mounted elsewhere."""
    bus, clock = Bus(), ManualClock(100.0)
    parameters = SafetyParameters(guard=GuardParameters(enabled=enabled))
    keeper = keeper_of(bus, clock, parameters, mount, rule)
    seen = reading((0.0, 0.0), 0.02)
    keeper.note_reading(100.0, seen)
    keeper.watch_wheels(100.0, seen, lambda seen, effort: effort)
    bus.publish(RangeMeasured(100.0, 100.0, "left", RangeStatus.OK, range_m, 0.02, 4.0, 0.1))
    keeper.accept(Command("teleop", wanted, 100.0), 1)
    return keeper.decide(100.0, driven=False)


def no_driving(wanted: Twist2D) -> tuple[Twist2D, str | None]:
    """A wall ahead: only turning."""
    return Twist2D(0.0, wanted.angular_rad_s), "obstacle:top" if wanted.linear_m_s else None


def no_right_turn(wanted: Twist2D) -> tuple[Twist2D, str | None]:
    """Something at the right flank."""
    if wanted.angular_rad_s >= 0:
        return wanted, None
    return Twist2D(wanted.linear_m_s, 0.0), "obstacle:top"


def test_what_scans_allow_is_driven_and_the_lidar_is_named() -> None:
    """Of driving and turning only the turning."""
    decision = decided(no_driving, Twist2D(0.3, 0.4))
    assert (decision.motion, decision.limited_by) == (Twist2D(0.0, 0.4), "obstacle:top")


def test_where_scans_are_free_single_beams_still_guard() -> None:
    """The beam at the left, 0.15 m from something: no left turn."""
    decision = decided(free, Twist2D(0.3, 0.4), range_m=0.15)
    assert (decision.motion, decision.limited_by) == (Twist2D(0.3, pytest.approx(0.0)), "obstacle:left")


def test_both_are_asked_for_what_is_left() -> None:
    """Left is barred by the beam; what is left of the motion, straight ahead, by the scans."""
    decision = decided(no_driving, Twist2D(0.3, 0.4), range_m=0.15)
    assert decision.motion == STANDING
    assert decision.limited_by == "obstacle:top"


def test_a_part_that_brings_a_beam_closer_is_not_driven() -> None:
    """A beam that slants to the front left, 0.15 m from something: driving shortens it, turning right lengthens it.

    Together they do not; the scans forbid the turn, and so the beam the drive.
    """
    mount = Pose2D(0.2, 0.0, 1.0)
    whole = decided(free, Twist2D(0.1, -0.4), range_m=0.15, mount=mount)
    assert (whole.motion, whole.limited_by) == (Twist2D(0.1, -0.4), None)
    part = decided(no_right_turn, Twist2D(0.1, -0.4), range_m=0.15, mount=mount)
    assert (part.motion, part.limited_by) == (STANDING, "obstacle:top")


def test_a_guard_that_is_off_asks_nobody() -> None:
    """Neither beams nor scans."""
    decision = decided(no_driving, Twist2D(0.3, 0.4), enabled=False, range_m=0.15)
    assert (decision.motion, decision.limited_by) == (Twist2D(0.3, 0.4), None)


def test_a_stand_before_a_wall_outlasts_the_noise_of_the_ultrasonic_while_the_driver_goes_on() -> None:
    """0.2 m/s asked for all the time: it stands for 5 s at 0.14 to 0.16 m; of 0.18 m the fifth reading counts."""
    bus, clock = Bus(), ManualClock(100.0)
    keeper = keeper_of(bus, clock, SafetyParameters(), Pose2D(0.15))

    def driven(range_m: float) -> Decision:
        clock.advance(0.05)
        now_s = clock.now_s()
        seen = reading((0.0, 0.0), 0.05)
        keeper.note_reading(now_s, seen)
        keeper.watch_wheels(now_s, seen, lambda seen, effort: effort)
        bus.publish(RangeMeasured(now_s, now_s, "left", RangeStatus.OK, range_m, 0.02, 4.0, 0.1))
        keeper.accept(Command("teleop", Twist2D(0.2, 0.0), now_s), 1)
        return keeper.decide(now_s, driven=False)

    assert driven(0.16).motion != STANDING
    stands = [driven(0.15), *(driven(0.15 + 0.01 * (step % 3 - 1)) for step in range(100))]
    assert {(decision.motion, decision.limited_by) for decision in stands} == {(STANDING, "obstacle:left")}
    assert [driven(0.18).motion == STANDING for _ in range(5)] == [True] * 4 + [False]


def test_a_guard_that_is_off_is_announced_with_the_mode() -> None:
    """The topic says all the time that sensors see obstacles for nothing."""
    bus, clock = Bus(), ManualClock(100.0)
    told: list[SafetyChanged] = []
    bus.add_handler(told.append, SafetyChanged)
    parameters = SafetyParameters(guard=GuardParameters(enabled=False))
    keeper = SafetySupervisor(
        bus,
        clock,
        parameters,
        mounts={},
        latch=LatchFile(None),
        motors=MotorWatch(parameters, CHASSIS, 1000),
        guard_warning="a lidar, and the guard is off",
    )
    keeper.publish_gate_state(100.0)
    assert [event.guard_warning for event in told] == ["a lidar, and the guard is off"]
