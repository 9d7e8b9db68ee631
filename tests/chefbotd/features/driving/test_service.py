"""The control loop between the gate and the wire."""

import asyncio
import contextlib
from collections.abc import Awaitable, Callable
from pathlib import Path

import pytest
import structlog

from chefbotd.bus import Bus
from chefbotd.clock import LoopClock, VirtualLoop, run_virtual
from chefbotd.core.commands import RefusalKind, Refused
from chefbotd.core.events import (
    BoardRestarted,
    EncodersCounted,
    LinkClosed,
    LinkOpened,
    SafetyChanged,
    WheelsDriven,
    WheelsMeasured,
)
from chefbotd.core.geometry import Pose2D, Twist2D
from chefbotd.features.driving.motor_watch import MotorWatch
from chefbotd.features.driving.safety_keeper import SafetyKeeper
from chefbotd.features.driving.service import ControlParameters, DriveService
from chefbotd.features.driving.wheel_reader import WheelReader
from chefbotd.motion.drive import Drive
from chefbotd.motion.drive_state import DriveParameters
from chefbotd.motion.encoder import EncoderParameters
from chefbotd.motion.kinematics import ChassisParameters
from chefbotd.motion.limits import MotionLimits
from chefbotd.motion.pid import PidParameters
from chefbotd.motion.same_side import SameSideParameters
from chefbotd.process.latch_file import LatchFile
from chefbotd.safety.faults import Fault, FaultKind
from chefbotd.safety.gate import GateState, Mode, Rearm, SafetyParameters
from tests.budget import sample

CHASSIS = ChassisParameters.model_validate(
    {
        "track_width_m": 0.3,
        "wheels": [
            {"name": "left_wheel", "side": "left", "radius_m": 0.05},
            {"name": "right_wheel", "side": "right", "radius_m": 0.05},
        ],
    }
)
LIMITS = MotionLimits.model_validate(
    {
        "linear": {"max_forward_m_s": 1.0, "acceleration_m_s2": 1.0},
        "angular": {"max_left_rad_s": 5.0, "acceleration_rad_s2": 5.0},
    }
)
GAINS = PidParameters(kp=0.0, ki=0.0, ks=40.0, kv=1000.0, output_limit=1023.0)
AHEAD = Twist2D(0.2, 0.0)
FULL_DUTY = (240, 240)  # 40 + 1000 * 0.2


class Rig:
    """A control loop with a wire that remembers, fed by hand. Feedforward only, so that duties can be computed."""

    def __init__(self, rearm: Rearm = Rearm.MANUAL, latch: Path | None = None) -> None:
        self.bus, self.clock = Bus(), LoopClock()
        self.written: list[tuple[float, tuple[int, ...]]] = []
        self.start_s = self.clock.now_s()
        self.service = DriveService(
            self.bus,
            self.clock,
            lambda duty: self.written.append((round(self.elapsed_s, 6), duty)),
            Drive(DriveParameters(max_rim_speed_m_s=0.5, max_duty=1023), CHASSIS, LIMITS, (GAINS, GAINS)),
            SafetyKeeper(
                self.bus,
                self.clock,
                SafetyParameters(rearm=rearm),
                wheel_names=tuple(wheel.name for wheel in CHASSIS.wheels),
                counts_per_turn=1000,
                mounts={"front": Pose2D(0.15)},
                latch=LatchFile(latch),
                motors=MotorWatch(SafetyParameters(rearm=rearm), CHASSIS),
            ),
            reader=WheelReader(
                CHASSIS,
                EncoderParameters(counts_per_turn=1000, max_speed_rad_s=20.0, velocity_window=2),
                SameSideParameters(),
            ),
            wheel_names=tuple(wheel.name for wheel in CHASSIS.wheels),
            control=ControlParameters(watch_period_s=0.02),
        )
        self.safety = self.bus.subscribe(SafetyChanged)
        self.wheels = self.bus.subscribe(WheelsMeasured, WheelsDriven)
        self.task = asyncio.create_task(self.service.run())

    @property
    def elapsed_s(self) -> float:
        """Seconds since the rig was built."""
        return self.clock.now_s() - self.start_s

    @property
    def duty(self) -> tuple[int, ...]:
        """The last duty on the wire."""
        return self.written[-1][1]

    async def open_link(self) -> None:
        """The board is there."""
        self.bus.publish(LinkOpened(self.clock.now_s(), "fake"))
        await asyncio.sleep(0)

    async def frames(self, seconds: float, *, counts: tuple[int, int] = (0, 0)) -> None:
        """Encoder frames every 10 ms, always the same counts."""
        for _ in range(round(seconds / 0.01)):
            await asyncio.sleep(0.01)
            self.bus.publish(EncodersCounted(*[self.clock.now_s()] * 3, counts))
            await asyncio.sleep(0)

    async def drive_for(self, seconds: float) -> None:
        """Command and frames together, both every 10 ms."""
        for _ in range(round(seconds / 0.01)):
            self.service.command("teleop", AHEAD)
            await self.frames(0.01)

    def modes(self) -> list[tuple[str, str | None]]:
        """Safety events since the last call, as mode and source."""
        events = [self.safety.take() for _ in range(len(self.safety))]
        return [(event.mode, event.source) for event in events]


def on_rig(
    scenario: Callable[[Rig], Awaitable[None]], rearm: Rearm = Rearm.MANUAL, latch: Path | None = None
) -> None:
    """Run a scenario with the link open, on the virtual clock."""

    async def run() -> None:
        rig = Rig(rearm, latch)
        await asyncio.sleep(0)
        await rig.open_link()
        await scenario(rig)
        rig.task.cancel()
        await asyncio.gather(rig.task, return_exceptions=True)

    run_virtual(run())


def test_every_encoder_frame_is_answered_with_a_duty():
    """Also at rest: a stop that was lost on the wire is repeated with every frame."""

    async def scenario(rig: Rig) -> None:
        before = len(rig.written)
        await rig.frames(0.1)
        assert [duty for _, duty in rig.written[before:]] == [(0, 0)] * 10
        assert rig.service.steps == 10

    on_rig(scenario)


def test_an_encoder_frame_is_answered_before_publishing_it_returns():
    """No turn of the loop lies between the bytes of a frame and its duty."""

    async def scenario(rig: Rig) -> None:
        await rig.frames(0.02)
        before = len(rig.written)
        rig.bus.publish(
            EncodersCounted(rig.clock.now_s(), rig.clock.now_s(), rig.clock.now_s() + 0.01, (0, 0))
        )
        assert [duty for _, duty in rig.written[before:]] == [(0, 0)]

    on_rig(scenario)


def test_a_command_is_on_the_wire_before_the_call_returns():
    """No frame and no turn of the loop lies between the command and its duty."""

    async def scenario(rig: Rig) -> None:
        await rig.frames(0.02)
        await asyncio.sleep(0.005)
        rig.service.command("teleop", AHEAD)
        assert rig.duty == (45, 45)  # 40 + 1000 * (1 m/s² * 5 ms)

    on_rig(scenario)


def test_nothing_moves_before_the_first_reading_of_a_link():
    """Newly opened, or opened again after a drive: only stops until the encoders are heard, and that is told."""

    async def scenario(rig: Rig) -> None:
        for _ in range(2):
            before = len(rig.written)
            rig.service.command("teleop", AHEAD)
            await asyncio.sleep(0.1)
            rig.service.command("teleop", AHEAD)
            assert {duty for _, duty in rig.written[before:]} <= {(0, 0)}
            assert [rig.safety.take() for _ in range(len(rig.safety))][-1].limited_by == "encoders_stale"
            await rig.drive_for(0.1)
            assert any(rig.duty)
            rig.bus.publish(LinkClosed(rig.clock.now_s(), "fake", "unplugged"))
            await asyncio.sleep(0)
            await rig.open_link()
            rig.service.arm()

    on_rig(scenario)


def test_speed_ramps_up_within_the_acceleration_limit():
    """At 1 m/s² the setpoint is 0.1 m/s after 0.1 s and 0.2 m/s from 0.2 s on."""

    async def scenario(rig: Rig) -> None:
        await rig.frames(0.01)
        await rig.drive_for(0.1)
        assert rig.duty == (140, 140)
        await rig.drive_for(0.15)
        assert rig.duty == FULL_DUTY

    on_rig(scenario)


def test_the_dead_man_ramps_down_and_brakes():
    """0.5 s after the last command the setpoint falls at 1 m/s²: still at 0.45 s, at rest by 0.75 s."""

    async def scenario(rig: Rig) -> None:
        await rig.frames(0.01)
        await rig.drive_for(0.3)
        await rig.frames(0.45)
        assert rig.duty == FULL_DUTY
        await rig.frames(0.15)
        assert 0 < rig.duty[0] < 240
        await rig.frames(0.15)
        assert rig.duty == (0, 0)

    on_rig(scenario)


def test_the_dead_man_does_not_need_encoder_frames():
    """Encoders fall silent while driving: the ramp to zero happens all the same, on the watch period."""

    async def scenario(rig: Rig) -> None:
        await rig.frames(0.01)
        await rig.drive_for(0.3)
        await asyncio.sleep(0.8)
        assert rig.duty == (0, 0)
        stopped_s = next(at for at, duty in rig.written if at > 0.4 and duty == (0, 0))
        assert stopped_s <= 0.3 + 0.5 + 0.2 + 2 * 0.02 + 0.011

    on_rig(scenario)


def test_stop_ramps_down_at_once():
    """Stop does not wait for the dead-man: at rest after the 0.2 s that braking from 0.2 m/s takes."""

    async def scenario(rig: Rig) -> None:
        await rig.frames(0.01)
        await rig.drive_for(0.3)
        rig.service.stop()
        await rig.frames(0.1)
        assert 0 < rig.duty[0] < 240
        await rig.frames(0.12)
        assert rig.duty == (0, 0)

    on_rig(scenario)


def test_a_released_source_gives_way_at_once():
    """Teleop held the robot still; once it is forgotten, navigation's command is on the wire in the same call."""

    async def scenario(rig: Rig) -> None:
        await rig.frames(0.02)
        rig.service.command("navigation", AHEAD)
        rig.service.command("teleop", Twist2D())
        await rig.frames(0.05)
        assert rig.duty == (0, 0)
        await asyncio.sleep(0.005)
        rig.service.release("teleop")
        assert rig.duty == (45, 45)
        rig.service.release("safety")
        await rig.frames(0.01)
        assert rig.modes()[-1] == ("armed", "navigation")

    on_rig(scenario)


def test_releasing_the_last_source_brakes_within_the_limits():
    """Nobody else asks for anything: the robot ramps down, at rest 0.2 s later; also unlinked nobody minds."""

    async def scenario(rig: Rig) -> None:
        await rig.frames(0.01)
        await rig.drive_for(0.3)
        rig.service.release("teleop")
        await rig.frames(0.1)
        assert 0 < rig.duty[0] < 240
        await rig.frames(0.12)
        assert rig.duty == (0, 0)
        rig.bus.publish(LinkClosed(rig.clock.now_s(), "fake", "pulled"))
        await asyncio.sleep(0)
        rig.service.release("teleop")
        assert rig.duty == (0, 0)

    on_rig(scenario)


def test_braking_is_zero_at_once_and_no_command_is_left():
    """Zero in the same call and ever after, although the command was a moment old; a new one moves it again."""

    async def scenario(rig: Rig) -> None:
        await rig.frames(0.01)
        await rig.drive_for(0.3)
        rig.service.brake()
        assert rig.duty == (0, 0)
        before = len(rig.written)
        await rig.frames(0.3)
        assert {duty for _, duty in rig.written[before:]} == {(0, 0)}
        await rig.drive_for(0.05)
        assert rig.duty[0] > 0

    on_rig(scenario)


def test_each_wheel_is_driven_as_it_was_named():
    """2 rad/s on a radius of 0.05 m: 40 + 1000 * 0.1 for the right one, nothing for the left one."""

    async def scenario(rig: Rig) -> None:
        await rig.frames(0.01)
        for _ in range(20):
            rig.service.command("teleop", rig.service.wheel_velocities({"right_wheel": 2.0}))
            await rig.frames(0.01)
        assert rig.duty == (0, 140)

    on_rig(scenario)


def test_an_estop_is_zero_at_once_latches_and_does_not_jump_on_release():
    """Zero in the same call; commands refused until arm; after arm still zero, then a ramp from rest."""

    async def scenario(rig: Rig) -> None:
        await rig.frames(0.01)
        await rig.drive_for(0.3)
        rig.service.estop("button")
        assert rig.duty == (0, 0)
        with pytest.raises(Refused) as refusal:
            rig.service.command("teleop", AHEAD)
        assert refusal.value.kind is RefusalKind.ESTOPPED
        await rig.frames(0.2)
        rig.service.arm()
        rig.service.resume(("teleop",))
        await rig.frames(0.1)
        assert rig.duty == (0, 0)
        rig.service.command("teleop", AHEAD)
        await rig.frames(0.01)
        assert rig.duty[0] <= 60
        assert rig.modes() == [
            ("no_board", None),
            ("armed", None),
            ("armed", "teleop"),
            ("estopped", None),
            ("armed", None),
            ("armed", "teleop"),
        ]

    on_rig(scenario)


@pytest.mark.parametrize(
    "fault", [LinkClosed(0.0, "fake", "unplugged"), BoardRestarted(0.0, "banner")], ids=["link", "board"]
)
def test_a_lost_link_and_a_restarted_board_disarm_until_arm(fault: object):
    """The link comes back by itself, motion only after arm."""

    async def scenario(rig: Rig) -> None:
        await rig.drive_for(0.3)
        rig.bus.publish(fault)
        await asyncio.sleep(0)
        assert rig.duty == (0, 0)
        await rig.open_link()
        with pytest.raises(Refused) as refusal:
            rig.service.command("teleop", AHEAD)
        assert refusal.value.kind is RefusalKind.DISARMED
        rig.service.arm()
        rig.service.command("teleop", AHEAD)

    on_rig(scenario)


@pytest.mark.parametrize(
    ("fault", "named"),
    sample(
        [
            (LinkClosed(0.0, "fake", "unplugged"), "link_lost"),
            (BoardRestarted(0.0, "banner"), "board_restarted"),
        ]
    ),
    ids=["link", "board"],
)
def test_a_flood_of_frames_does_not_push_a_fault_out(fault: object, named: str):
    """Ten thousand frames before the loop has a turn, the fault among the first: it latches, and zero is on the wire."""

    async def scenario(rig: Rig) -> None:
        await rig.frames(0.01)
        await rig.drive_for(0.3)
        now_s, frames = rig.clock.now_s(), 10_000
        for number in range(frames):
            rig.bus.publish(EncodersCounted(now_s, now_s, now_s + number / frames, (0, 0)))
            if number == 10:
                rig.bus.publish(fault)
        await rig.frames(0.01)
        latched = [event for event in (rig.safety.take() for _ in range(len(rig.safety))) if event.fault]
        assert [event.fault for event in latched] == [named]
        assert rig.duty == (0, 0)
        assert not rig.service.is_driving

    on_rig(scenario)


@pytest.mark.parametrize("fault", [LinkClosed(0.0, "fake", "unplugged"), BoardRestarted(0.0, "banner")])
def test_with_rearm_auto_the_fault_ends_by_itself_but_an_estop_does_not(fault: object):
    """After the link or the board is back commands are taken again, from rest; an e-stop still needs arm."""

    async def scenario(rig: Rig) -> None:
        await rig.drive_for(0.3)
        rig.bus.publish(fault)
        await rig.open_link()
        assert rig.duty == (0, 0)
        rig.service.command("teleop", AHEAD)
        rig.service.estop("button")
        rig.bus.publish(fault)
        await rig.open_link()
        with pytest.raises(Refused):
            rig.service.command("teleop", AHEAD)

    on_rig(scenario, Rearm.AUTO)


def test_an_estop_is_remembered_before_the_call_returns(tmp_path: Path):
    """Whoever has the answer may kill the daemon: the next one is estopped."""

    async def scenario(rig: Rig) -> None:
        await rig.drive_for(0.3)
        rig.service.estop("button")
        assert LatchFile(tmp_path / "latch").recall() == GateState(Mode.ESTOPPED, "button")

    on_rig(scenario, latch=tmp_path / "latch")


def test_a_latch_that_cannot_be_written_holds_up_no_stop(tmp_path: Path):
    """A file is where its folder was: zero in the same call and latched, as ever."""
    folder = tmp_path / "folder"

    async def scenario(rig: Rig) -> None:
        await rig.drive_for(0.3)
        folder.rename(tmp_path / "gone")
        folder.touch()
        rig.service.estop("button")
        assert rig.duty == (0, 0)
        with pytest.raises(Refused) as refusal:
            rig.service.command("teleop", AHEAD)
        assert refusal.value.kind is RefusalKind.ESTOPPED

    on_rig(scenario, latch=folder / "latch")


@pytest.mark.parametrize("rearm", Rearm)
def test_after_a_daemon_that_ended_badly_nothing_moves_before_arm(tmp_path: Path, rearm: Rearm):
    """It left word that it was armed: disarmed whatever becomes of the link, with rearm = "auto" too."""
    LatchFile(tmp_path / "latch").keep(GateState())

    async def scenario(rig: Rig) -> None:
        await rig.frames(0.1)
        rig.bus.publish(LinkClosed(0.0, "fake", "unplugged"))
        await rig.open_link()
        rig.bus.publish(BoardRestarted(0.0, "banner"))
        await rig.frames(0.1)
        with pytest.raises(Refused) as refusal:
            rig.service.command("teleop", AHEAD)
        assert refusal.value.kind is RefusalKind.DISARMED
        assert {rig.safety.take().fault for _ in range(len(rig.safety))} == {FaultKind.UNCLEAN_SHUTDOWN}
        rig.service.arm()
        await rig.drive_for(0.3)
        assert rig.duty > (0, 0)

    on_rig(scenario, rearm, tmp_path / "latch")


def test_without_a_link_there_is_nothing_to_arm():
    """Arming is refused while the board is away: there is nothing to arm."""

    async def scenario(rig: Rig) -> None:
        rig.bus.publish(LinkClosed(0.0, "fake", "unplugged"))
        await asyncio.sleep(0)
        with pytest.raises(Refused) as refusal:
            rig.service.arm()
        assert refusal.value.kind is RefusalKind.LINK_DOWN

    on_rig(scenario)


def test_before_the_first_link_a_command_is_refused():
    """The daemon starts armed, but there is nobody to drive: the refusal says that the board is not connected."""

    async def run() -> None:
        rig = Rig()
        await asyncio.sleep(0)
        with pytest.raises(Refused) as refusal:
            rig.service.command("teleop", AHEAD)
        assert refusal.value.kind is RefusalKind.LINK_DOWN
        await rig.open_link()
        await rig.frames(0.1)
        assert rig.duty == (0, 0)
        rig.task.cancel()
        await asyncio.gather(rig.task, return_exceptions=True)

    run_virtual(run())


def test_wheels_are_measured_in_radians_and_board_time():
    """500 of 1000 counts in 0.5 s of board time are pi rad travelled; half of a wheel's turn."""

    async def scenario(rig: Rig) -> None:
        rig.bus.publish(EncodersCounted(rig.clock.now_s(), rig.clock.now_s(), 10.0, (0, 0)))
        rig.bus.publish(EncodersCounted(rig.clock.now_s(), rig.clock.now_s(), 10.5, (500, -500)))
        await asyncio.sleep(0)
        measured = [
            e for e in (rig.wheels.take() for _ in range(len(rig.wheels))) if isinstance(e, WheelsMeasured)
        ]
        assert measured[-1].travel_rad == pytest.approx((3.14159265, -3.14159265))
        assert measured[-1].velocity_rad_s == pytest.approx((6.2831853, -6.2831853))

    on_rig(scenario)


def test_an_impossible_jump_moves_nothing_and_is_counted():
    """Counts that lost digits: no wheel event, one refusal; the next good reading carries on."""

    async def scenario(rig: Rig) -> None:
        await rig.frames(0.02, counts=(12345, 12345))
        before = len(rig.wheels)
        await rig.frames(0.01, counts=(12345, 123))
        assert len(rig.wheels) == before
        assert rig.service.readings_refused == 1
        await rig.frames(0.01, counts=(12346, 12346))
        assert rig.wheels.take().position_rad == (0.0, 0.0)

    on_rig(scenario)


def test_a_board_restart_rebases_the_encoders():
    """Counts at zero after the restart are no travel, and positions go on."""

    async def scenario(rig: Rig) -> None:
        await rig.frames(0.02, counts=(5000, 5000))
        rig.bus.publish(BoardRestarted(rig.clock.now_s(), "banner"))
        await rig.frames(0.02, counts=(0, 0))
        measured = [
            e for e in (rig.wheels.take() for _ in range(len(rig.wheels))) if isinstance(e, WheelsMeasured)
        ]
        assert len(measured) == 4
        assert all(event.travel_rad == (0.0, 0.0) for event in measured)
        assert rig.service.readings_refused == 0

    on_rig(scenario)


def test_gains_change_while_it_drives():
    """The gains that are exchanged are the ones that it has, and the duty goes on as it was."""

    async def scenario(rig: Rig) -> None:
        await rig.frames(0.01)
        await rig.drive_for(0.3)
        changed = {name: gains.model_copy(update={"kp": 5.0}) for name, gains in rig.service.gains().items()}
        rig.service.retune(changed)
        assert rig.service.gains() == changed
        rig.service.command("teleop", AHEAD)
        assert rig.duty == FULL_DUTY

    on_rig(scenario)


def test_a_control_step_that_fails_disarms_and_the_loop_lives_on():
    """Counts of too many wheels are a bug: zero at once, counted, logged once; frames still get answers."""

    async def scenario(rig: Rig) -> None:
        await rig.drive_for(0.3)
        for _ in range(3):
            rig.bus.publish(EncodersCounted(*[rig.clock.now_s()] * 3, (1, 2, 3)))
        await asyncio.sleep(0)
        assert rig.duty == (0, 0)
        assert rig.service.internal_errors == 3
        with pytest.raises(Refused, match="zip"):
            rig.service.command("teleop", AHEAD)
        steps = rig.service.steps
        await rig.frames(0.1)
        assert rig.service.steps == steps + 10
        rig.service.arm()
        await rig.drive_for(0.3)
        assert rig.duty == FULL_DUTY

    with structlog.testing.capture_logs() as written:
        on_rig(scenario)
    assert [line["event"] for line in written].count("a control step failed") == 1


def test_a_control_loop_that_is_cancelled_stops_the_motors():
    """Its last word is zero."""

    async def scenario(rig: Rig) -> None:
        await rig.drive_for(0.3)
        rig.task.cancel()
        await asyncio.gather(rig.task, return_exceptions=True)
        assert rig.duty == (0, 0)

    on_rig(scenario)


def test_an_error_while_a_command_is_carried_out_is_told_to_the_caller():
    """A twist that is no number ends in zero, a latched fault, and an error for the one who asked."""

    async def scenario(rig: Rig) -> None:
        await rig.drive_for(0.3)
        with pytest.raises(TypeError):
            rig.service.command("teleop", Twist2D("fast", 0.0))
        assert rig.duty == (0, 0)
        with pytest.raises(Refused) as refusal:
            rig.service.command("teleop", AHEAD)
        assert refusal.value.kind is RefusalKind.DISARMED

    on_rig(scenario)


def test_a_fault_reported_from_a_thread_comes_before_the_next_command():
    """The watchdog's word disarms even if a command is the first thing that the loop gets to see."""

    async def scenario(rig: Rig) -> None:
        await rig.drive_for(0.3)
        assert rig.service.is_driving
        rig.service.report_from_thread(Fault(FaultKind.LOOP_BLOCKED, "stood still"))
        with pytest.raises(Refused, match="stood still"):
            rig.service.command("teleop", AHEAD)
        await rig.frames(0.01)
        assert rig.duty == (0, 0)

    on_rig(scenario)


def test_a_stop_is_repeated_while_the_encoders_are_silent():
    """One line that was lost must not leave the motors on: every watch period says it again."""

    async def scenario(rig: Rig) -> None:
        await rig.drive_for(0.3)
        rig.service.estop("button")
        before = len(rig.written)
        await asyncio.sleep(0.2)
        assert [duty for _, duty in rig.written[before:]] == [(0, 0)] * 10

    on_rig(scenario)


def test_arming_what_is_armed_blinds_no_detector():
    """A program that arms before every move: a wheel that is driven and stands is named all the same, in time."""

    async def keep_arming(rig: Rig) -> None:
        for _ in range(40):
            await rig.drive_for(0.1)
            rig.service.arm()

    async def scenario(rig: Rig) -> None:
        with pytest.raises(Refused, match="left_wheel is driven and does not turn"):
            await keep_arming(rig)

    on_rig(scenario)


def stand_still(seconds: float) -> None:
    """The whole program is frozen for so long."""
    loop = asyncio.get_running_loop()
    assert isinstance(loop, VirtualLoop)
    loop.stand_still(seconds)


WAKES_FIRST: dict[str, Callable[[Rig], object]] = {
    "watchdog": lambda rig: rig.service.report_from_thread(Fault(FaultKind.LOOP_BLOCKED, "stood still")),
    "command": lambda rig: rig.service.command("teleop", AHEAD),
    "encoders": lambda rig: rig.bus.publish(EncodersCounted(*[rig.clock.now_s()] * 3, (57, -3))),
    "stop": lambda rig: rig.service.stop(),
    "timer": lambda rig: None,
}


@pytest.mark.parametrize("first", WAKES_FIRST)
@pytest.mark.parametrize("seconds", [0.26, 1.0, 3600.0])
def test_a_loop_that_stood_still_while_it_drove_disarms_whoever_wakes_first(first: str, seconds: float):
    """Frozen for longer than 0.25 s: zero and `loop_blocked`, by the next command, reading, stop, timer or watchdog."""

    async def scenario(rig: Rig) -> None:
        await rig.drive_for(0.3)
        assert any(rig.duty)
        stand_still(seconds)
        with contextlib.suppress(Refused):
            WAKES_FIRST[first](rig)
        await asyncio.sleep(0.03)
        assert rig.duty == (0, 0)
        told = [rig.safety.take() for _ in range(len(rig.safety))][-1]
        assert (told.mode, told.fault) == ("disarmed", "loop_blocked")

    on_rig(scenario)


def test_a_pause_that_is_shorter_than_the_patience_is_no_fault():
    """0.24 s, and the next command is carried out."""

    async def scenario(rig: Rig) -> None:
        await rig.drive_for(0.3)
        stand_still(0.24)
        await rig.drive_for(0.3)
        assert rig.duty == FULL_DUTY

    on_rig(scenario)


def test_a_loop_that_stood_still_at_rest_is_no_fault():
    """No duty was in force: armed as before, and the next command is carried out."""

    async def scenario(rig: Rig) -> None:
        await rig.frames(0.1)
        stand_still(5.0)
        await rig.drive_for(0.3)
        assert rig.duty == FULL_DUTY

    on_rig(scenario)
