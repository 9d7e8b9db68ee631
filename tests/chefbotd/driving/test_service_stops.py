"""What stops the control loop: an estop, a lost link, a fault, what was remembered; and what arms it again."""

import asyncio
from pathlib import Path

import pytest

from chefbotd.clock import run_virtual
from chefbotd.core.commands import RefusalKind, Refused
from chefbotd.core.events import BoardRestarted, EncodersCounted, LinkClosed
from chefbotd.process.latch_file import LatchFile
from chefbotd.safety.faults import FaultKind
from chefbotd.safety.gate import GateState, Mode, Rearm
from tests.budget import sample
from tests.chefbotd.driving.rig import AHEAD, Rig, on_rig


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
        rig.arm()
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
        rig.arm()
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
        latched = [
            event for event in (rig.safety.take_event() for _ in range(len(rig.safety))) if event.fault
        ]
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
        assert {rig.safety.take_event().fault for _ in range(len(rig.safety))} == {FaultKind.UNCLEAN_SHUTDOWN}
        rig.arm()
        await rig.drive_for(0.3)
        assert rig.duty > (0, 0)

    on_rig(scenario, rearm, tmp_path / "latch")


def test_without_a_link_there_is_nothing_to_arm():
    """Arming is refused while the board is away: there is nothing to arm."""

    async def scenario(rig: Rig) -> None:
        rig.bus.publish(LinkClosed(0.0, "fake", "unplugged"))
        await asyncio.sleep(0)
        with pytest.raises(Refused) as refusal:
            rig.arm()
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


def test_stops_are_counted_and_say_who():
    """A stop and an e-stop, each once and with its name; a stop is on the wire before the call returns."""

    async def scenario(rig: Rig) -> None:
        await rig.frames(0.01)
        await rig.drive_for(0.3)
        await asyncio.sleep(0.005)
        rig.service.stop("Bob")
        assert rig.duty == (235, 235)  # 5 ms of braking at 1 m/s2
        assert (rig.service.stops, rig.service.stopped_by) == (1, "Bob")
        rig.service.estop("smoke")
        assert (rig.service.stops, rig.service.stopped_by) == (2, "an emergency stop")

    on_rig(scenario)


def test_the_watch_looks_from_the_start_and_ends_with_the_service():
    """Nothing was ever heard: it has looked within 20 ms all the same; after the end nothing is written."""

    async def run() -> None:
        rig = Rig()
        await asyncio.sleep(0.5)
        assert rig.clock.now_s() - rig.service.acted_s <= 0.021
        rig.task.cancel()
        await asyncio.gather(rig.task, return_exceptions=True)
        before = len(rig.written)
        await asyncio.sleep(0.5)
        assert len(rig.written) == before

    run_virtual(run())


def test_between_frames_the_watch_writes_what_has_changed_only():
    """At a steady 0.2 m/s 0.1 s without frames write nothing; the ramp down of a stop is written at each look."""

    async def scenario(rig: Rig) -> None:
        await rig.frames(0.01)
        await rig.drive_for(0.3)
        before = len(rig.written)
        await asyncio.sleep(0.1)
        assert len(rig.written) == before
        rig.service.stop()
        await asyncio.sleep(0.09)
        left = [duty[0] for _, duty in rig.written[before + 1 :]]
        assert left == [220, 200, 180, 160]  # 20 ms at 1 m/s2 are 0.02 m/s

    on_rig(scenario)


def test_a_board_that_restarted_begins_at_zero_where_the_fault_passes_by_itself():
    """With rearm auto the robot stays armed; it was at 0.2 m/s, and no duty is ramped down on a new board."""

    async def scenario(rig: Rig) -> None:
        await rig.frames(0.01)
        await rig.drive_for(0.3)
        rig.bus.publish(BoardRestarted(rig.clock.now_s(), "its banner"))
        assert rig.duty == (0, 0)
        before = len(rig.written)
        await rig.frames(0.1)
        assert {duty for _, duty in rig.written[before:]} == {(0, 0)}

    on_rig(scenario, Rearm.AUTO)
