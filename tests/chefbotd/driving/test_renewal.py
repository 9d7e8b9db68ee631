"""A command that is given again holds for longer, and nothing else follows from it."""

import asyncio
from collections.abc import Callable

import pytest

from chefbotd.core.commands import RefusalKind, Refused
from chefbotd.core.events import LinkClosed
from chefbotd.core.geometry import Twist2D
from chefbotd.safety.faults import Fault, FaultKind
from tests.chefbotd.driving.rig import AHEAD, FULL_DUTY, Rig, on_rig

ANN, BOB = 1, 2


async def drive(rig: Rig) -> None:
    """Ann drives ahead, as fast as she asked for."""
    await rig.frames(0.01)
    for _ in range(30):
        rig.service.command("teleop", AHEAD, ANN)
        await rig.frames(0.01)
    assert rig.duty == FULL_DUTY


def test_a_renewed_command_holds_for_longer_and_writes_nothing() -> None:
    """Renewed 0.4 s after it was given, it is followed for another 0.5 s; then the dead-man ends it."""

    async def scenario(rig: Rig) -> None:
        await drive(rig)
        await rig.frames(0.4)
        before = len(rig.written)
        assert rig.service.renew_command("teleop", AHEAD, ANN)
        assert len(rig.written) == before
        await rig.frames(0.49)
        assert rig.duty == FULL_DUTY
        await rig.frames(0.03)
        assert rig.duty < FULL_DUTY

    on_rig(scenario)


def test_a_renewal_is_an_attempt_to_drive() -> None:
    """A stop by another client within a second of it holds the one that renewed."""

    async def scenario(rig: Rig) -> None:
        await drive(rig)
        await rig.frames(0.4)
        assert rig.service.renew_command("teleop", AHEAD, ANN)
        await rig.frames(0.7)
        rig.service.stop("bob", BOB)
        with pytest.raises(Refused) as refused:
            rig.service.command("teleop", AHEAD, ANN)
        assert refused.value.kind is RefusalKind.STOPPED

    on_rig(scenario)


def another_speed(rig: Rig) -> bool:
    """A little less."""
    return rig.service.renew_command("teleop", Twist2D(0.19, 0.0), ANN)


def another_source(rig: Rig) -> bool:
    """One with less to say."""
    return rig.service.renew_command("navigation", AHEAD, ANN)


def after_an_estop(rig: Rig) -> bool:
    """It is latched."""
    rig.service.estop("a test")
    return rig.service.renew_command("teleop", AHEAD, ANN)


def after_a_stop(rig: Rig) -> bool:
    """Its own."""
    rig.service.stop("ann", ANN)
    return rig.service.renew_command("teleop", AHEAD, ANN)


def after_a_fault(rig: Rig) -> bool:
    """A part has failed."""
    rig.service.fail(Fault(FaultKind.SERVICE_FAILED, "a test"))
    return rig.service.renew_command("teleop", AHEAD, ANN)


def after_a_thread_has_reported(rig: Rig) -> bool:
    """The fault has not latched yet."""
    rig.service.keeper.report_from_thread(Fault(FaultKind.LOOP_BLOCKED, "a test"))
    return rig.service.renew_command("teleop", AHEAD, ANN)


def after_the_link_was_lost(rig: Rig) -> bool:
    """The cable is out."""
    rig.bus.publish(LinkClosed(rig.clock.now_s(), "fake", "unplugged"))
    return rig.service.renew_command("teleop", AHEAD, ANN)


def while_a_higher_source_drives(rig: Rig) -> bool:
    """Safety drives slowly."""
    rig.service.command("safety", Twist2D(0.05, 0.0))
    return rig.service.renew_command("teleop", AHEAD, ANN)


def after_its_release(rig: Rig) -> bool:
    """Its driver has let go."""
    rig.service.release("teleop")
    return rig.service.renew_command("teleop", AHEAD, ANN)


def as_the_calibration(rig: Rig) -> bool:
    """No client drives as it."""
    return rig.service.renew_command("calibration", AHEAD, ANN)


@pytest.mark.parametrize(
    "ask",
    [
        another_speed,
        another_source,
        after_an_estop,
        after_a_stop,
        after_a_fault,
        after_a_thread_has_reported,
        after_the_link_was_lost,
        while_a_higher_source_drives,
        after_its_release,
        as_the_calibration,
    ],
)
def test_what_is_not_followed_as_it_is_cannot_be_renewed(ask: Callable[[Rig], bool]) -> None:
    """Another motion or source, and whatever has stopped the robot since: the gate keeps what it had."""

    async def scenario(rig: Rig) -> None:
        await drive(rig)
        assert not ask(rig)

    on_rig(scenario)


def test_a_stop_holds_whoever_would_renew() -> None:
    """Bob's stop: Ann is told so by the whole way, and the refused renewal has changed nothing."""

    async def scenario(rig: Rig) -> None:
        await drive(rig)
        rig.service.stop("bob", BOB)
        rig.service.command("teleop", AHEAD, BOB)
        await rig.frames(0.05)
        assert rig.service.renew_command("teleop", AHEAD, BOB)
        gate, held = rig.service.keeper.gate, rig.service.keeper.state().held
        assert not rig.service.renew_command("teleop", AHEAD, ANN)
        assert (rig.service.keeper.gate, rig.service.keeper.state().held) == (gate, held)

    on_rig(scenario)


def test_what_the_dead_man_has_ended_cannot_be_renewed() -> None:
    """Nor what is about to be, when the loop has not noticed yet: it is carried out as a new command."""

    async def scenario(rig: Rig) -> None:
        await drive(rig)
        await rig.frames(0.6)
        assert any(rig.duty)
        assert not rig.service.renew_command("teleop", AHEAD, ANN)

    on_rig(scenario)


def test_nothing_is_renewed_after_a_pause_of_the_loop() -> None:
    """It stood still for 0.3 s while the robot drove: earlier commands are void, and this one is a new one."""

    async def scenario(rig: Rig) -> None:
        await drive(rig)
        asyncio.get_running_loop().stand_still(0.3)  # type: ignore[attr-defined]
        assert not rig.service.renew_command("teleop", AHEAD, ANN)
        assert rig.service.memory.pauses == 0
        rig.service.command("teleop", AHEAD, ANN)
        assert rig.service.memory.pauses == 1

    on_rig(scenario)


def test_a_command_to_stand_is_carried_out_each_time() -> None:
    """A stop that was lost on the wire is repeated with every command."""

    async def scenario(rig: Rig) -> None:
        await rig.frames(0.05)
        rig.service.command("teleop", Twist2D(), ANN)
        assert not rig.service.renew_command("teleop", Twist2D(), ANN)

    on_rig(scenario)
