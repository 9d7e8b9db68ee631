"""The real program is frozen (SIGSTOP), as by a debugger, by a suspended computer or by swapping: what moves then?"""

import asyncio
import json
import os
import signal
import sys
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from pathlib import Path

import pytest

from chefbotd.cli.common.exits import Exit
from chefbotd.client import Client
from tests.budget import sample
from tests.scenarios.process import (
    PATIENCE_S,
    PERIOD_S,
    REST_M_S,
    SPEED_M_S,
    Board,
    Program,
    drive_once,
    driving,
    started,
    stopped,
)

pytestmark = pytest.mark.realtime

DRIVE = b'{"jsonrpc":"2.0","id":1,"method":"drive","params":{"linear_m_s":0.2,"angular_rad_s":0.1}}\n'


@asynccontextmanager
async def frozen(program: Program) -> AsyncIterator[None]:
    """It does not run while the context lasts."""
    os.kill(program.process.pid, signal.SIGSTOP)
    try:
        yield
    finally:
        os.kill(program.process.pid, signal.SIGCONT)


async def fastest_m_s(board: Board, seconds: float) -> float:
    """The robot's highest speed meanwhile."""
    fastest, until_s = 0.0, asyncio.get_running_loop().time() + seconds
    while asyncio.get_running_loop().time() < until_s:
        fastest = max(fastest, board.speed_m_s)
        await asyncio.sleep(PERIOD_S / 2)
    return fastest


async def at_rest(board: Board, client: Client) -> None:
    """Let go, and wait until it stands and no duty is left."""
    await client.stop()
    await stopped(board)
    await asyncio.sleep(0.5)


async def told(client: Client) -> tuple[str, str | None]:
    """Mode and fault."""
    safety = (await client.get_state()).safety
    return safety.mode, safety.fault


@asynccontextmanager
async def raw(program: Program) -> AsyncIterator[tuple[asyncio.StreamReader, asyncio.StreamWriter]]:
    """A client of bare lines, past its greeting."""
    reader, writer = await asyncio.open_connection("127.0.0.1", program.port)
    await reader.readline()
    yield reader, writer
    writer.close()
    await writer.wait_closed()


def test_an_estop_sent_behind_another_clients_arm_outlives_a_freeze(tmp_path: Path):
    """Frozen: 60 pings and an arm from A, then an estop from B: it is estopped, and stays so.

    An arm that is read before the e-stop arms what is armed; one that is read after it is void.
    """

    async def scenario() -> None:
        async with (
            driving(tmp_path) as (program, client),
            raw(program) as (reader_a, a),
            raw(program) as (reader_b, b),
        ):
            await at_rest(program.board, client)
            async with frozen(program):
                a.write(b'{"jsonrpc":"2.0","id":0,"method":"ping"}\n' * 60)
                a.write(b'{"jsonrpc":"2.0","id":1,"method":"arm"}\n')
                await asyncio.sleep(0.1)
                b.write(b'{"jsonrpc":"2.0","id":2,"method":"estop","params":{"reason":"smoke"}}\n')
                await asyncio.sleep(0.2)
            assert b'"result"' in await reader_b.readline()
            answers = [json.loads(await reader_a.readline()) for _ in range(61)]
            refused = [answer["error"]["data"]["kind"] for answer in answers if "error" in answer]
            assert refused in ([], ["overtaken"], ["too_old"])  # too old where this test was held up
            await asyncio.sleep(1.0)
            assert (await told(client))[0] == "estopped"

    asyncio.run(scenario())


@pytest.mark.slow
def test_drives_that_were_sent_during_a_freeze_move_nothing(tmp_path: Path):
    """It stands and is frozen for a second, in which five drives are sent: all refused as too old, the wheels still."""

    async def scenario() -> None:
        async with driving(tmp_path) as (program, client), raw(program) as (reader, writer):
            await at_rest(program.board, client)
            async with frozen(program):
                for _ in range(5):
                    writer.write(DRIVE)
                    await asyncio.sleep(0.2)
            answers = [json.loads(await reader.readline()) for _ in range(5)]
            assert [answer["error"]["data"]["kind"] for answer in answers] == ["too_old"] * 5
            assert await fastest_m_s(program.board, 1.0) <= REST_M_S
            assert await told(client) == ("armed", None)

    asyncio.run(scenario())


@pytest.mark.slow
@pytest.mark.parametrize("frozen_s", sample([1.0, 5.0]))
def test_a_freeze_at_rest_is_no_fault(tmp_path: Path, frozen_s: float):
    """However long, the robot is armed after it, moves nothing by itself, and drives at once when told."""

    async def scenario() -> None:
        async with driving(tmp_path) as (program, client):
            await at_rest(program.board, client)
            async with frozen(program):
                await asyncio.sleep(frozen_s)
            assert await fastest_m_s(program.board, 1.0) <= REST_M_S
            assert await told(client) == ("armed", None)
            while program.board.speed_m_s < SPEED_M_S / 2:
                await drive_once(client)
                await asyncio.sleep(PERIOD_S)
            assert await told(client) == ("armed", None)

    asyncio.run(scenario())


@pytest.mark.parametrize("frozen_s", sample([1.2, 5.0]))
def test_a_freeze_in_mid_drive_ends_in_a_stop(tmp_path: Path, frozen_s: float):
    """The board drives on meanwhile, as nothing can stop it. Then the robot brakes and disarms, whoever wakes first."""

    async def scenario() -> None:
        async with driving(tmp_path) as (program, client):
            while program.board.speed_m_s < SPEED_M_S / 2:
                await drive_once(client)
                await asyncio.sleep(PERIOD_S)
            async with frozen(program):
                await asyncio.sleep(frozen_s)
            await stopped(program.board)
            assert await fastest_m_s(program.board, 0.5) <= REST_M_S
            assert await told(client) == ("disarmed", "loop_blocked")
            assert not program.board.told_to_move

    asyncio.run(scenario())


CTL = "from chefbotd.cli.programs.chefbotctl import main\nmain()"
FAST_RAD_S = "3.0"


@pytest.mark.parametrize("command", sample(["drive 0.2 0", f"wheels left={FAST_RAD_S} right={FAST_RAD_S}"]))
def test_a_command_whose_program_slept_is_over(tmp_path: Path, command: str):
    """It has the robot driven for two minutes, and is stopped for two seconds: it drives no more, and ends with 6."""

    async def scenario() -> None:
        async with asyncio.timeout(PATIENCE_S), started(tmp_path) as program, program.client() as client:
            await client.wait_until_armed(PATIENCE_S)
            address = ("--connect", f"127.0.0.1:{program.port}")
            process = await asyncio.create_subprocess_exec(
                sys.executable,
                *("-c", CTL, *address, *command.split(), "--for", "120"),
                stderr=asyncio.subprocess.PIPE,
            )
            while program.board.speed_m_s < SPEED_M_S / 2:  # noqa: ASYNC110 - nobody tells us
                await asyncio.sleep(PERIOD_S)
            os.kill(process.pid, signal.SIGSTOP)
            await stopped(program.board)
            await asyncio.sleep(2.0)
            os.kill(process.pid, signal.SIGCONT)
            heard = len(program.board.heard)
            _, errors = await process.communicate()
            assert process.returncode == Exit.NOT_DONE, errors
            assert b"did not run for" in errors
            assert all(program.board.is_stop(line) for _, line in program.board.heard[heard:])

    asyncio.run(scenario())
