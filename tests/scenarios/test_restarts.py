"""The real program ends, in order or not, and another is started in its place: may the robot move?"""

import asyncio
import os
import signal
from collections.abc import Callable, Mapping
from pathlib import Path

import pytest

from chefbotd.client import CallError, Client
from tests.scenarios.process import (
    BROKEN_SERVICE,
    PERIOD_S,
    SPEED_M_S,
    Program,
    drive_until_told,
    driving,
    second_daemon,
    started,
)

pytestmark = pytest.mark.realtime


def configured(folder: Path) -> Mapping[str, str]:
    """The environment that names a folder for the latch."""
    return {"CHEFBOTD_LATCH__FOLDER": str(folder)}


def by_systemd(folder: Path) -> Mapping[str, str]:
    """The environment of a unit with a RuntimeDirectory."""
    return {"RUNTIME_DIRECTORY": str(folder)}


async def ended(program: Program, number: signal.Signals) -> None:
    """Signal it, and wait for its end."""
    os.kill(program.process.pid, number)
    await program.ended()


async def board_there(client: Client) -> None:
    """Until then the mode is `no_board` where the robot would be armed."""
    async with client.subscribe("link") as changes:
        while (await anext(changes)).data.state != "up":
            pass


async def refused_until_armed(program: Program, client: Client, kind: str) -> None:
    """Once the board is there, commands are refused as ``kind`` and nothing moves; after ``arm`` the robot does."""
    await board_there(client)
    while program.board.told_to_move:  # noqa: ASYNC110 - the first stop is on its way, and nobody tells us
        await asyncio.sleep(PERIOD_S)
    refusals: list[str] = []
    while refusals.count(kind) < 5:
        with pytest.raises(CallError) as refusal:
            await client.drive(SPEED_M_S, 0.0)
        refusals.append(refusal.value.kind)
        assert refusals[-1] in (kind, "too_old")  # too old on a busy computer
    assert not program.board.told_to_move
    await client.arm()
    await drive_until_told(program.board, client)


@pytest.mark.parametrize(
    ("robot", "remembering", "end"),
    [
        ("chefbot", configured, signal.SIGKILL),
        ("khan", configured, signal.SIGKILL),
        ("chefbot", by_systemd, signal.SIGKILL),
        ("chefbot", configured, signal.SIGTERM),
    ],
)
def test_an_estop_outlives_the_program(
    tmp_path: Path, robot: str, remembering: Callable[[Path], Mapping[str, str]], end: signal.Signals
):
    """However it ends: the next one is estopped for the same reason, and moves nothing before its own is cleared."""

    async def scenario() -> None:
        async with driving(tmp_path, robot=robot, environment=remembering(tmp_path)) as (program, client):
            await client.estop("smoke")
            seen = (await client.get_state()).safety.latch
            await ended(program, end)
            async with second_daemon(program) as second, second.client() as again:
                assert (await again.call("get_state"))["safety"]["reason"] == "smoke"
                await board_there(again)
                with pytest.raises(CallError, match="the daemon was restarted"):
                    await again.arm(seen)
                await refused_until_armed(second, again, "estopped")

    asyncio.run(scenario())


def test_whoever_is_killed_in_mid_drive_leaves_a_robot_that_is_disarmed(tmp_path: Path):
    """Killed while armed: the next one stops the motors, is disarmed as `unclean_shutdown`, and drives after arm."""

    async def scenario() -> None:
        async with driving(tmp_path, environment=configured(tmp_path)) as (program, _):
            await ended(program, signal.SIGKILL)
            async with second_daemon(program) as second, second.client() as again:
                assert (await again.call("get_state"))["safety"]["fault"] == "unclean_shutdown"
                await refused_until_armed(second, again, "disarmed")

    asyncio.run(scenario())


@pytest.mark.slow
def test_a_failure_that_ends_the_program_is_not_in_order(tmp_path: Path):
    """Exit code 1: what starts next is disarmed for the failure, whose fault latched before the end."""

    async def scenario() -> None:
        async with started(tmp_path, BROKEN_SERVICE, environment=configured(tmp_path)) as program:
            assert await program.ended() == 1
            async with second_daemon(program) as second, second.client() as again:
                assert (await again.call("get_state"))["safety"]["fault"] == "service_failed"
                await refused_until_armed(second, again, "disarmed")

    asyncio.run(scenario())


def test_whoever_ends_in_order_leaves_a_robot_that_is_armed(tmp_path: Path):
    """SIGTERM while armed leaves no file, and the next one drives at once."""

    async def scenario() -> None:
        async with driving(tmp_path, environment=configured(tmp_path / "latch")) as (program, _):
            assert len(list((tmp_path / "latch").iterdir())) == 1
            await ended(program, signal.SIGTERM)
            assert list((tmp_path / "latch").iterdir()) == []
            async with second_daemon(program) as second, second.client() as again:
                await board_there(again)
                assert (await again.call("get_state"))["safety"]["mode"] == "armed"
                await drive_until_told(second.board, again)

    asyncio.run(scenario())


@pytest.mark.slow
def test_without_a_folder_there_is_no_memory_and_the_log_says_so(tmp_path: Path):
    """Neither configured nor under systemd: an e-stop goes with the program."""

    async def scenario() -> None:
        async with driving(tmp_path) as (program, client):
            await client.estop("smoke")
            await ended(program, signal.SIGKILL)
            assert program.log.read_text().count("a restart forgets an e-stop or a fault") == 1
            async with second_daemon(program) as second, second.client() as again:
                await board_there(again)
                assert (await again.call("get_state"))["safety"]["mode"] == "armed"

    asyncio.run(scenario())
