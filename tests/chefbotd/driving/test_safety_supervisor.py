"""The keeper of the gate: what leads from a fault back to motion."""

import asyncio
from collections.abc import Callable, Mapping

import pytest
from structlog.testing import capture_logs

from chefbotd.bus import Bus, OnError
from chefbotd.clock import ManualClock, run_virtual
from chefbotd.core.commands import RefusalKind, Refused
from chefbotd.core.events import (
    BoardRestarted,
    DutyEchoed,
    EncodersCounted,
    LinkClosed,
    LinkOpened,
    RangeMeasured,
    RangeStatus,
    SafetyChanged,
)
from chefbotd.core.geometry import Motion, Pose2D, Twist2D
from chefbotd.driving.motor_watch import MotorWatch
from chefbotd.driving.obstacle_guard import Scans
from chefbotd.driving.safety_supervisor import SafetySupervisor
from chefbotd.driving.wheel_reader import WheelsRead
from chefbotd.motion.encoder import Reading
from chefbotd.motion.same_side import SameSideState
from chefbotd.process.latch_file import LatchFile
from chefbotd.safety import in_force
from chefbotd.safety.faults import Fault, FaultKind
from chefbotd.safety.gate import Command, GateState, Mode, Rearm, SafetyParameters
from chefbotd.safety.latch import GateStore
from tests.chefbotd.driving.rig import CHASSIS

TWIST = Twist2D(0.2, -0.3)
ANN, BOB = 1, 2


FAST_M_S = (10.0, 10.0)
"""Rims that are asked for so much are never too fast."""


def reading(travel_rad: tuple[float, ...], dt_s: float) -> WheelsRead:
    """Wheels that turned by this much within ``dt_s``; both are believed."""
    none = (0.0,) * len(travel_rad)
    return WheelsRead(Reading(travel_rad, travel_rad, none), dt_s, SameSideState(none, none, none))


class Kept:
    """A keeper on a manual clock, whose link has been opened."""

    def __init__(
        self,
        rearm: Rearm = Rearm.MANUAL,
        mounts: Mapping[str, Pose2D] | None = None,
        scans: Callable[[OnError], Scans] | None = None,
        session: int = 0,
        latch: GateStore | None = None,
    ) -> None:
        self.clock, parameters = ManualClock(100.0), SafetyParameters(rearm=rearm)
        self.bus = Bus()
        self._told: list[SafetyChanged] = []
        self.bus.add_handler(self._told.append, SafetyChanged)
        self.keeper = SafetySupervisor(
            self.bus,
            self.clock,
            parameters,
            mounts=mounts or {},
            scans=scans,
            latch=latch or LatchFile(None),
            session=session,
            motors=MotorWatch(parameters, CHASSIS, 1000),
        )
        self.keeper.on_link(LinkOpened(100.0, "dev"))

    def told(self) -> list[SafetyChanged]:
        """What was announced."""
        return self._told

    def read(
        self, dt_s: float, travel_rad: tuple[float, ...], effort: tuple[float, ...] = (0.6, 0.4)
    ) -> None:
        """A good reading after ``dt_s``, in which the wheels were driven so."""
        motors, began_s = self.keeper.motors, self.clock.now_s()
        motors.note_command(in_force.WrittenCommand(began_s - 1.0, (60, 40), effort, FAST_M_S))
        motors.note_line(EncodersCounted(began_s - 0.001, began_s, 0.0, (0, 0)))
        self.clock.advance(dt_s)
        now_s = self.clock.now_s()
        motors.note_line(EncodersCounted(now_s - 0.001, now_s, dt_s, (0, 0)))
        seen = reading(travel_rad, dt_s)
        self.keeper.note_reading(now_s, seen)
        self.keeper.watch_wheels(now_s, seen, lambda seen, effort: effort)

    def fault(self, *, driven: bool) -> FaultKind | None:
        """What has latched by now."""
        self.keeper.decide(self.clock.now_s(), driven=driven)
        return self.keeper.gate.fault


@pytest.mark.parametrize(("rearm", "armed"), [(Rearm.MANUAL, False), (Rearm.AUTO, True)])
def test_a_restarted_board_is_left_by_arm_or_by_itself(rearm: Rearm, armed: bool) -> None:
    """With ``rearm`` auto the fault ends in the call that tells of it; a lost link does when it is back."""
    kept = Kept(rearm)
    kept.keeper.on_link(BoardRestarted(100.5, "it said so"))
    assert kept.keeper.armed is armed
    kept.keeper.arm()
    kept.keeper.on_link(LinkClosed(101.0, "dev", "pulled"))
    assert not kept.keeper.armed
    kept.keeper.on_link(LinkOpened(102.0, "dev"))
    assert kept.keeper.armed is armed


def test_the_silence_of_a_restart_is_no_wait_for_an_echo() -> None:
    """A board that restarts is silent for half a second, and has no range at first: its next silence stops the robot."""
    kept = Kept()
    kept.read(0.1, (0.0, 0.0))
    kept.clock.advance(0.3)
    kept.keeper.on_link(BoardRestarted(kept.clock.now_s(), "it said so"))
    kept.read(0.2, (0.0, 0.0))
    now_s = kept.clock.now_s()
    kept.bus.publish(RangeMeasured(now_s, now_s, "front", RangeStatus.NO_ECHO, None, 0.02, 4.0, 0.26))
    kept.keeper.arm()
    kept.clock.advance(0.26)
    kept.keeper.accept(Command("teleop", TWIST, kept.clock.now_s()), ANN)
    decision = kept.keeper.decide(kept.clock.now_s(), driven=True)
    assert (decision.halted, decision.limited_by) == (True, "encoders_stale")


def test_arm_clears_what_it_names_and_nothing_that_latched_after_it() -> None:
    """A fault, and an e-stop just before its arm: that one holds, until the arm that names it."""
    kept = Kept()
    kept.keeper.fail(Fault(FaultKind.WHEEL_STALLED, "a wheel is held"))
    kept.keeper.publish_gate_state(100.1)
    seen = kept.told()[-1].latch
    kept.keeper.estop("smoke")
    with pytest.raises(Refused, match="smoke") as refused:
        kept.keeper.arm(seen)
    assert refused.value.kind is RefusalKind.LATCHED_AGAIN
    assert kept.keeper.gate.mode is Mode.ESTOPPED
    kept.keeper.publish_gate_state(100.2)
    assert kept.told()[-1].latch == seen + 1
    kept.keeper.estop("smoke")  # the same words, by somebody else
    with pytest.raises(Refused):
        kept.keeper.arm(seen + 1)
    kept.keeper.publish_gate_state(100.3)
    kept.keeper.arm(kept.told()[-1].latch)
    assert kept.keeper.armed


@pytest.mark.parametrize("session", [0, 0x1F3A07C2, 0xFFFFFFFF])
def test_a_number_of_another_start_of_the_daemon_clears_nothing(session: int) -> None:
    """As many e-stops, before a restart and after it: who kept the number clears none that it has not seen."""
    before, after = Kept(session=0x1F3A07C1), Kept(session=session)
    for kept in (before, after):
        kept.keeper.estop("smoke")
        kept.keeper.publish_gate_state(100.1)
    kept_number, number = before.told()[-1].latch, after.told()[-1].latch
    assert kept_number == 0x1F3A07C1 * 2**20 + 1
    assert number == session * 2**20 + 1
    assert number == int(float(number))  # a browser's numbers are floats
    with pytest.raises(Refused, match="the daemon was restarted") as refused:
        after.keeper.arm(kept_number)
    assert refused.value.kind is RefusalKind.LATCHED_AGAIN
    after.keeper.arm(number)
    assert after.keeper.armed


def test_arm_clears_no_fault_that_a_thread_has_just_reported() -> None:
    """The watchdog's report waits for the loop: it counts as latched before the arm."""
    kept = Kept()
    kept.keeper.estop("smoke")
    kept.keeper.publish_gate_state(100.1)
    kept.keeper.arm(kept.told()[-1].latch)
    kept.keeper.report_from_thread(Fault(FaultKind.LOOP_BLOCKED, "it stood still"))
    with pytest.raises(Refused):
        kept.keeper.arm(kept.told()[-1].latch)
    assert not kept.keeper.armed


class FullDisk(LatchFile):
    """Takes nothing while it is ``full``; ``kept`` are the modes that it took."""

    def __init__(self) -> None:
        super().__init__(None)
        self.full, self.kept = False, list[Mode]()

    def keep(self, state: GateState) -> str:
        """Not while it is full."""
        if self.full:
            return "no space left on device"
        self.kept.append(state.mode)
        return ""


@pytest.mark.parametrize("rearm", list(Rearm))
def test_a_robot_whose_latch_cannot_be_written_does_not_arm(rearm: Rearm) -> None:
    """By a client or by itself; that it is armed is on the disk before it is so."""
    disk = FullDisk()
    kept = Kept(rearm, latch=disk)
    kept.keeper.on_link(LinkClosed(101.0, "dev", "pulled"))
    disk.full = True
    kept.keeper.on_link(LinkOpened(102.0, "dev"))
    with pytest.raises(Refused, match="no space left on device") as refused:
        kept.keeper.arm()
    assert (refused.value.kind, kept.keeper.armed) == (RefusalKind.STORAGE_FAILED, False)
    disk.full = False
    disk.kept.clear()
    kept.keeper.arm()
    assert (kept.keeper.armed, disk.kept) == (True, [Mode.ARMED])


def test_a_fault_that_changes_nothing_is_not_counted_again() -> None:
    """A detector may repeat what it says in every cycle: an arm that names the fault still clears it."""
    kept = Kept()
    for _ in range(5):
        kept.keeper.fail(Fault(FaultKind.WHEEL_STALLED, "a wheel is held"))
    kept.keeper.publish_gate_state(100.1)
    assert kept.told()[-1].latch == 1
    kept.keeper.arm(1)
    assert kept.keeper.armed


def test_arm_forgets_a_drive_that_the_silence_interrupted() -> None:
    """Encoders fall silent while driven, an e-stop and an arm follow: the same silence, from rest, is no fault."""
    kept = Kept()
    kept.read(0.02, (0.1, 0.05))
    kept.clock.advance(0.5)
    assert kept.fault(driven=True) is None
    kept.keeper.estop("smoke")
    kept.keeper.arm()
    kept.clock.advance(2.0)
    assert kept.fault(driven=False) is None
    assert kept.keeper.armed


def test_the_same_silence_without_arm_is_a_fault() -> None:
    """After ``latch_after_s``, 2 s."""
    kept = Kept()
    kept.read(0.02, (0.1, 0.05))
    kept.clock.advance(0.5)
    assert kept.fault(driven=True) is None
    kept.clock.advance(1.6)
    assert kept.fault(driven=False) is FaultKind.ENCODERS_SILENT


def test_a_frozen_process_takes_no_wheel_for_stalled() -> None:
    """One reading after 5 s without, of wheels that were driven and have not moved, counts 0.25 s: no fault.

    Readings every 0.02 s of the same find it after 1.75 s of driving.
    """
    kept = Kept()
    kept.read(0.02, (0.1, 0.05))
    kept.read(5.0, (0.0, 0.0))
    assert kept.keeper.armed
    for _ in range(86):
        kept.read(0.02, (0.0, 0.0))
    assert not kept.keeper.armed
    assert kept.keeper.gate.fault is FaultKind.WHEEL_STALLED


def test_a_pause_of_the_loop_counts_as_a_silence_that_has_just_begun() -> None:
    """Driven, 5 s without the loop: the encoders are stale, and a fault only 2 s after their 0.25 s began anew."""
    kept = Kept()
    kept.keeper.loop_runs(100.0)
    kept.read(0.02, (0.1, 0.05))
    kept.clock.advance(5.0)
    kept.keeper.loop_runs(kept.clock.now_s())
    assert kept.fault(driven=True) is None
    kept.clock.advance(1.7)
    assert kept.fault(driven=False) is None
    kept.clock.advance(0.06)
    assert kept.fault(driven=False) is FaultKind.ENCODERS_SILENT


def test_who_is_held_is_refused() -> None:
    """By a stop, and by an e-stop also who tries while it is latched: arm alone never moves the robot."""
    kept = Kept()
    kept.keeper.accept(Command("teleop", TWIST, kept.clock.now_s()), ANN)
    kept.keeper.stop("Bob", BOB)
    with pytest.raises(Refused, match="teleop was stopped by Bob"):
        kept.keeper.accept(Command("teleop", TWIST, kept.clock.now_s()), ANN)
    kept.keeper.estop("smoke")
    kept.clock.advance(0.1)
    with pytest.raises(Refused, match="arm the robot first"):
        kept.keeper.accept(Command("navigation", TWIST, kept.clock.now_s()), ANN)
    kept.keeper.arm()
    with pytest.raises(Refused, match="navigation was stopped by an emergency stop"):
        kept.keeper.accept(Command("navigation", TWIST, kept.clock.now_s()), ANN)
    kept.keeper.accept(Command("safety", TWIST, kept.clock.now_s()), ANN)


def test_names_that_are_no_source_leave_nothing_behind() -> None:
    """A thousand of them are refused, and none is remembered."""
    kept = Kept()
    for number in range(1000):
        with pytest.raises(Refused, match="no source named"):
            kept.keeper.accept(Command(f"source{number}", TWIST, kept.clock.now_s()), ANN)
    assert kept.keeper._held.memory == ()


def echo_story(kept: Kept, reconnect: bool) -> FaultKind | None:
    """Five echoes that fit, the link perhaps closed and opened, then eight of what was not said."""
    shown = [(40.0, -9.0)] * 5 + [(70.0, -44.0)] * 8
    for number, duty in enumerate(shown):
        if number == 5 and reconnect:
            kept.keeper.on_link(LinkClosed(kept.clock.now_s(), "dev", "pulled"))
            kept.keeper.on_link(LinkOpened(kept.clock.now_s(), "dev"))
            kept.keeper.arm()
        kept.clock.advance(0.02)
        kept.keeper.motors.note_command(
            in_force.WrittenCommand(kept.clock.now_s(), (40, -9), (0.0, 0.0), (0.0, 0.0))
        )
        kept.bus.publish(DutyEchoed(kept.clock.now_s(), kept.clock.now_s(), duty))
    return kept.keeper.gate.fault


def test_an_echo_has_to_prove_itself_to_each_connection() -> None:
    """Eight echoes that do not fit disarm; after another connection the echo has shown nothing yet."""
    assert echo_story(Kept(), reconnect=False) is FaultKind.ECHO_MISMATCH
    assert echo_story(Kept(), reconnect=True) is None


def test_what_is_logged_of_modes_and_limits() -> None:
    """A limit once, with what it is for; a fault as a warning, armed again as information."""

    async def scenario() -> None:
        kept = Kept()
        steps: list[Callable[[], object]] = [
            lambda: None,
            lambda: kept.keeper.accept(Command("teleop", TWIST, kept.clock.now_s()), ANN),
            lambda: kept.keeper.accept(Command("safety", TWIST, kept.clock.now_s()), ANN),
            lambda: kept.read(0.02, (0.1, 0.05)),
            lambda: kept.keeper.fail(Fault(FaultKind.SERVICE_FAILED, "a test")),
            kept.keeper.arm,
        ]
        for step in steps:
            step()
            kept.keeper.decide(kept.clock.now_s(), driven=False)
            kept.keeper.publish_gate_state(kept.clock.now_s())
        await asyncio.sleep(11.0)

    with capture_logs() as log:
        run_virtual(scenario())
    told = [(entry["log_level"], entry["event"], entry.get("by", entry.get("mode"))) for entry in log]
    assert told == [
        ("warning", "motion limited", "encoders_stale"),
        ("warning", "safety mode changed", "disarmed"),
        ("info", "safety mode changed", "armed"),
    ]


def test_a_board_that_drives_on_during_an_estop_is_logged_as_an_error() -> None:
    """The mode stays the same; what is wrong is said once, and loudly."""
    kept = Kept()
    with capture_logs() as log:
        kept.keeper.publish_gate_state(kept.clock.now_s())
        kept.keeper.estop("smoke")
        kept.keeper.publish_gate_state(kept.clock.now_s())
        for _ in range(2):
            kept.keeper.fail(Fault(FaultKind.BOARD_UNRESPONSIVE, "it does not listen"))
            kept.keeper.publish_gate_state(kept.clock.now_s())
    assert [(entry["log_level"], entry["event"]) for entry in log] == [
        ("warning", "safety mode changed"),
        ("error", "the robot moves although it must stand"),
    ]


class DrivesStraight:
    """Scans that allow the driving of any motion, and not its turning."""

    def limit(self, wanted: Motion, now_s: float, late_s: float = 0.0) -> tuple[Motion, str | None]:
        """Only what does not turn is free."""
        assert isinstance(wanted, Twist2D)
        if wanted.angular_rad_s == 0.0:
            return wanted, None
        return Twist2D(wanted.linear_m_s, 0.0), "obstacle:top"


def test_what_the_scans_leave_is_held_against_the_beams_again() -> None:
    """0.05 m of room before the beam allow 0.5 (sqrt(0.1^2 + 2 0.05 / 0.5) - 0.1) = 0.1791 m/s of 0.2.

    It is 0.2 m left of the middle, where the turn to the left takes 0.06 m/s off: the whole was slow enough.
    """
    kept = Kept(mounts={"left": Pose2D(0.0, 0.2, 0.0)}, scans=lambda on_error: DrivesStraight())
    kept.read(0.02, (0.1, 0.05))
    now_s = kept.clock.now_s()
    kept.bus.publish(RangeMeasured(now_s, now_s, "left", RangeStatus.OK, 0.2, 0.02, 4.0, 0.26))
    kept.keeper.accept(Command("teleop", Twist2D(0.2, 0.3), now_s), ANN)
    decision = kept.keeper.decide(now_s, driven=False)
    assert decision.motion == Twist2D(pytest.approx(0.17913, abs=1e-5), 0.0)
    assert decision.limited_by == "obstacle:top"
