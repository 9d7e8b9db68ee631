"""The control loop stands still for a while: what the robot does then, whoever wakes first."""

import asyncio
import contextlib
from collections.abc import Callable

import pytest
import structlog

from chefbotd.clock import VirtualLoop
from chefbotd.core.commands import Refused
from chefbotd.core.events import EncodersCounted
from chefbotd.safety.faults import Fault, FaultKind
from chefbotd.safety.watchdog import WatchdogParameters, judge_pause
from tests.budget import sample
from tests.chefbotd.driving.rig import AHEAD, FULL_DUTY, Rig, on_rig


def stand_still(seconds: float) -> None:
    """The whole program is frozen for so long."""
    loop = asyncio.get_running_loop()
    assert isinstance(loop, VirtualLoop)
    loop.stand_still(seconds)


WAKES_FIRST: dict[str, Callable[[Rig], object]] = {
    "command": lambda rig: rig.service.command("teleop", AHEAD),
    "encoders": lambda rig: rig.bus.publish(EncodersCounted(*[rig.clock.now_s()] * 3, (57, -3))),
    "stop": lambda rig: rig.service.stop(),
    "timer": lambda rig: None,
}


def watchdog_reports(rig: Rig) -> None:
    """As it does after a long pause."""
    rig.service.keeper.report_from_thread(Fault(FaultKind.LOOP_BLOCKED, "stood still"))


def told(rig: Rig) -> tuple[str, str | None]:
    """The newest mode and fault."""
    event = [rig.safety.take_event() for _ in range(len(rig.safety))][-1]
    return event.mode, event.fault


@pytest.mark.parametrize("first", [*WAKES_FIRST, "watchdog"])
@pytest.mark.parametrize("seconds", [1.01, 3600.0])
def test_a_long_pause_while_driving_disarms_whoever_wakes_first(first: str, seconds: float):
    """Frozen for a second: zero and `loop_blocked`, by the next command, reading, stop, timer or watchdog."""

    async def scenario(rig: Rig) -> None:
        await rig.drive_for(0.3)
        assert any(rig.duty)
        stand_still(seconds)
        with contextlib.suppress(Refused):
            {**WAKES_FIRST, "watchdog": watchdog_reports}[first](rig)
        await asyncio.sleep(0.03)
        assert rig.duty == (0, 0)
        assert told(rig) == ("disarmed", "loop_blocked")

    on_rig(scenario)


@pytest.mark.parametrize("first", ["encoders", "stop", "timer"])
@pytest.mark.parametrize("seconds", sample([0.26, 0.49, 0.99]))
def test_a_short_pause_while_driving_brakes_and_what_was_asked_before_moves_nothing(
    first: str, seconds: float
):
    """Zero by whoever wakes first, and for ever: the last command is from before the pause, however young it is."""

    async def scenario(rig: Rig) -> None:
        await rig.drive_for(0.3)
        stand_still(seconds)
        before = len(rig.written)
        WAKES_FIRST[first](rig)
        await rig.frames(0.6)
        assert {duty for _, duty in rig.written[before:]} == {(0, 0)}
        assert told(rig)[0] == "armed"

    on_rig(scenario)


@pytest.mark.parametrize("seconds", sample([0.26, 0.99]))
def test_after_a_short_pause_the_next_command_moves_the_robot(seconds: float):
    """From a standstill, through the ramp: the first duty after the pause is zero. Counted, and said once."""

    async def scenario(rig: Rig) -> None:
        await rig.drive_for(0.3)
        stand_still(seconds)
        before = len(rig.written)
        rig.service.command("teleop", AHEAD)
        assert [duty for _, duty in rig.written[before:]] == [
            (0, 0)
        ] * 2  # and none before encoders are heard
        await rig.drive_for(0.1)
        assert 0 < rig.duty[0] < FULL_DUTY[0]
        await rig.drive_for(0.3)
        assert rig.duty == FULL_DUTY
        assert rig.service.memory.pauses == 1

    with structlog.testing.capture_logs() as logged:
        on_rig(scenario)
    (warned,) = [each for each in logged if "stood still" in each["event"]]
    assert (warned["stood_s"], warned["pauses_in_a_minute"]) == (pytest.approx(seconds, abs=0.011), 1)


def test_a_pause_that_is_shorter_than_the_patience_is_none():
    """0.24 s, and the robot drives on by what was asked before."""

    async def scenario(rig: Rig) -> None:
        await rig.drive_for(0.3)
        stand_still(0.24)
        await rig.frames(0.02)
        assert any(rig.duty)
        await rig.drive_for(0.3)
        assert rig.duty == FULL_DUTY
        assert rig.service.memory.pauses == 0

    on_rig(scenario)


@pytest.mark.parametrize("seconds", [0.3, 5.0])
def test_a_pause_at_rest_is_no_fault(seconds: float):
    """No duty was in force: armed as before, nothing is counted, and the next command is carried out."""

    async def scenario(rig: Rig) -> None:
        await rig.frames(0.1)
        for _ in range(5):
            stand_still(seconds)
            await rig.frames(0.1)
        await rig.drive_for(0.3)
        assert rig.duty == FULL_DUTY
        assert rig.service.memory.pauses == 0

    on_rig(scenario)


def test_a_command_before_a_pause_at_rest_moves_nothing_after_it():
    """Asked to go while the encoders are silent, then a pause of 0.3 s: the encoders are heard again, and it stands."""

    async def scenario(rig: Rig) -> None:
        await asyncio.sleep(0.4)
        rig.service.command("teleop", AHEAD)
        assert not any(rig.duty)
        stand_still(0.3)
        await rig.frames(0.2)
        assert not any(rig.duty)

    on_rig(scenario)


async def pause(rig: Rig, seconds: float = 0.3) -> None:
    """Drive, stand still, and be heard again."""
    await rig.drive_for(0.3)
    stand_still(seconds)
    await rig.frames(0.02)


def test_the_third_pause_within_a_minute_disarms_and_arming_counts_anew():
    """Twice the robot goes on. After `arm` it has two more; arming what is armed gives it none."""

    async def scenario(rig: Rig) -> None:
        for _ in range(2):
            for _ in range(2):
                await pause(rig)
                assert rig.service.keeper.armed
                rig.arm()
            await pause(rig)
            assert told(rig) == ("disarmed", "loop_blocked")
            assert "3 times within 60 s" in rig.service.keeper.gate.reason
            rig.arm()

    on_rig(scenario)


def test_pauses_that_are_apart_are_no_fault():
    """One every 31 s: never three within a minute."""

    async def scenario(rig: Rig) -> None:
        for _ in range(10):
            await pause(rig)
            await rig.frames(31.0)
        assert rig.service.keeper.armed
        assert rig.service.memory.pauses == 10

    on_rig(scenario)


def test_an_emergency_stop_stays_what_it_is_through_pauses():
    """Pressed right after a pause, and before the next: estopped, with its own reason."""

    async def scenario(rig: Rig) -> None:
        await rig.drive_for(0.3)
        stand_still(0.3)
        rig.service.estop("smoke")
        stand_still(2.0)
        await rig.frames(0.1)
        assert rig.duty == (0, 0)
        assert told(rig)[0] == "estopped"
        assert rig.service.keeper.gate.reason == "smoke"

    on_rig(scenario)


def test_what_a_pause_is_can_be_configured():
    """The second within a minute, or one of half a second; a pause that ended 60 s ago counts no longer."""
    parameters = WatchdogParameters(latch_after_s=0.5, latch_pauses=2)
    assert judge_pause(parameters, (), 100.0, 0.4) == ((100.0,), None)
    assert judge_pause(parameters, (40.0,), 100.0, 0.4) == ((100.0,), None)
    assert judge_pause(parameters, (40.1,), 100.0, 0.4)[1] is not None
    assert judge_pause(parameters, (), 100.0, 0.5)[1] is not None
