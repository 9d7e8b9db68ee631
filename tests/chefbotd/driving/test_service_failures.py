"""What goes wrong in the control loop itself, and what is told to it from elsewhere."""

import asyncio

import pytest
import structlog

from chefbotd.core.commands import RefusalKind, Refused
from chefbotd.core.events import EncodersCounted
from chefbotd.core.geometry import Twist2D
from chefbotd.safety.faults import Fault, FaultKind
from tests.chefbotd.driving.rig import AHEAD, FULL_DUTY, Rig, on_rig


def test_a_control_step_that_fails_disarms_and_the_loop_lives_on():
    """Counts of too many wheels are a bug: zero at once, counted, logged once; frames still get answers."""

    async def scenario(rig: Rig) -> None:
        await rig.drive_for(0.3)
        for _ in range(3):
            rig.bus.publish(EncodersCounted(*[rig.clock.now_s()] * 3, (1, 2, 3)))
        await asyncio.sleep(0)
        assert rig.duty == (0, 0)
        assert rig.service.memory.internal_errors == 3
        with pytest.raises(Refused, match="zip"):
            rig.service.command("teleop", AHEAD)
        steps = rig.service.memory.steps
        await rig.frames(0.1)
        assert rig.service.memory.steps == steps + 10
        rig.arm()
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
        rig.service.keeper.report_from_thread(Fault(FaultKind.LOOP_BLOCKED, "stood still"))
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
            rig.arm()

    async def scenario(rig: Rig) -> None:
        with pytest.raises(Refused, match="left_wheel is driven and does not turn"):
            await keep_arming(rig)

    on_rig(scenario)


def test_a_reading_that_shows_a_fault_is_answered_by_zero_in_the_same_call() -> None:
    """The duty goes first; what judges the reading then writes zeros behind it, and the board reads both at once."""

    async def scenario(rig: Rig) -> None:
        with pytest.raises(Refused, match="does not turn"):
            await rig.drive_for(
                3.0
            )  # the counts never change: the wheels are stalled after 1.75 s of driving
        fault_s = next(when for when, duty in rig.written if when > 1.0 and not any(duty))
        assert [duty for when, duty in rig.written if when == fault_s] == [FULL_DUTY, (0, 0)]
        assert all(not any(duty) for when, duty in rig.written if when > fault_s)
        assert not rig.service.keeper.armed

    on_rig(scenario)
