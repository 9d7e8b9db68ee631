"""Every way out of the real program on a real pty: what is the last thing that the board hears."""

import asyncio
import contextlib
import os
import signal
from pathlib import Path

import pytest

from chefbotd.client import CallError, Client
from chefbotd.process.last_stop import STOPS
from chefbotd.process.signals import SUSPENDING
from tests.budget import sample
from tests.scenarios.process import (
    BROKEN_SERVICE,
    HELD,
    NO_GUARD,
    OUT_OF_MEMORY,
    PERIOD_S,
    REST_M_S,
    Program,
    drive_on,
    drive_once,
    drive_until_told,
    driving,
    second_daemon,
    started,
    stopped,
)

pytestmark = pytest.mark.realtime

# What a process makes of every signal that there is, tests/chefbotd/test_signals.py says; here is one of each sort.
SENT = (
    signal.SIGTERM,
    signal.SIGINT,
    signal.SIGHUP,
    signal.SIGPROF,
    signal.SIGABRT,
    signal.SIGSEGV,
    signal.SIGRTMIN,
    signal.SIGRTMAX,
)


@pytest.mark.parametrize("number", sample(SENT), ids=lambda number: number.name)
def test_a_signal_ends_with_a_stop(tmp_path: Path, number: signal.Signals):
    """In mid-drive: zeros are the last line, and the exit code is 0."""

    async def scenario() -> None:
        async with driving(tmp_path) as (program, _):
            os.kill(program.process.pid, number)
            assert await program.ended() == 0
            assert not program.board.told_to_move

    asyncio.run(scenario())


@pytest.mark.slow
def test_nothing_puts_the_daemon_to_sleep_while_the_robot_moves(tmp_path: Path):
    """Ctrl-Z and its like are ignored: the dead-man still stops the robot when its driver says no more."""

    async def scenario() -> None:
        async with driving(tmp_path) as (program, _):
            for number in SUSPENDING:
                os.kill(program.process.pid, number)
            await stopped(program.board)
            assert program.process.returncode is None

    asyncio.run(scenario())


@pytest.mark.slow
def test_out_of_memory_in_a_request_stops_nothing(tmp_path: Path):
    """The request gets an error, the robot drives on, and a signal still ends with a stop."""

    async def scenario() -> None:
        async with driving(tmp_path, OUT_OF_MEMORY) as (program, client):
            with pytest.raises(CallError) as refusal:
                await client.call("get_stats")
            assert refusal.value.kind == "internal"
            await drive_on(program.board, client)
            program.process.terminate()
            assert await program.ended() == 0
            assert not program.board.told_to_move

    asyncio.run(scenario())


def test_a_blocked_loop_is_stopped_by_the_watchdog(tmp_path: Path):
    """A request keeps the loop until the board was told to stand, and a second longer: disarmed when the loop is back.

    How soon that is, `make faults` measures.
    """
    held = tmp_path / "held"
    held.touch()
    environment = {"HELD": str(held), "CHEFBOTD_SAFETY__COMMAND_TIMEOUT_S": "2"}

    async def scenario() -> None:
        async with driving(tmp_path, HELD, environment=environment) as (program, client):
            heard, is_stop = program.board.heard, program.board.is_stop
            commanding = asyncio.create_task(_command(client))
            asking = asyncio.create_task(client.call("get_stats"))
            while program.board.told_to_move:  # noqa: ASYNC110 - nobody tells us
                await asyncio.sleep(PERIOD_S)
            commanding.cancel()
            stopped_at = len(heard)
            await asyncio.sleep(1.2)  # more than latch_after_s
            held.unlink()
            await asyncio.gather(asking, commanding, return_exceptions=True)
            told = (await client.call("get_state"))["safety"]
            assert (told["armed"], told["fault"]) == (False, "loop_blocked")
            assert all(is_stop(line) for _, line in heard[stopped_at:])
            assert await program.logged("loop_blocked")

    asyncio.run(scenario())


def test_a_service_that_cannot_run_ends_the_program_with_a_stop(tmp_path: Path):
    """Odometry fails as soon as it starts, six times: exit code 1, the traceback in the log, zeros and nothing else."""

    async def scenario() -> None:
        async with started(tmp_path, BROKEN_SERVICE) as program:
            assert await program.ended() == 1
            assert all(program.board.is_stop(line) for _, line in program.board.heard)
        assert "6 failures within 60 s" in program.log.read_text()
        assert "RuntimeError: broken" in program.log.read_text()

    asyncio.run(scenario())


def test_kill_9_is_followed_by_stops_from_the_guard(tmp_path: Path):
    """Nothing that runs in the process can help: another one, which waited for its end, puts a stop on the wire."""

    async def scenario() -> None:
        async with driving(tmp_path) as (program, _):
            program.process.kill()
            assert await program.ended() == -signal.SIGKILL
            await stopped(program.board)

    asyncio.run(scenario())


def test_a_guard_that_is_killed_itself_is_told_and_started_again(tmp_path: Path):
    """So a daemon that is killed later is followed by stops all the same."""

    async def scenario() -> None:
        async with driving(tmp_path) as (program, client):
            first = await _guard_of(program.process.pid)
            os.kill(first, signal.SIGKILL)
            while await _guard_of(program.process.pid) == first:
                await drive_once(client)
                await asyncio.sleep(PERIOD_S)
            assert await program.logged("is started again")
            await drive_until_told(program.board, client)
            await _killed_and_stopped(program)

    asyncio.run(scenario())


def test_a_guard_outlives_every_signal_that_can_be_caught(tmp_path: Path):
    """A service manager sends its own (SIGABRT, SIGTERM) to each process of a service, not to the daemon alone."""

    async def scenario() -> None:
        async with driving(tmp_path) as (program, client):
            guard = await _guard_of(program.process.pid)
            for number in signal.valid_signals() - {signal.SIGKILL, signal.SIGSTOP}:
                os.kill(guard, number)
            await drive_until_told(program.board, client)
            await _killed_and_stopped(program)
        assert "is started again" not in program.log.read_text()

    asyncio.run(scenario())


@pytest.mark.slow
def test_a_cable_pulled_as_the_daemon_is_killed_is_followed_by_stops_once_it_is_back(tmp_path: Path):
    """It is away for four seconds; the board, which has its own power, drives on meanwhile."""

    async def scenario() -> None:
        async with driving(tmp_path) as (program, _):
            program.board.unplug()
            program.process.kill()
            await program.ended()
            await asyncio.sleep(4.0)
            assert program.board.told_to_move
            assert program.board.speed_m_s > REST_M_S
            program.board.plug()
            await stopped(program.board)

    asyncio.run(scenario())


async def _guard_of(daemon_pid: int) -> int:
    """The process that waits for the daemon's end, once it does: with its signals set."""
    while (found := _waiting_for(daemon_pid)) is None:  # noqa: ASYNC110 - nobody tells us
        await asyncio.sleep(PERIOD_S)
    return found


async def _command(client: Client) -> None:
    """Drive on until cancelled."""
    while True:
        await drive_once(client)
        await asyncio.sleep(PERIOD_S)


def _lives(pid: int) -> bool:
    return Path(f"/proc/{pid}").exists()


def _waiting_for(daemon_pid: int) -> int | None:
    for folder in Path("/proc").glob("[0-9]*"):
        with contextlib.suppress(OSError):
            status = dict(line.split(":\t", 1) for line in (folder / "status").read_text().splitlines())
            is_child = int(status["PPid"]) == daemon_pid
            if is_child and int(status["SigIgn"], 16) & (1 << signal.SIGHUP - 1):
                return int(folder.name)
    return None


async def _killed_and_stopped(program: Program) -> None:
    program.process.kill()
    await program.ended()
    await stopped(program.board)


def test_who_ends_in_order_is_followed_by_no_guard(tmp_path: Path):
    """After SIGTERM the daemon's own four stops are the last that the board hears."""

    async def scenario() -> None:
        async with driving(tmp_path) as (program, _):
            guard = await _guard_of(program.process.pid)
            program.process.terminate()
            assert await program.process.wait() == 0
            heard = len(program.board.heard)
            assert not _lives(guard)
            await stopped(program.board)
            assert len(program.board.heard) - heard < STOPS

    asyncio.run(scenario())


@pytest.mark.slow
def test_a_guard_leaves_the_port_to_whoever_has_it(tmp_path: Path):
    """A second daemon, which waits for the port, is killed: the first one's robot drives on."""
    environment = {"CHEFBOTD_SAFETY__COMMAND_TIMEOUT_S": "2"}

    async def scenario() -> None:
        async with driving(tmp_path, environment=environment) as (program, client):
            async with second_daemon(program) as second:
                while _waiting_for(second.process.pid) is None:
                    await drive_once(client)
                    await asyncio.sleep(PERIOD_S)
                before = len(program.board.heard)
                second.process.kill()
                await second.process.wait()
            for _ in range(round(1.0 / PERIOD_S)):
                await drive_once(client)
                await asyncio.sleep(PERIOD_S)
            await drive_on(program.board, client)
            heard = program.board.heard[before:]
            assert heard
            assert not any(program.board.is_stop(line) for _, line in heard)

    asyncio.run(scenario())


def test_a_guard_that_cannot_be_started_is_said_and_holds_up_nothing(tmp_path: Path):
    """The daemon drives without it."""

    async def scenario() -> None:
        async with driving(tmp_path, NO_GUARD) as (program, _):
            assert program.board.told_to_move
            assert await program.logged(
                "the stop guard cannot start, so nothing stops the motors if chefbotd is killed"
            )

    asyncio.run(scenario())
